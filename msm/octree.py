"""Balanced octree cells over a body, small near given places.

Two cells that touch, even at a corner, differ by one level at most. Level 0 is the finest; each
level has twice the edge of the one below.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, label

from msm.lattice import MAX_CELLS, SMALLEST_FILL, fill_fractions
from study.organ.occupancy import SolidShape

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

AROUND = np.ones((3, 3, 3), dtype=bool)


@dataclass(frozen=True)
class Grading:
    """Grading of the cell size: edge `spacing` [m] near `places` [m] (k, 3), coarser elsewhere.

    `reach` [m] (levels - 1,): distance from a place within which cells are finer than those of the
    next level; if empty, there is one level.
    """

    spacing: float
    places: Floats
    reach: tuple[float, ...]

    @property
    def levels(self) -> int:
        """Largest number of cell sizes."""
        return len(self.reach) + 1

    def edge(self, level: int) -> float:
        """Edge [m] of the cells of a level."""
        return float(self.spacing * 2**level)


@dataclass(frozen=True)
class Leaves:
    """The cells of one level: positions (c, 3) in units of their edge, and fill fractions (c,)."""

    index: Ints
    fill: Floats

    def where(self, chosen: Bools) -> Leaves:
        """The chosen cells."""
        return Leaves(self.index[chosen], self.fill[chosen])


def leaves(
    body: SolidShape, lower: Floats, upper: Floats, grading: Grading
) -> tuple[list[Leaves], Ints, float]:
    """Cells by level, number of finest cells along each axis, and fraction of volume dropped.

    The largest set connected by faces is kept. ValueError for too many cells, or none.
    """
    levels = grading.levels
    top = np.maximum(1, np.ceil((upper - lower) / grading.edge(levels - 1) - 1e-6).astype(int))
    finest = top * 2 ** (levels - 1)
    if np.prod(finest.astype(float)) > MAX_CELLS:
        raise ValueError(
            f"region.spacing: {1e3 * grading.spacing:.3g} mm divides the organ's box into "
            f"{np.prod(finest.astype(float)):.3g} cells, the limit is {MAX_CELLS:.0e}; enlarge it"
        )
    split = _balanced([_split(top, lower, grading, level) for level in range(1, levels)])
    there = [*map(_refined, split), np.ones(top, dtype=bool)]
    whole = (one & ~halved for one, halved in zip(there[1:], split, strict=True))
    masks = [there[0], *whole]
    within = [_within(body, lower, one, grading.edge(n)) for n, one in enumerate(masks)]
    found = _largest_piece([one.where(one.fill >= SMALLEST_FILL) for one in within], finest)
    if not any(len(one.fill) for one in found):
        raise ValueError(
            f"no cell of {grading.spacing:g} m and more lies in the organ; reduce region.spacing"
        )
    dropped = 1.0 - _volume(found, grading) / _volume(within, grading)
    return found, finest, dropped


def _volume(of: Sequence[Leaves], grading: Grading) -> float:
    """Volume [m^3] of the body in cells."""
    return sum(float(one.fill.sum()) * grading.edge(n) ** 3 for n, one in enumerate(of))


def _largest_piece(of: Sequence[Leaves], finest: Ints) -> list[Leaves]:
    """The largest set of cells connected by faces, found on the grid of the finest cells."""
    there = np.zeros(finest, dtype=bool)
    for level, one in enumerate(of):
        there |= _in_finest(one, level, finest)
    pieces, _ = label(there)
    own = [pieces[tuple((one.index * 2**level).T)] for level, one in enumerate(of)]
    sizes = sum(
        np.bincount(piece, weights=one.fill * 8.0**level, minlength=pieces.max() + 1)
        for level, (piece, one) in enumerate(zip(own, of, strict=True))
    )
    largest = int(np.argmax(sizes))
    return [one.where(piece == largest) for piece, one in zip(own, of, strict=True)]


def _in_finest(of: Leaves, level: int, finest: Ints) -> Bools:
    """Mask of the finest cells inside the cells of a level."""
    mask = np.zeros(finest // 2**level, dtype=bool)
    mask[tuple(of.index.T)] = True
    for _ in range(level):
        mask = _refined(mask)
    return mask


def _split(top: Ints, lower: Floats, grading: Grading, level: int) -> Bools:
    """Which cells of a level must be split: those within its reach of a place."""
    edge = grading.edge(level)
    shape = top * 2 ** (grading.levels - 1 - level)
    near = np.zeros(shape, dtype=bool)
    starts = [lower[d] + edge * np.arange(shape[d]) for d in range(3)]
    for place in grading.places:
        x, y, z = (
            np.maximum(np.maximum(one - place[d], place[d] - one - edge), 0.0) ** 2
            for d, one in enumerate(starts)
        )
        apart = x[:, None, None] + y[None, :, None] + z[None, None, :]
        near |= apart < grading.reach[level - 1] ** 2
    return near


def _balanced(split: list[Bools]) -> list[Bools]:
    """Masks of cells to split, from level 1 up, extended to keep the octree balanced.

    The parent of each split cell and of each of its neighbours is split too.
    """
    found = split[:1]
    for above in split[1:]:
        found.append(above | _coarsened(binary_dilation(found[-1], AROUND)))
    return found


def _coarsened(mask: Bools) -> Bools:
    """Mask of the next level: cells any of whose eight children is set."""
    x, y, z = np.array(mask.shape) // 2
    return np.asarray(mask.reshape(x, 2, y, 2, z, 2).any(axis=(1, 3, 5)))


def _refined(mask: Bools) -> Bools:
    """Mask of the level below: each cell's value for its eight children."""
    for axis in range(3):
        mask = np.repeat(mask, 2, axis=axis)
    return mask


def _within(body: SolidShape, lower: Floats, mask: Bools, edge: float) -> Leaves:
    """Cells of a mask that are not empty, sampled within the box of the mask only."""
    index = np.argwhere(mask)
    if len(index) == 0:
        return Leaves(index, np.zeros(0))
    first, last = index.min(axis=0), index.max(axis=0) + 1
    fill = fill_fractions(body, lower + edge * first, last - first, edge)
    found = Leaves(index, fill[tuple((index - first).T)])
    return found.where(found.fill > 0.0)
