"""Static equilibrium of mixed elements under displacement control, at large and small strain.

Newton's method on displacement and pressure along a path of growing prescribed displacement and
load. A state is returned only if it is in equilibrium, no element is inverted, and it is stable:
the tangent has as many negative eigenvalues as there are pressures, so that it is positive definite
after condensation of the pressures. Otherwise the path ends with the reason.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from fem_reference.hyperelasticity import largest_log_strain
from fem_reference.mixed_strain import MixedSolid
from study.numerics.continuation import (
    NO_EQUILIBRIUM,
    NO_STEP,
    UNSTABLE,
    EquilibriumPath,
    Increments,
    follow,
    slow_iterations,
)
from study.numerics.factors import has_inertia, symmetric_factors

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

TOLERANCE = 1e-9
"""Norm of the residual relative to that of the load and the reactions."""
MOST_ITERATIONS = 16
"""Limit on iterations that leave more than a tenth of the residual."""
INCREMENTS = Increments(easy=5, smallest=1 / 64)
SHORTEST_STEP = 1 / 64
GROWTH = 2.0
"""Largest growth of the residual in a step: for nu near 1/2, Newton steps change the volume to
second order, which the bulk modulus turns into large forces."""


@dataclass(frozen=True)
class Loading:
    """Displacements `prescribed` [m] (nodes, 3), NaN where free, and the dead `load` [N] (n,).

    Both grow by the same factor.
    """

    prescribed: Floats
    load: Floats

    @property
    def free(self) -> Booleans:
        """Which displacements (n,) are free."""
        return np.isnan(self.prescribed.ravel())


@dataclass(frozen=True)
class EquilibriumState:
    """A stable equilibrium at `factor` times the loading.

    `displacement` [m] and `reaction` [N] (nodes, 3), the latter zero where the body is free;
    `pressure` [Pa] at the vertices; `largest_strain`: largest absolute principal logarithmic
    strain, `smallest_volume`: smallest J, both at the integration points; `energy` [J]: strain
    energy; `residuals`: residual relative to load and reaction, before each iteration of the last
    increment and after the last; `iterations`: of all increments since the previous state.
    """

    factor: float
    displacement: Floats
    pressure: Floats
    reaction: Floats
    largest_strain: float
    smallest_volume: float
    energy: float
    residuals: tuple[float, ...]
    iterations: int


class _Iterate(NamedTuple):
    """Last iterate of Newton's method; a stable equilibrium if `failure` is empty."""

    factor: float
    w: Floats
    residuals: tuple[float, ...]
    failure: str = ""


def equilibrium_path(
    body: MixedSolid, loading: Loading, load_factors: Sequence[float] = (1.0,)
) -> EquilibriumPath[EquilibriumState]:
    """Equilibria at multiples of the loading, in the order of `load_factors`.

    The path starts from the unloaded body. ValueError for a factor of zero, or prescribed values
    that do not fit the body.
    """
    _refuse_misfit(body, loading)
    start = _Iterate(0.0, np.zeros(body.size + body.pressures), ())
    search, state = partial(_newton, body, loading), partial(_state, body, loading)
    return follow(start, load_factors, search, state, INCREMENTS)


def solve_linear(body: MixedSolid, loading: Loading) -> EquilibriumState:
    """Static solution of linear elasticity under the loading, with the same elements.

    ValueError if the stiffness is singular.
    """
    _refuse_misfit(body, loading)
    matrix, w = body.linear(), np.zeros(body.size + body.pressures)
    free = _free(body, loading)
    w[: body.size] = np.where(loading.free, 0.0, loading.prescribed.ravel())
    forces = _load(body, loading, 1.0)
    factors = symmetric_factors(matrix[free][:, free])
    if factors is None:
        raise ValueError("the stiffness is singular: nothing holds the body")
    w[free] = factors.solve((forces - matrix @ w)[free])
    reaction = np.where(loading.free, 0.0, (matrix @ w - forces)[: body.size])
    F = body.deformation(w)
    strain = 0.5 * (F + np.swapaxes(F, -2, -1)) - np.eye(3)
    return EquilibriumState(
        1.0,
        w[: body.size].reshape(-1, 3),
        w[body.size :],
        reaction.reshape(-1, 3),
        float(np.abs(np.linalg.eigvalsh(strain)).max()),
        float(1.0 + np.trace(strain, axis1=-2, axis2=-1).min()),
        0.5 * float(w[: body.size] @ (matrix @ w)[: body.size]),
        (),
        1,
    )


