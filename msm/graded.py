"""Graded lattice: cells of several sizes, fine near places of interest and coarse elsewhere.

Each cell has springs and volume term as in a uniform lattice of its size. Weights let all springs
share one law: the stiffness of a spring is proportional to the edge of its cell. Hanging nodes
(`msm.hanging`) make the displacement continuous where sizes meet.

The lattice passes the patch test at any uniform strain. The forces of edges and face diagonals on
the corners of a cell are those of a uniform stress with trilinear shape functions, so they are in
equilibrium across cell sizes too. Those of body diagonals are not: under shear they leave a
residual at the corners of a fine region.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array
from scipy.spatial import KDTree

from msm.kinematics import inverted_cells
from msm.lattice import CORNERS, CellLattice, at_nodes, interpolation
from msm.octree import Grading, Leaves, leaves
from msm.springs import Springs, connect
from msm.ties import hanging_nodes
from study.organ.occupancy import SolidShape

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class GradedLattice:
    """Cells of several sizes over one set of nodes, hanging ones included.

    `levels`: the cells of each size, the finest first. `masters` (n, n): interpolation of all nodes
    from those that do not hang. `dropped`: fraction of the body's volume in dropped cells.
    """

    levels: tuple[CellLattice, ...]
    masters: csr_array
    dropped: float

    @property
    def nodes(self) -> Floats:
        """Nodes [m] (n, 3)."""
        return self.levels[0].nodes

    @property
    def spacing(self) -> float:
        """Edge [m] of the finest cells, at which springs of relative stiffness 1 have k_ref."""
        return self.levels[0].spacing

    @property
    def cells(self) -> Ints:
        """Node numbers (c, 8), corners in the order of CORNERS, the finest cells first."""
        return np.concatenate([one.cells for one in self.levels])

    @property
    def origin(self) -> Floats:
        """Lower corner [m] (3,) of the box of the cells."""
        return self.levels[0].origin

    @property
    def index(self) -> Ints:
        """Position of each cell (c, 3) from the origin, in units of its own edge."""
        return np.concatenate([one.index for one in self.levels])

    @property
    def edges(self) -> Floats:
        """Edge [m] of each cell (c,)."""
        return np.concatenate([one.edges for one in self.levels])

    @property
    def fill(self) -> Floats:
        """Fraction of each cell (c,) inside the body."""
        return np.concatenate([one.fill for one in self.levels])

    @property
    def hanging(self) -> int:
        """Number of hanging nodes."""
        return int(hanging_nodes(self.masters).sum())

    def interpolation(self, points: Floats) -> tuple[csr_array, int]:
        """Trilinear weights (q, n) at points [m] (q, 3), and the number outside all cells.

        At those the nearest cell is extrapolated. The weights of hanging nodes are moved to their
        masters.
        """
        apart = np.array([_outside(one, points) for one in self.levels])
        nearest, outside = apart.argmin(axis=0), 0
        whole = csr_array((len(points), len(self.nodes)))
        for level, one in enumerate(self.levels):
            chosen = np.flatnonzero(nearest == level)
            if len(chosen):
                weights, count = interpolation(one, points[chosen])
                place = (np.ones(len(chosen)), (chosen, np.arange(len(chosen))))
                whole += csr_array(place, shape=(len(points), len(chosen))) @ weights
                outside += count
        return csr_array(whole @ self.masters), outside

    def inverted_cells(self, displacement: Floats) -> int:
        """Number of cells that a displacement [m] (n, 3) inverts: J <= 0 of the mean F."""
        return int(inverted_cells(self.cells, self.edges, displacement))


def _outside(level: CellLattice, points: Floats) -> Floats:
    """Distance [m] of points (q, 3) from the nearest cell of a level; 0 inside."""
    if len(level.index) == 0:
        return np.full(len(points), np.inf)
    centres = level.origin + level.spacing * (level.index + 0.5)
    away, _ = KDTree(centres).query(points, p=np.inf)
    rounding = 1e-9 * level.spacing
    return np.asarray(np.maximum(away - 0.5 * level.spacing - rounding, 0.0))


def build(body: SolidShape, lower: Floats, upper: Floats, grading: Grading) -> GradedLattice:
    """Graded lattice of a body within the box `lower`, `upper` [m], cells from the lower corner on.

    ValueError for too many cells, or none.
    """
    found, finest, dropped = leaves(body, lower, upper, grading)
    shape = finest + 1
    strides = np.array([shape[1] * shape[2], shape[2], 1])
    corner = [
        ((one.index[:, None, :] + CORNERS) * 2**level) @ strides for level, one in enumerate(found)
    ]
    used = np.unique(np.concatenate([one.ravel() for one in corner]))
    nodes = lower + grading.spacing * np.stack(np.unravel_index(used, shape), axis=1)
    levels = tuple(
        CellLattice(
            grading.edge(level),
            lower,
            nodes,
            np.searchsorted(used, corner[level]),
            one.index,
            one.fill,
            0.0,
        )
        for level, one in enumerate(found)
    )
    return GradedLattice(levels, _masters(found, used, strides), dropped)


def _masters(found: list[Leaves], used: Ints, strides: Ints) -> csr_array:
    """Interpolation (n, n) of all nodes from those that do not hang; `used` (n,): their places."""
    count = len(used)
    pairs = [
        tie for level, one in enumerate(found) if level for tie in _ties(level, one, used, strides)
    ]
    rows, columns = (np.concatenate([np.zeros(0, int), *(tie[k] for tie in pairs)]) for k in (0, 1))
    tied = csr_array((np.ones(len(rows)), (rows, columns)), shape=(count, count))
    # Each cell at an edge contributes the same tie; the weights of a node are normalised to 1.
    free = np.ones(count, dtype=bool)
    free[rows] = False
    sums = np.asarray(tied.sum(axis=1)).ravel() + free
    tied = csr_array(diags_array(1.0 / sums) @ tied + diags_array(free.astype(float)))
    for _ in found:  # a master may hang on the next level
        tied = csr_array(tied @ tied)
    tied.eliminate_zeros()
    return tied


def _ties(level: int, of: Leaves, used: Ints, strides: Ints) -> Iterator[tuple[Ints, Ints]]:
    """Nodes in the middle of edges and faces of a level's cells, each with one of its masters."""
    lowest, half = of.index * 2**level, 2 ** (level - 1)
    for at in product((0, 1, 2), repeat=3):
        middle = [d for d in range(3) if at[d] == 1]
        if len(middle) not in {1, 2}:
            continue
        place = (lowest + half * np.array(at)) @ strides
        node = np.minimum(np.searchsorted(used, place), len(used) - 1)
        there = used[node] == place
        for ends in product((0, 2), repeat=len(middle)):
            corner = np.array(at)
            corner[middle] = ends
            yield node[there], np.searchsorted(used, ((lowest + half * corner) @ strides)[there])


