"""Bodies whose faces are moved: rest at large and at small strain, and the forces that hold it.

Newton's method on displacement and pressure together, along a path of growing prescribed
displacement and load. A state is handed out only if its forces balance, no element is turned inside
out, and it is stable: the tangent has as many negative eigenvalues as there are pressures, and so
is positive definite where the pressures are eliminated. Where that cannot be had, the path ends and
says why.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from fem_reference.direct import symmetric_factors
from fem_reference.hyperelasticity import largest_log_strain
from fem_reference.mixed_strain import MixedSolid
from study.continuation import Increments, follow

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

TOLERANCE = 1e-9
"""Of the unbalanced forces relative to the load and the forces that hold."""
MOST_ITERATIONS = 16
INCREMENTS = Increments(easy=5, smallest=1 / 64)
SHORTEST_STEP = 1 / 64
GROWTH = 2.0
"""By how much unbalanced forces may grow in a step: near 1/2, volumes are kept to second order."""


@dataclass(frozen=True)
class Drive:
    """What a body is subjected to: `prescribed` [m] (nodes, 3), nan where it is free; `load` [N].

    The load (n,) is dead. Both grow by the same factor.
    """

    prescribed: Floats
    load: Floats

    @property
    def free(self) -> Booleans:
        """Of the displacements, (n,)."""
        return np.isnan(self.prescribed.ravel())


@dataclass(frozen=True)
class DrivenState:
    """A stable rest at `factor` times what is asked for.

    `displacement` [m] and `reaction` [N] (nodes, 3): the latter is what holds the body where it is
    prescribed, and zero elsewhere; `pressure` [Pa] at the vertices; `largest_strain`: largest
    absolute principal logarithmic strain, `smallest_volume`: smallest J, both at the integration
    points; `energy` [J] stored; `residuals`: unbalanced force relative to load and reaction, before
    each iteration of the last increment and after the last; `iterations`: of all increments since
    the state before.
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


@dataclass(frozen=True)
class DrivenPath:
    """States at the factors asked for, as far as they were reached.

    `reached`: factor of the last rest found; `failure` says why the path ends there, empty if not.
    """

    states: tuple[DrivenState, ...]
    reached: float
    failure: str

    @property
    def converged(self) -> bool:
        """Whether there is a state at every factor asked for."""
        return not self.failure


class _Rest(NamedTuple):
    """Where Newton's method ended; a stable rest if `failure` is empty."""

    factor: float
    w: Floats
    residuals: tuple[float, ...]
    failure: str = ""


def solve_driven(body: MixedSolid, drive: Drive, factors: Sequence[float] = (1.0,)) -> DrivenPath:
    """States of rest under growing multiples of what is asked for, from none in the order given.

    ValueError for a factor that is zero, or prescribed values that do not fit the body.
    """
    _refuse(body, drive, factors)
    start = _Rest(0.0, np.zeros(body.size + body.pressures), ())
    found = follow(start, factors, partial(_rest, body, drive), INCREMENTS)
    states = map(partial(_state, body, drive), found.rests, found.iterations)
    return DrivenPath(tuple(states), found.reached, found.failure)


