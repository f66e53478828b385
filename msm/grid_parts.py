"""Parts of a lattice from which grids are made: nodes, springs and support of one cell size."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from msm.graded import GradedLattice
from msm.grid_joints import Joints
from msm.lattice import CellLattice
from msm.network import Network

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

WHOLE = 1e-6
"""Deviation of a rest vector from whole numbers of edges, relative to an edge, for rounding."""


class Pairs(NamedTuple):
    """Pairs of nodes: first node, number of the direction, value; offset of each direction."""

    node: Ints
    which: Ints
    value: Floats
    offset: Ints


NOTHING = np.zeros(0, dtype=np.int64)
NO_PAIRS = Pairs(NOTHING, NOTHING, np.zeros(0), NOTHING)


@dataclass(frozen=True)
class Part:
    """Cells of one size with their nodes, springs and support.

    `node` (k,): numbers of the nodes in the network; `numbers` (k,): in their bounding box, which
    has `count` nodes and `strides` (3,) along its axes. `springs`: pairs from the node of lower
    number, `held`: those of the foundation, both in node numbers of the part; `rest` [m] (s, 3) of
    each direction. `cells` (c,): numbers in the network; `lowest` (c,): their lowest corners.
    `owned` (k,): whether the part has mass and load of a node.
    """

    spacing: float
    node: Ints
    numbers: Ints
    strides: Ints
    count: int
    springs: Pairs
    rest: Floats
    held: Pairs
    cells: Ints
    lowest: Ints
    owned: NDArray[np.bool_]

    @property
    def reach(self) -> int:
        """Largest offset between a node and any other that the kernels read for it."""
        offsets = (self.springs.offset, self.held.offset)
        return int(max(*(np.abs(found).max(initial=0) for found in offsets), self.strides.sum()))


def whole(lattice: CellLattice, net: Network) -> Part:
    """The single part of a lattice with cells of one size."""
    every = np.arange(len(net.mass))
    index = _index(lattice, every)
    strides, count = _numbering(index)
    springs, rest = _springs(net, np.arange(len(net.ends)), index, strides, lattice.spacing)
    return Part(
        lattice.spacing,
        every,
        index @ strides,
        strides,
        count,
        springs,
        rest,
        _couplings(net, index @ strides),
        np.arange(len(net.cells)),
        net.cells[:, 0].astype(np.int64),
        np.ones(len(every), dtype=np.bool_),
    )


def by_size(lattice: GradedLattice, net: Network) -> list[Part]:
    """Parts of each cell size, the finest first; the joints have the support of several parts.

    A spring belongs to the largest cells that have both its nodes, so that each part has the spring
    directions of its own cells only. A node is owned by the smallest cells that have it.
    """
    levels = [one for one in lattice.levels if len(one.cells)]
    if len(levels) == 1:
        return [whole(levels[0], net)]
    left = np.ones(len(net.ends), dtype=np.bool_)
    taken: dict[int, Ints] = {}
    for n, one in reversed(list(enumerate(levels))):
        corner = np.zeros(len(net.mass), dtype=np.bool_)
        corner[one.cells] = True
        steps = net.rest / one.spacing
        fits = (np.abs(steps - np.rint(steps)) < WHOLE).all(axis=1)
        taken[n] = np.flatnonzero(left & fits & corner[net.ends].all(axis=1))
        left[taken[n]] = False
    parts, owned = [], np.zeros(len(net.mass), dtype=np.bool_)
    owned[net.hanging] = True  # by none
    for n, one in enumerate(levels):
        parts.append(_size(one, net, taken[n], owned))
        owned[parts[-1].node] = True
    return parts


def _size(level: CellLattice, net: Network, chosen: Ints, owned: NDArray[np.bool_]) -> Part:
    """The part of one cell size with the chosen springs; it owns nodes that are not owned yet."""
    node = np.unique(level.cells)
    index = _index(level, node)
    strides, count = _numbering(index)
    local = np.zeros(len(net.mass), dtype=np.int64)
    local[node] = np.arange(len(node))
    at = np.zeros((len(net.mass), 3), dtype=np.int64)
    at[node] = index
    springs, rest = _springs(net, chosen, at, strides, level.spacing)
    cells = np.flatnonzero(np.abs(net.edges / level.spacing - 1.0) < WHOLE)
    return Part(
        level.spacing,
        node,
        index @ strides,
        strides,
        count,
        springs._replace(node=local[springs.node]),
        rest,
        NO_PAIRS,
        cells,
        local[net.cells[cells, 0].astype(np.int64)],
        ~owned[node],
    )


def _index(lattice: CellLattice, node: Ints) -> Ints:
    """Positions (k, 3) of nodes in their bounding box, in cell edges."""
    index = np.rint((lattice.nodes[node] - lattice.origin) / lattice.spacing).astype(np.int64)
    return np.asarray(index - index.min(axis=0))


def _numbering(index: Ints) -> tuple[Ints, int]:
    """Strides (3,) and number of nodes of a bounding box, numbered along its longest axis first."""
    counts = index.max(axis=0) + 1
    strides = np.ones(3, dtype=np.int64)
    first, second, third = np.argsort(-counts, kind="stable")
    strides[second] = counts[first]
    strides[third] = counts[first] * counts[second]
    return strides, int(counts.prod())


def _springs(
    net: Network, chosen: Ints, index: Ints, strides: Ints, spacing: float
) -> tuple[Pairs, Floats]:
    """The chosen springs from their end of lower number, and the rest vector [m] by direction."""
    ends = net.ends[chosen].astype(np.int64)
    apart = index[ends[:, 1]] - index[ends[:, 0]]
    ahead = apart @ strides > 0
    node = np.where(ahead, ends[:, 0], ends[:, 1])
    steps, which = np.unique(np.where(ahead, 1, -1)[:, None] * apart, axis=0, return_inverse=True)
    weight = net.scale[chosen] / net.length[chosen]
    return Pairs(node, which.ravel(), weight, steps @ strides), spacing * steps


def _couplings(net: Network, number: Ints) -> Pairs:
    """Entries of the foundation by the offset of the column's node from the row's."""
    counts = net.row[1:].astype(np.int64) - net.row[:-1].astype(np.int64)
    node = np.repeat(np.arange(len(number)), counts)
    ahead = number[net.column.astype(np.int64)] - number[node]
    offset, which = np.unique(ahead, return_inverse=True)
    return Pairs(node, which, net.value, offset)


def joined(parts: list[Part], place: list[Ints], primary: Ints, net: Network) -> Joints:
    """Copies of nodes with their masters and weights, and the foundation.

    `place` (k,) of each part: of its nodes in the motion; `primary` (n,): that of each node of the
    network which carries its motion.
    """
    copies = [
        (part.node[~part.owned], at[~part.owned]) for part, at in zip(parts, place, strict=True)
    ]
    node, copy = (np.concatenate([pair[k] for pair in copies]) for k in (0, 1))
    masters = csr_array(_masters(net)[node])
    row = net.row.astype(np.int64)
    held = np.flatnonzero(np.diff(row))
    return Joints(
        copy.astype(np.int64),
        masters.indptr.astype(np.int64),
        primary[masters.indices],
        masters.data,
        primary[held],
        row[np.append(held, len(row) - 1)],
        primary[net.column.astype(np.int64)],
        net.value,
    )


def _masters(net: Network) -> csr_array:
    """Interpolation (n, n) of all nodes from those that do not hang."""
    count = len(net.mass)
    is_free = np.ones(count, dtype=np.bool_)
    is_free[net.hanging] = False
    free = np.flatnonzero(is_free)
    first = net.first_master.astype(np.int64)
    rows = np.concatenate([free, np.repeat(net.hanging.astype(np.int64), first[1:] - first[:-1])])
    columns = np.concatenate([free, net.master.astype(np.int64)])
    shares = np.concatenate([np.ones(len(free)), net.part])
    return csr_array((shares, (rows, columns)), shape=(count, count))
