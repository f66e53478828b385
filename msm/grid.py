"""A cubic lattice as a regular grid: neighbours at constant offsets, read in blocks of lanes.

The nodes of the organ's bounding box are numbered along its longest axis first. A block is as many
nodes in a row of that numbering as a vector has lanes; only blocks that hold a node of the lattice
are kept, so rows are trimmed to the organ. Springs are sorted by direction, each with the node of
its lower number: of all springs of one direction the other end lies equally far ahead. What a block
needs, weights of springs included, stands together; a spring or node that the lattice does not have
has no weight.
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from msm.lattice import CORNERS, CellLattice, LatticeMesh
from msm.network import Network
from msm.outer import Outer, placed
from msm.simd import Lanes, lanes_of, widest

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_COUPLINGS = 125
"""Directions in which a foundation may couple nodes: two cells each way; an organ's takes one."""


class Grid(NamedTuple):
    """What the kernels of a grid read, and the motion that they work on.

    With m places of the box, b blocks of l lanes and s directions: `lanes`, see `msm.simd`; their
    precision is that of all arrays of reals. `place` (n,): of each node. `u` [m], `v` [m/s],
    `force` [N], each (3, m).

    Springs: first place `start` (b,) of each block; `offset` (s,), `rest` [m] (s, 3), `length` [m]
    and `per_length` [1/m], each (s,), of each direction; `weight` (b s, l), relative to k_ref.
    Cells, blocks of their lowest corners: `cell_start`, `corner` (8,) offsets, `bulk` [J],
    `spacing` [m]. Foundation: `held_start`, `held_offset`, `held` [N/m]. Nodes, each (b, l):
    `mass`, `gamma_0`, `gamma_1` as in `Network`, `kept` and `share`, which integrators fill;
    `load` [N] (3 b, l). `uneven`: whether damping grows with the displacement. `beta`
    [s], `linear` and `outer` as in `Network`, but None for no: kernels are compiled without what is
    not wanted. `fixed` (f, 2): component and place of what does not move.
    """

    lanes: Lanes
    place: Ints
    u: Floats
    v: Floats
    force: Floats
    start: Ints
    offset: Ints
    rest: Floats
    length: Floats
    per_length: Floats
    weight: Floats
    cell_start: Ints
    corner: Ints
    bulk: Floats
    spacing: float
    held_start: Ints
    held_offset: Ints
    held: Floats
    mass: Floats
    gamma_0: Floats
    gamma_1: Floats
    kept: Floats
    share: Floats
    load: Floats
    uneven: bool
    beta: float | None
    linear: Literal[True] | None
    fixed: Ints
    outer: Outer | None


def grid_of(
    lattice: LatticeMesh, net: Network, width: int | None = None, *, single: bool = False
) -> Grid | None:
    """The grid of a network on a lattice, with lanes as the processor has; None if it is no grid.

    That is one on tetrahedra, with springs or cells of their own rest, or with a foundation that
    couples nodes far apart. `single`: in single precision, of which the processor takes twice as
    many at once.
    """
    if not isinstance(lattice, CellLattice) or net.is_strained:
        return None
    index, strides, count = _numbering(lattice)
    held = _couplings(net, index @ strides)
    if len(held.offset) > MOST_COUPLINGS:
        return None
    width = width or (2 * widest() if single else widest())
    springs, rest = _springs(net, index, strides)
    length = np.linalg.norm(rest, axis=1)
    reach = max(np.abs(found).max(initial=0) for found in (springs.offset, held.offset))
    margin = int(max(reach, strides.sum())) + width
    place = margin + index @ strides
    blocks = _Blocks(place, width)
    cells = _Blocks(place[net.cells[:, 0]], width)
    supports = _Blocks(place[held.node], width)
    u, v, force = np.zeros((3, 3, count + 2 * margin))
    grid = Grid(
        lanes=lanes_of(width, single=single),
        place=place,
        u=u,
        v=v,
        force=force,
        start=blocks.start,
        offset=springs.offset,
        rest=rest,
        length=length,
        per_length=1.0 / length,
        weight=blocks.rows(place[springs.node], springs.which, springs.value, len(springs.offset)),
        cell_start=cells.start,
        corner=CORNERS @ strides,
        bulk=cells.rows(cells.place, 0, net.bulk),
        spacing=net.spacing,
        held_start=supports.start,
        held_offset=held.offset,
        held=supports.rows(supports.place, held.which, held.value, len(held.offset)),
        mass=blocks.rows(place, 0, net.mass, without=1.0),
        gamma_0=blocks.rows(place, 0, net.gamma_0),
        gamma_1=blocks.rows(place, 0, net.gamma_1),
        kept=blocks.rows(place, 0, 0.0),
        share=blocks.rows(place, 0, 0.0),
        load=blocks.rows(place[:, None], np.arange(3), net.load, 3),
        uneven=bool(net.gamma_1.any()),
        beta=net.beta or None,
        linear=True if net.linear else None,
        fixed=np.stack([net.fixed[:, 1], place[net.fixed[:, 0]]], axis=1).astype(np.int64),
        outer=None if net.outer is None else placed(net.outer, place),
    )
    return _rounded(grid) if single else grid


