"""A cycle of algebraic multigrid for linear elements.

pyamg builds the levels, by smoothed aggregation with the six rigid motions as near-null space; the
cycle is one of our own: from rest, a sweep forward before and one backward after what is coarser.
It is a symmetric, positive operator. Its matrices are in single precision, as it only guides.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.sparse import bsr_array, bsr_matrix

from fem_reference.blocks import Blocks, Floats, Sweep, blocks_of, diagonal_of, sweep
from fem_reference.direct import Solve


@dataclass(frozen=True)
class Level:
    """Sweeps through a matrix [N/m], what is above its diagonal, and the way to a coarser level.

    `forward` goes by what is below the diagonal alone, as what is above meets zeros.
    """

    forward: Sweep
    above: Blocks
    backward: Sweep
    restrict: Blocks
    prolong: Blocks

    def from_rest(self, right: Floats) -> Floats:
        """What a sweep forward makes of zero."""
        return self._swept(self.forward, right, np.zeros_like(right))

    def left_after(self, found: Floats) -> Floats:
        """The residual of such a sweep: what is below and on the diagonal is met."""
        return -(self.above @ found)

    def back(self, right: Floats, found: Floats) -> Floats:
        """After a sweep backward."""
        return self._swept(self.backward, right, found)

    def _swept(self, part: Sweep, right: Floats, found: Floats) -> Floats:
        part(right, found)
        return found


def multigrid(matrix: bsr_array, points: Floats) -> Solve:
    """A cycle for a matrix [N/m] by blocks of nodes at points [m] (n, 3)."""
    from pyamg import smoothed_aggregation_solver

    with _drawing_alike():
        built = smoothed_aggregation_solver(
            bsr_matrix(matrix),
            B=rigid_motions(points),
            strength=("symmetric", {"theta": 0.0}),
            smooth="jacobi",
        ).levels
    levels = [_level(one) for one in built[:-1]]
    coarsest = np.linalg.pinv(built[-1].A.toarray())
    return lambda right: _cycle(levels, coarsest, right)


def _level(built: Any) -> Level:
    matrix = blocks_of(built.A, np.float32)
    diagonal = diagonal_of(matrix)
    inverses = np.linalg.inv(built.A.data[diagonal])
    return Level(
        sweep(replace(matrix, last=diagonal), inverses),
        replace(matrix, first=diagonal + 1),
        sweep(matrix, inverses, backward=True),
        blocks_of(built.R, np.float32),
        blocks_of(built.P, np.float32),
    )


def _cycle(levels: Sequence[Level], coarsest: Floats, right: Floats) -> Floats:
    if not levels:
        return np.asarray(coarsest @ right)
    level = levels[0]
    found = level.from_rest(right)
    coarser = _cycle(levels[1:], coarsest, level.restrict @ level.left_after(found))
    level.prolong.add_product(coarser, found)
    return level.back(right, found)


def rigid_motions(points: Floats) -> Floats:
    """Three translations and three rotations (3 n, 6) of points (n, 3), about their centre."""
    x = points - points.mean(axis=0)
    motions = np.zeros((len(points), 3, 6))
    motions[:, :, :3] = np.eye(3)
    for k in range(3):
        motions[:, :, 3 + k] = np.cross(np.eye(3)[k], x)
    return motions.reshape(-1, 6)


@contextmanager
def _drawing_alike() -> Iterator[None]:
    """Let pyamg begin its estimates of eigenvalues alike, so that a solution is the same each time.

    It draws from numpy's global generator, which is left as it was.
    """
    before = np.random.get_state()  # noqa: NPY002 - the one that pyamg draws from
    np.random.seed(0)  # noqa: NPY002 - as above
    try:
        yield
    finally:
        np.random.set_state(before)  # noqa: NPY002 - as above