def solve_linear(body: MixedSolid, drive: Drive) -> DrivenState:
    """The rest of linear elasticity under what is asked for, by the same elements.

    ValueError if nothing holds the body.
    """
    _refuse(body, drive, (1.0,))
    matrix, w = body.linear(), np.zeros(body.size + body.pressures)
    free = _free(body, drive)
    w[: body.size] = np.where(drive.free, 0.0, drive.prescribed.ravel())
    forces = _load(body, drive, 1.0)
    factors = symmetric_factors(matrix[free][:, free])
    if factors is None:
        raise ValueError("the stiffness is singular: nothing holds the body")
    w[free] = factors.solve((forces - matrix @ w)[free])
    reaction = np.where(drive.free, 0.0, (matrix @ w - forces)[: body.size])
    F = body.deformation(w)
    strain = 0.5 * (F + np.swapaxes(F, -2, -1)) - np.eye(3)
    return DrivenState(
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


def _refuse(body: MixedSolid, drive: Drive, factors: Sequence[float]) -> None:
    if not (np.isfinite(factors).all() and np.all(factors)):
        raise ValueError(f"factors: {tuple(factors)} must be finite and not zero")
    if drive.prescribed.shape != body.points.shape or drive.load.shape != (body.size,):
        raise ValueError(
            f"prescribed {drive.prescribed.shape} and load {drive.load.shape} do not fit "
            f"{len(body.points)} nodes"
        )


def _free(body: MixedSolid, drive: Drive) -> Booleans:
    """Of all unknowns, pressures included."""
    return np.concatenate([drive.free, np.ones(body.pressures, dtype=np.bool_)])


def _load(body: MixedSolid, drive: Drive, factor: float) -> Floats:
    return np.concatenate([factor * drive.load, np.zeros(body.pressures)])


def _state(body: MixedSolid, drive: Drive, at: _Rest, iterations: int) -> DrivenState:
    F = body.deformation(at.w)
    held = body.gradient(at.w)[: body.size] - at.factor * drive.load
    return DrivenState(
        at.factor,
        at.w[: body.size].reshape(-1, 3),
        at.w[body.size :],
        np.where(drive.free, 0.0, held).reshape(-1, 3),
        largest_log_strain(F),
        float(np.linalg.det(F).min()),
        body.energy(at.w),
        at.residuals,
        iterations,
    )


def _rest(body: MixedSolid, drive: Drive, start: _Rest, factor: float) -> _Rest:
    """Newton's method at one factor. The first step brings the prescribed displacements along."""
    free, held, w = _free(body, drive), np.flatnonzero(~drive.free), start.w
    goal, load = factor * drive.prescribed.ravel()[held], _load(body, drive, factor)
    residuals: list[float] = []
    failure = "no balance of forces"
    while len(residuals) <= MOST_ITERATIONS:
        lacking, behind = load - body.gradient(w), np.zeros_like(w)
        behind[held] = goal - w[held]
        residuals.append(_unbalanced(body, lacking, free) / _scale(body, lacking, factor, drive))
        matrix = body.tangent(w)
        factors = symmetric_factors(matrix[free][:, free])
        if residuals[-1] <= TOLERANCE and not behind.any():
            # On the way an indefinite tangent is no harm; at rest the body would leave it.
            failure = "" if _is_stable(factors, body.pressures) else "the body gives way"
            break
        direction = _direction(factors, matrix, lacking, behind, free)
        length = _step_length(body, load, free, w, direction, moving=bool(behind.any()))
        if length == 0.0:
            failure = "no way towards balance"
            break
        w = w + length * direction
        if length == 1.0:  # rounding must not leave a face short of its place
            w[held] = goal
    return _Rest(factor, w, tuple(residuals), failure)


def _direction(
    factors: Any, matrix: csc_array, lacking: Floats, behind: Floats, free: Booleans
) -> Floats:
    """Newton's step with what the faces are `behind`; none where the tangent is singular."""
    if factors is None:
        return np.zeros_like(behind)
    direction = behind.copy()
    direction[free] = factors.solve((lacking - matrix @ behind)[free])
    return direction


def _unbalanced(body: MixedSolid, lacking: Floats, free: Booleans) -> float:
    """Size [N] of unbalanced forces and, by modulus and size of the body, of volumes missed."""
    unit = np.where(np.arange(len(lacking)) < body.size, 1.0, body.typical_shear / body.length)
    return float(np.linalg.norm((unit * lacking)[free]))


def _scale(body: MixedSolid, lacking: Floats, factor: float, drive: Drive) -> float:
    """Size [N] of the load and of the forces that hold."""
    held = float(np.linalg.norm(lacking[: body.size][~drive.free]))
    return max(abs(factor) * float(np.linalg.norm(drive.load)), held, 1e-300)


def _step_length(
    body: MixedSolid, load: Floats, free: Booleans, w: Floats, direction: Floats, *, moving: bool
) -> float:
    """Largest of 1, 1/2, 1/4, ... of Newton's step that the body can take; 0 if there is none.

    No element may turn inside out, and unbalanced forces may not grow by more than GROWTH, but for
    the step that moves the faces.
    """
    start = _unbalanced(body, load - body.gradient(w), free)
    length = 1.0 if direction.any() else 0.0
    while length > 0.0:
        there = w + length * direction
        if np.linalg.det(body.deformation(there)).min() > 0.0:
            left = _unbalanced(body, load - body.gradient(there), free)
            if moving or left <= GROWTH * start:
                break
        length = 0.5 * length if length > SHORTEST_STEP else 0.0
    return length


def _is_stable(factors: Any, pressures: int) -> bool:
    """Whether all pivots lie on the diagonal and as many are negative as there are pressures."""
    if factors is None or not (factors.perm_r == factors.perm_c).all():
        return False
    return int((factors.U.diagonal() < 0.0).sum()) == pressures
