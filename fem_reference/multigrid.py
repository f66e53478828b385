"""Algebraic multigrid V-cycle for linear elements, used as a preconditioner.

pyamg builds the levels by smoothed aggregation with the six rigid motions as near-null space. The
cycle, from a zero start, has one forward Gauss-Seidel sweep before and one backward sweep after the
coarse correction, which makes it symmetric and positive definite. Its matrices are in single
precision.
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
    """Gauss-Seidel sweeps of a matrix [N/m], its upper triangle, and transfers to a coarser level.

    `forward` uses the lower triangle only, since the upper one multiplies zeros.
    """

    forward: Sweep
    above: Blocks
    backward: Sweep
    restrict: Blocks
    prolong: Blocks

    def from_zero(self, right: Floats) -> Floats:
        """Result of a forward sweep from zero."""
        return self._swept(self.forward, right, np.zeros_like(right))

    def residual_after(self, found: Floats) -> Floats:
        """Residual after `from_zero`: minus the upper triangle times the result."""
        return -(self.above @ found)

    def sweep_back(self, right: Floats, found: Floats) -> Floats:
        """Result of a backward sweep."""
        return self._swept(self.backward, right, found)

    def _swept(self, part: Sweep, right: Floats, found: Floats) -> Floats:
        part(right, found)
        return found


def multigrid(matrix: bsr_array, points: Floats) -> Solve:
    """V-cycle for a matrix [N/m] in blocks of nodes at points [m] (n, 3)."""
    from pyamg import smoothed_aggregation_solver

    with _seeded():
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
    found = level.from_zero(right)
    coarser = _cycle(levels[1:], coarsest, level.restrict @ level.residual_after(found))
    level.prolong.add_product(coarser, found)
    return level.sweep_back(right, found)


def rigid_motions(points: Floats) -> Floats:
    """Three translations and three rotations (3 n, 6) of points (n, 3), about their centre."""
    x = points - points.mean(axis=0)
    motions = np.zeros((len(points), 3, 6))
    motions[:, :, :3] = np.eye(3)
    for k in range(3):
        motions[:, :, 3 + k] = np.cross(np.eye(3)[k], x)
    return motions.reshape(-1, 6)


@contextmanager
def _seeded() -> Iterator[None]:
    """Seed the random start of pyamg's eigenvalue estimates, for reproducible solutions.

    pyamg uses numpy's global generator, whose state is restored.
    """
    before = np.random.get_state()  # noqa: NPY002 - the one that pyamg draws from
    np.random.seed(0)  # noqa: NPY002 - as above
    try:
        yield
    finally:
        np.random.set_state(before)  # noqa: NPY002 - as above