def springs(
    lattice: GradedLattice, flexion: float = 0.0, stiffness: Floats | None = None
) -> Springs:
    """Springs of all cells, with stiffness relative to k_ref of the finest edge.

    `flexion` and `stiffness` (c,) as in `msm.springs`; flexion springs span cells of one size.
    """
    shares = _by_level(lattice, np.ones(len(lattice.edges)) if stiffness is None else stiffness)
    parts = [
        (one.spacing / lattice.spacing, connect(one, flexion, stiffness=share))
        for one, share in zip(lattice.levels, shares, strict=True)
        if len(one.cells)
    ]
    ends = np.concatenate([part.ends for _, part in parts])
    rest = np.concatenate([part.rest for _, part in parts])
    weight = np.concatenate([edge * part.weight for edge, part in parts])
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    return Springs(ends[order], rest[order], weight[order])


def _by_level(lattice: GradedLattice, values: Floats) -> list[Floats]:
    """Values (c,) of all cells, split by cell size."""
    return np.split(values, np.cumsum([len(one.cells) for one in lattice.levels])[:-1])


def node_masses(lattice: GradedLattice, density: Floats) -> Floats:
    """Lumped mass [kg] (n,), that of hanging nodes at their masters.

    `density` [kg/m^3] (c,): density of the tissue of each cell.
    """
    filled = _by_level(lattice, lattice.fill * density)
    masses = sum(at_nodes(one, share) for one, share in zip(lattice.levels, filled, strict=True))
    return np.asarray(lattice.masters.T @ masses)