def _rounded(grid: Grid) -> Grid:
    """All arrays of reals in single precision."""
    return Grid._make(_single(x) if isinstance(x, np.ndarray) else x for x in grid)


def _single(x: NDArray[Any]) -> NDArray[Any]:
    return x.astype(np.float32) if x.dtype == np.float64 else x


def _numbering(lattice: CellLattice) -> tuple[Ints, Ints, int]:
    """Where the nodes stand in their box (n, 3), how far the next one is along each axis, and m."""
    index = np.rint((lattice.nodes - lattice.origin) / lattice.spacing).astype(np.int64)
    index -= index.min(axis=0)
    counts = index.max(axis=0) + 1
    strides = np.ones(3, dtype=np.int64)
    first, second, third = np.argsort(-counts, kind="stable")
    strides[second] = counts[first]
    strides[third] = counts[first] * counts[second]
    return index, strides, int(counts.prod())


class _Pairs(NamedTuple):
    """Pairs of nodes by direction: the first node, which direction, a value; offsets of those."""

    node: Ints
    which: Ints
    value: Floats
    offset: Ints


def _springs(net: Network, index: Ints, strides: Ints) -> tuple[_Pairs, Floats]:
    """The springs from their ends of lower number, and the rest vector [m] of each direction."""
    ends = net.ends.astype(np.int64)
    apart = index[ends[:, 1]] - index[ends[:, 0]]
    ahead = apart @ strides > 0
    node = np.where(ahead, ends[:, 0], ends[:, 1])
    steps, which = np.unique(np.where(ahead, 1, -1)[:, None] * apart, axis=0, return_inverse=True)
    weight = net.scale / net.length
    return _Pairs(node, which.ravel(), weight, steps @ strides), net.spacing * steps


def _couplings(net: Network, number: Ints) -> _Pairs:
    """The entries of the foundation, by how far ahead of the row's node the column's stands."""
    counts = net.row[1:].astype(np.int64) - net.row[:-1].astype(np.int64)
    node = np.repeat(np.arange(len(number)), counts)
    ahead = number[net.column.astype(np.int64)] - number[node]
    offset, which = np.unique(ahead, return_inverse=True)
    return _Pairs(node, which, net.value, offset)


class _Blocks:
    """The fewest blocks of a width that cover places, in their order."""

    def __init__(self, place: Ints, width: int) -> None:
        self.place, self.width = place, width
        starts: list[int] = []
        covered = -1
        for p in np.unique(place).tolist():
            if p >= covered:
                starts.append(p)
                covered = p + width
        self.start = np.array(starts, dtype=np.int64)

    def rows(
        self, place: Ints, which: Any, value: Any, kinds: int = 1, *, without: float = 0.0
    ) -> Floats:
        """Values by block, kind and lane, (b kinds, l), summed; `without` where there is none."""
        block = np.searchsorted(self.start, place, side="right") - 1
        lane = place - self.start[block] if len(place) else place
        found = np.zeros((len(self.start) * kinds, self.width))
        np.add.at(found, (block * kinds + which, lane), value)
        if without:
            empty = np.ones(found.shape, dtype=bool)
            empty[block * kinds + which, lane] = False
            found[empty] = without
        return found
