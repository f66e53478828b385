"""Hyperelastic bodies at rest: Newton's method along a path of growing load.

A state is handed out only if its forces balance, no element is turned inside out and the tangent is
positive definite; where that cannot be had, the path ends and says why.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fem_reference.direct import symmetric_factors
from fem_reference.driven import Drive, DrivenState, solve_driven
from fem_reference.elasticity import Body
from fem_reference.elements import ELEMENTS
from fem_reference.hyperelasticity import HyperelasticSolid, largest_log_strain, solid
from fem_reference.laws import DEFAULT, Law
from fem_reference.mixed_strain import on_nodes
from study.continuation import Increments, follow
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]

TOLERANCE = 1e-8
"""Of the unbalanced forces relative to the load, in the Euclidean norm."""

MOST_ITERATIONS = 15
INCREMENTS = Increments(easy=5, smallest=1 / 32, unit="the load")

SHORTEST_STEP = 1 / 64


@dataclass(frozen=True)
class State:
    """A stable rest under `load_factor` times the body's load.

    `displacement` [m]: unknowns of the body, (n,); `largest_strain`: largest absolute principal
    logarithmic strain, `smallest_volume`: smallest J, both at the integration points; `energy` [J]:
    stored in tissue and foundation; `residuals`: unbalanced force relative to the load, before each
    iteration of the last increment and after the last; `iterations`: of all increments since the
    state before.
    """

    load_factor: float
    displacement: Floats
    largest_strain: float
    smallest_volume: float
    energy: float
    residuals: tuple[float, ...]
    iterations: int


@dataclass(frozen=True)
class Path:
    """States at the load factors asked for, as far as they were reached.

    Under large loads a body may have several stable rests; these are the ones the path leads to.
    `reached`: load factor of the last stable rest found, which need not be one asked for; `failure`
    says why the path ends there, and is empty if it does not.
    """

    states: tuple[State, ...]
    reached: float
    failure: str

    @property
    def converged(self) -> bool:
        """Whether there is a state at every load factor asked for."""
        return not self.failure


class _Rest(NamedTuple):
    """Where Newton's method ended; a stable rest if `failure` is empty."""

    factor: float
    displacement: Floats
    residuals: tuple[float, ...]
    failure: str = ""


def solve(
    body: Body,
    tissue: Tissue,
    law: str | Law = DEFAULT,
    load_factors: Sequence[float] = (1.0,),
) -> Path:
    """States of rest under multiples of the body's load, reached from none in the order given.

    A body with a pressure of its own keeps it, in the neo-Hookean law (`fem_reference.driven`).
    ValueError for an unknown law, one that has no form with a pressure where the body has one, or
    a load factor of zero.
    """
    if not (np.isfinite(load_factors).all() and np.all(load_factors)):
        raise ValueError(f"load_factors: {tuple(load_factors)} must be finite and not zero")
    if ELEMENTS[body.element].mixed:
        return _with_pressure(body, tissue, law, load_factors)
    problem = solid(body, tissue, law)
    start = _Rest(0.0, np.zeros(len(body.load)), (0.0,))
    found = follow(start, load_factors, partial(_rest, problem), INCREMENTS)
    states = map(partial(_state, problem), found.rests, found.iterations)
    return Path(tuple(states), found.reached, found.failure)


def _with_pressure(
    body: Body, tissue: Tissue, law: str | Law, load_factors: Sequence[float]
) -> Path:
    """The same of elements with a pressure of their own."""
    if law != "neo-hookean":
        raise ValueError(
            f"law: of elements with a pressure of their own, {law!r} is not worked out; give "
            "neo-hookean, or discretise with element 'p2', good to a Poisson ratio of 0.48"
        )
    mixed = on_nodes(body.nodes, tissue, body.support, body.composition)
    held = np.full((body.node_count, 3), np.nan)
    if body.fixed is not None:
        held[body.fixed.reshape(-1, 3)] = 0.0
    found = solve_driven(mixed, Drive(held, body.whole_load), load_factors)
    return Path(tuple(map(_of_driven, found.states)), found.reached, found.failure)


def _of_driven(state: DrivenState) -> State:
    return State(
        state.factor,
        state.displacement.ravel(),
        state.largest_strain,
        state.smallest_volume,
        state.energy,
        state.residuals,
        state.iterations,
    )


def _state(problem: HyperelasticSolid, at: _Rest, iterations: int) -> State:
    u = at.displacement
    F = problem.deformation(u)
    return State(
        at.factor,
        u,
        largest_log_strain(F),
        float(np.linalg.det(F).min()),
        problem.energy(u),
        at.residuals,
        iterations,
    )


def _rest(problem: HyperelasticSolid, start: _Rest, factor: float) -> _Rest:
    """Newton's method at one load."""
    load, u = factor * problem.load, start.displacement
    residuals: list[float] = []
    failure = "no balance of forces"
    while len(residuals) <= MOST_ITERATIONS:
        unbalanced = load - problem.internal_force(u)
        residuals.append(float(np.linalg.norm(unbalanced) / np.linalg.norm(load)))
        factors = symmetric_factors(problem.tangent(u))
        if residuals[-1] <= TOLERANCE:
            # On the way an indefinite tangent is no harm; at rest the body would leave it.
            failure = "" if _definite(factors) else "the body gives way"
            break
        direction = _solution(factors, unbalanced)
        length = _step_length(problem, load, u, direction, float(unbalanced @ direction))
        if length == 0.0:
            failure = "no way towards balance"
            break
        u = u + length * direction
    return _Rest(factor, u, tuple(residuals), failure)


def _step_length(
    problem: HyperelasticSolid, load: Floats, u: Floats, direction: Floats, pull: float
) -> float:
    """Largest of 1, 1/2, 1/4, ... of Newton's step that the body can take; 0 if there is none.

    No element may turn inside out, and the unbalanced forces may not turn against the step by more
    than half of what they pulled before (`pull`). Energy would be lost in rounding near the rest.
    """
    length = 1.0 if pull > 0.0 else 0.0
    while length > 0.0:
        there = u + length * direction
        if np.linalg.det(problem.deformation(there)).min() > 0.0:
            pull_there = float((load - problem.internal_force(there)) @ direction)
            if pull_there >= -0.5 * pull:
                break
        length = 0.5 * length if length > SHORTEST_STEP else 0.0
    return length


def _solution(factors: Any, force: Floats) -> Floats:
    """Newton's step [m]; none where the tangent is singular."""
    return np.zeros_like(force) if factors is None else np.asarray(factors.solve(force))


def _definite(factors: Any) -> bool:
    """Whether the matrix is positive definite: all pivots on the diagonal and positive."""
    if factors is None:
        return False
    return bool((factors.perm_r == factors.perm_c).all() and (factors.U.diagonal() > 0.0).all())
