"""A lattice as regular grids, with neighbours at constant offsets, processed in vector blocks.

A cubic lattice is one grid, a graded lattice one grid per cell size. The nodes of a grid's bounding
box are numbered along its longest axis first. A block has as many consecutive nodes as a vector has
lanes; only blocks with a node of the lattice are stored. Springs are sorted by direction and stored
with their node of lower number, so that the other end of all springs of a direction has the same
offset. The data of a block are contiguous; springs and nodes that the lattice does not have get
weight zero.

A node where cell sizes meet has a place in the grid of each size. One place has its mass. The
others, and all places of a hanging node, follow their masters and pass their forces to them
(`msm.grid_joints`).
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from msm.external_loads import ExternalArrays, renumbered
from msm.graded import GradedLattice
from msm.grid_joints import Joints
from msm.grid_parts import Part, by_size, joined, whole
from msm.lattice import CORNERS, CellLattice, LatticeMesh
from msm.network import Network
from msm.simd import Lanes, lanes_of, widest, zeros

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_COUPLINGS = 125
"""Largest number of offsets between nodes that a foundation couples: two cells each way."""


class Grid(NamedTuple):
    """Input of the grid kernels, and the motion that they work on.

    There are m places, b blocks of l lanes and s directions. `lanes` (`msm.simd`) have the
    precision of all real arrays. `u` [m], `v` [m/s] and `force` [N], each (3, m), are those of all
    grids of a lattice.

    Springs: first place `start` (b,) of each block; `offset` (s,), `rest` [m] (s, 3), `length` [m]
    and `per_length` [1/m], each (s,), of each direction; `weight` (b s, l), relative to k_ref.
    Cells, blocks of their lowest corners: `cell_start`, `corner` (8,) offsets, `bulk` [J],
    `spacing` [m]; `axes`: those of the box, the one along which places are numbered first last, as
    `corner` has them. Foundation: `held_start`, `held_offset`, `held` [N/m]. Nodes, each (b, l):
    `mass`, `gamma_0`, `gamma_1` as in `Network`, `kept` and `share`, which integrators fill;
    `load` [N] (3 b, l). `uneven`: whether damping grows with the displacement.
    """

    lanes: Lanes
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
    axes: tuple[int, int, int]
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


class Grids(NamedTuple):
    """A lattice as `grids`, one per cell size, with their motion in shared arrays.

    `place` (n,): primary place of each node. `joints`: coupling of the grids, None for one grid.
    `fixed` (f, 2): component and place of constrained displacements. `external`, `beta` [s] and
    `linear` as in `Network`, but None for no damping and for nonlinear forces: kernels are compiled
    without unused parts. They are not in `Grid`, so that kernels of a grid are compiled once.
    """

    grids: tuple[Grid, ...]
    place: Ints
    joints: Joints | None
    fixed: Ints
    external: ExternalArrays | None
    beta: float | None
    linear: Literal[True] | None


def grids_of(
    lattice: LatticeMesh, net: Network, width: int | None = None, *, single: bool = False
) -> Grids | None:
    """The grids of a network on a lattice, with the vector width of the processor, or None.

    There is none for a lattice on tetrahedra, one with initial stress, or a foundation that couples
    distant nodes. `single`: in single precision, with twice as many lanes.
    """
    if not isinstance(lattice, CellLattice | GradedLattice) or net.is_strained:
        return None
    width = width or (2 * widest() if single else widest())
    parts = [whole(lattice, net)] if isinstance(lattice, CellLattice) else by_size(lattice, net)
    if any(len(part.held.offset) > MOST_COUPLINGS for part in parts):
        return None
    place, first = [], 0
    for part in parts:
        margin = part.reach + 2 * width  # forces of a block's last cells go into the next
        place.append(first + margin + part.numbers)
        first += part.count + 2 * margin
    motion = np.zeros((3, 3, first))
    primary = np.zeros(len(net.mass), dtype=np.int64)
    for part, at in reversed(list(zip(parts, place, strict=True))):
        primary[part.node] = at  # in the smallest cells that have it, which own it
    grids = Grids(
        tuple(
            _grid(part, net, at, motion, width, single=single)
            for part, at in zip(parts, place, strict=True)
        ),
        primary,
        None if len(parts) == 1 else joined(parts, place, primary, net),
        np.stack([net.fixed[:, 1], primary[net.fixed[:, 0]]], axis=1).astype(np.int64),
        None if net.external is None else renumbered(net.external, primary),
        net.beta or None,
        True if net.linear else None,
    )
    return _in_single(grids) if single else grids


def _grid(
    part: Part, net: Network, place: Ints, motion: Floats, width: int, *, single: bool
) -> Grid:
    """The grid of a part whose nodes stand at places (k,) of the motion."""
    springs, held, owned = part.springs, part.held, part.owned
    blocks = _Blocks(place, width)
    cells = _Blocks(place[part.lowest], width)
    supports = _Blocks(place[held.node], width)
    length = np.linalg.norm(part.rest, axis=1)
    own, node = place[owned], part.node[owned]
    u, v, force = motion
    slow, middle, fast = np.argsort(-part.strides, kind="stable").tolist()
    axes = slow, middle, fast
    return Grid(
        lanes=lanes_of(width, single=single),
        u=u,
        v=v,
        force=force,
        start=blocks.start,
        offset=springs.offset,
        rest=part.rest,
        length=length,
        per_length=1.0 / length,
        weight=blocks.rows(place[springs.node], springs.which, springs.value, len(springs.offset)),
        cell_start=cells.start,
        axes=axes,
        corner=CORNERS @ part.strides[list(axes)],
        bulk=cells.rows(cells.place, 0, net.bulk[part.cells]),
        spacing=float(part.spacing),
        held_start=supports.start,
        held_offset=held.offset,
        held=supports.rows(supports.place, held.which, held.value, len(held.offset)),
        mass=blocks.rows(own, 0, net.mass[node], without=1.0),
        gamma_0=blocks.rows(own, 0, net.gamma_0[node]),
        gamma_1=blocks.rows(own, 0, net.gamma_1[node]),
        kept=blocks.rows(own, 0, 0.0),
        share=blocks.rows(own, 0, 0.0),
        load=blocks.rows(own[:, None], np.arange(3), net.load[node], 3),
        uneven=bool(net.gamma_1.any()),
    )


def _in_single(of: Grids) -> Grids:
    """All arrays of reals of the grids in single precision."""
    return of._replace(grids=tuple(_rounded(grid) for grid in of.grids))


def _rounded(grid: Grid) -> Grid:
    return Grid._make(_single(x) if isinstance(x, np.ndarray) else x for x in grid)


def _single(x: NDArray[Any]) -> NDArray[Any]:
    return x.astype(np.float32) if x.dtype == np.float64 else x


class _Blocks:
    """The fewest blocks of a given width that cover the places, in ascending order."""

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
        """Sum of values by block, kind and lane, (b kinds, l); `without` where there is none."""
        block = np.searchsorted(self.start, place, side="right") - 1
        lane = place - self.start[block] if len(place) else place
        found = zeros((len(self.start) * kinds, self.width))
        np.add.at(found, (block * kinds + which, lane), value)
        if without:
            empty = np.ones(found.shape, dtype=bool)
            empty[block * kinds + which, lane] = False
            found[empty] = without
        return found
