"""Springs of a cubic lattice, calibrated to Young's modulus for any mix of spring families.

Structural springs run along cell edges, shear springs along face diagonals and, as a share, body
diagonals, flexion springs from a node to its second neighbour along an axis. With
k_ref = 0.4 E h [N/m] and weights relative to it, the bulk lattice has

    C44 = (k_face + 4/3 k_body) / h = k_ref / h,    C12 = C44,    C11 = 3 C44,

that is E = 2.5 k_ref / h and, as for every lattice of central springs, nu = 1/4 (Golec et al. 2020,
doi 10.1007/s00371-019-01663-0). Each cell contributes its share of its springs times its fill
fraction, so that boundary springs represent the existing tissue only. A flexion spring reduces the
two structural springs under it by exactly the stiffness that it adds in uniform strain, also at
free surfaces.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array

from msm.lattice import CORNERS, CellLattice

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


LARGEST_BODY_SHARE = 0.9


@dataclass(frozen=True)
class Springs:
    """Ends (s, 2), rest vectors [m] (s, 3) from the first end, `weight` (s,): over k_ref."""

    ends: Ints
    rest: Floats
    weight: Floats

    @property
    def rest_length(self) -> Floats:
        """Rest lengths [m] (s,)."""
        return np.asarray(np.linalg.norm(self.rest, axis=1))


def connect(
    lattice: CellLattice,
    flexion: float = 0.0,
    body_diagonals: float = 0.0,
    stiffness: Floats | None = None,
) -> Springs:
    """Springs of the lattice.

    `flexion`: fraction of the axial stiffness in flexion springs; `body_diagonals`: fraction of the
    shear stiffness in body diagonals; `stiffness` (c,): relative stiffness of each cell, 1 by
    default. ValueError outside [0, 1] and [0, LARGEST_BODY_SHARE].
    """
    filled = lattice.fill if stiffness is None else lattice.fill * stiffness
    if not 0.0 <= flexion <= 1.0:
        raise ValueError(f"flexion = {flexion:g}: give a share from 0 to 1")
    if not 0.0 <= body_diagonals <= LARGEST_BODY_SHARE:
        raise ValueError(
            f"body_diagonals = {body_diagonals:g}: give a share from 0 to {LARGEST_BODY_SHARE:g}; "
            "without face diagonals layers of nodes could shift in a chequerboard at no cost"
        )
    axial = 1.0 + body_diagonals
    structural = _cell_springs(lattice, filled, 1, axial / 4.0)
    face = _cell_springs(lattice, filled, 2, (1.0 - body_diagonals) / 2.0)
    body = _cell_springs(lattice, filled, 3, 0.75 * body_diagonals)
    families = [structural, face, body]
    if flexion > 0.0:
        families[0], second = _with_flexion(lattice, structural, flexion)
        families.append(second)
    ends = np.concatenate([ends for ends, _ in families])
    weight = np.concatenate([weight for _, weight in families])
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    order = order[weight[order] > 0.0]
    ends = ends[order]
    return Springs(ends, lattice.nodes[ends[:, 1]] - lattice.nodes[ends[:, 0]], weight[order])


def _cell_springs(
    lattice: CellLattice, filled: Floats, changes: int, share: float
) -> tuple[Ints, Floats]:
    """Springs between corners that differ in `changes` coordinates, summed over the cells."""
    pairs = np.array(
        [
            (a, b)
            for a, b in combinations(range(8), 2)
            if np.abs(CORNERS[a] - CORNERS[b]).sum() == changes
        ]
    )
    all_ends = np.sort(lattice.cells[:, pairs].reshape(-1, 2), axis=1)
    ends, spring = np.unique(all_ends, axis=0, return_inverse=True)
    weight = np.bincount(spring.ravel(), weights=np.repeat(filled * share, len(pairs)))
    return ends, weight.astype(np.float64)


def _with_flexion(
    lattice: CellLattice, structural: tuple[Ints, Floats], flexion: float
) -> tuple[tuple[Ints, Floats], tuple[Ints, Floats]]:
    """Structural springs reduced by the flexion springs over them, and those flexion springs.

    A flexion spring k_f of length 2 h stores 2 k_f h^2 strain^2, as does 2 k_f added to each of its
    two edges. With k_f a quarter of `flexion` times the weaker edge, no edge becomes negative.
    """
    ends, weight = structural
    axis = np.abs(lattice.nodes[ends[:, 1]] - lattice.nodes[ends[:, 0]]).argmax(axis=1)
    leaving = np.full((len(lattice.nodes), 3), -1)
    leaving[ends[:, 0], axis] = np.arange(len(ends))
    first = np.arange(len(ends))
    second = leaving[ends[:, 1], axis]
    first, second = first[second >= 0], second[second >= 0]
    k_f = 0.25 * flexion * np.minimum(weight[first], weight[second])
    relieved = weight.copy()
    np.subtract.at(relieved, first, 2.0 * k_f)
    np.subtract.at(relieved, second, 2.0 * k_f)
    spanning = np.stack([ends[first, 0], ends[second, 1]], axis=1)
    return (ends, relieved), (spanning, k_f)


def stiffness_matrix(springs: Springs, node_count: int, k_ref: float) -> csc_array:
    """Stiffness [N/m] (3 n, 3 n) of the springs at rest, degrees of freedom node by node."""
    direction = springs.rest / springs.rest_length[:, None]
    block = (k_ref * springs.weight)[:, None, None] * direction[:, :, None] * direction[:, None, :]
    i, j = springs.ends.T
    rows, columns, data = [], [], []
    for a, b, sign in ((i, i, 1.0), (j, j, 1.0), (i, j, -1.0), (j, i, -1.0)):
        r, c = np.broadcast_arrays(
            3 * a[:, None, None] + np.arange(3)[:, None], 3 * b[:, None, None] + np.arange(3)
        )
        rows.append(r.ravel())
        columns.append(c.ravel())
        data.append((sign * block).ravel())
    entries = (np.concatenate(data), (np.concatenate(rows), np.concatenate(columns)))
    return csc_array(coo_array(entries, shape=(3 * node_count, 3 * node_count)))