def _refuse_misfit(body: MixedSolid, loading: Loading) -> None:
    if loading.prescribed.shape != body.points.shape or loading.load.shape != (body.size,):
        raise ValueError(
            f"prescribed {loading.prescribed.shape} and load {loading.load.shape} do not fit "
            f"{len(body.points)} nodes"
        )


def _free(body: MixedSolid, loading: Loading) -> Booleans:
    """Which unknowns (n + pressures,) are free; all pressures are."""
    return np.concatenate([loading.free, np.ones(body.pressures, dtype=np.bool_)])


def _load(body: MixedSolid, loading: Loading, factor: float) -> Floats:
    return np.concatenate([factor * loading.load, np.zeros(body.pressures)])


def _state(body: MixedSolid, loading: Loading, at: _Iterate, iterations: int) -> EquilibriumState:
    F = body.deformation(at.w)
    reaction = body.gradient(at.w)[: body.size] - at.factor * loading.load
    return EquilibriumState(
        at.factor,
        at.w[: body.size].reshape(-1, 3),
        at.w[body.size :],
        np.where(loading.free, 0.0, reaction).reshape(-1, 3),
        largest_log_strain(F),
        float(np.linalg.det(F).min()),
        body.energy(at.w),
        at.residuals,
        iterations,
    )


def _newton(body: MixedSolid, loading: Loading, start: _Iterate, factor: float) -> _Iterate:
    """Newton's method at one factor; its first step takes up the prescribed displacements."""
    free, constrained, w = _free(body, loading), np.flatnonzero(~loading.free), start.w
    target, load = factor * loading.prescribed.ravel()[constrained], _load(body, loading, factor)
    residuals: list[float] = []
    failure = NO_EQUILIBRIUM
    while slow_iterations(residuals) < MOST_ITERATIONS:
        residual, increment = load - body.gradient(w), np.zeros_like(w)
        increment[constrained] = target - w[constrained]
        scale = _scale(body, residual, factor, loading)
        residuals.append(_residual_norm(body, residual, free) / scale)
        matrix = body.tangent(w)
        factors = symmetric_factors(matrix[free][:, free])
        if residuals[-1] <= TOLERANCE and not increment.any():
            # An indefinite tangent during the iterations does no harm; at equilibrium it is a
            # loss of stability.
            failure = "" if has_inertia(factors, body.pressures) else UNSTABLE
            break
        step = _newton_step(factors, matrix, residual, increment, free)
        length = _step_length(body, load, free, w, step, prescribing=bool(increment.any()))
        if length == 0.0:
            failure = NO_STEP
            break
        w = w + length * step
        if length == 1.0:  # removes the rounding of the sum
            w[constrained] = target
    return _Iterate(factor, w, tuple(residuals), failure)


def _newton_step(
    factors: Any, matrix: csc_array, residual: Floats, increment: Floats, free: Booleans
) -> Floats:
    """Newton step with an increment of prescribed displacement; zero for a singular tangent."""
    if factors is None:
        return np.zeros_like(increment)
    step = increment.copy()
    step[free] = factors.solve((residual - matrix @ increment)[free])
    return step


def _residual_norm(body: MixedSolid, residual: Floats, free: Booleans) -> float:
    """Norm [N] of the residual; volumes are scaled by the modulus and size of the body."""
    unit = np.where(np.arange(len(residual)) < body.size, 1.0, body.typical_shear / body.length)
    return float(np.linalg.norm((unit * residual)[free]))


def _scale(body: MixedSolid, residual: Floats, factor: float, loading: Loading) -> float:
    """The larger of the norms [N] of load and reactions."""
    reaction = float(np.linalg.norm(residual[: body.size][~loading.free]))
    return max(abs(factor) * float(np.linalg.norm(loading.load)), reaction, 1e-300)


def _step_length(
    body: MixedSolid, load: Floats, free: Booleans, w: Floats, step: Floats, *, prescribing: bool
) -> float:
    """Largest admissible fraction 1, 1/2, 1/4, ... of a Newton step; 0 without one.

    No element may invert, and the residual may grow by GROWTH at most, except in a step that
    changes prescribed displacements (`prescribing`).
    """
    start = _residual_norm(body, load - body.gradient(w), free)
    length = 1.0 if step.any() else 0.0
    while length > 0.0:
        trial = w + length * step
        if np.linalg.det(body.deformation(trial)).min() > 0.0:
            norm = _residual_norm(body, load - body.gradient(trial), free)
            if prescribing or norm <= GROWTH * start:
                break
        length = 0.5 * length if length > SHORTEST_STEP else 0.0
    return length
