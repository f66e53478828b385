"""Static equilibrium of hyperelastic bodies by Newton's method along a path of growing load.

A state is returned only if it is in equilibrium, no element is inverted and the tangent is positive
definite. Otherwise the path ends with the reason.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fem_reference.displacement_control import EquilibriumState, Loading, equilibrium_path
from fem_reference.elasticity import Body
from fem_reference.elements import ELEMENTS
from fem_reference.hyperelasticity import HyperelasticSolid, largest_log_strain, solid
from fem_reference.laws import DEFAULT, Law
from fem_reference.mixed_strain import on_nodes
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
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]

TOLERANCE = 1e-8
"""Euclidean norm of the residual relative to that of the load."""

MOST_ITERATIONS = 15
"""Limit on iterations that leave more than a tenth of the residual."""
INCREMENTS = Increments(easy=5, smallest=1 / 32, unit="the load")

SHORTEST_STEP = 1 / 64


@dataclass(frozen=True)
class State:
    """A stable equilibrium under `load_factor` times the body's load.

    `displacement` [m] (n,): unknowns of the body; `largest_strain`: largest absolute principal
    logarithmic strain, `smallest_volume`: smallest J, both at the integration points; `energy` [J]:
    strain energy of tissue and foundation; `residuals`: residual relative to the load, before each
    iteration of the last increment and after the last; `iterations`: of all increments since the
    previous state.
    """

    load_factor: float
    displacement: Floats
    largest_strain: float
    smallest_volume: float
    energy: float
    residuals: tuple[float, ...]
    iterations: int


class _Iterate(NamedTuple):
    """Last iterate of Newton's method; a stable equilibrium if `failure` is empty."""

    factor: float
    displacement: Floats
    residuals: tuple[float, ...]
    failure: str = ""


def solve(
    body: Body,
    tissue: Tissue,
    law: str | Law = DEFAULT,
    load_factors: Sequence[float] = (1.0,),
) -> EquilibriumPath[State]:
    """Equilibria under multiples of the body's load, in the order of `load_factors`.

    Under large loads a body may have several stable equilibria; these are the ones on the path from
    the unloaded body. Mixed elements are solved for displacement and pressure
    by `fem_reference.displacement_control`, in the neo-Hookean law. ValueError for an unknown law,
    a law without a mixed form where the elements are mixed, or a load factor of zero.
    """
    if ELEMENTS[body.element].mixed:
        return _mixed_path(body, tissue, law, load_factors)
    problem = solid(body, tissue, law)
    start = _Iterate(0.0, np.zeros(len(body.load)), (0.0,))
    search, state = partial(_newton, problem), partial(_state, problem)
    return follow(start, load_factors, search, state, INCREMENTS)


def _mixed_path(
    body: Body, tissue: Tissue, law: str | Law, load_factors: Sequence[float]
) -> EquilibriumPath[State]:
    """The equilibrium path of mixed elements."""
    if law != "neo-hookean":
        raise ValueError(
            f"law: of elements with a pressure of their own, {law!r} is not worked out; give "
            "neo-hookean, or discretise with element 'p2', good to a Poisson ratio of 0.48"
        )
    mixed = on_nodes(body.nodes, tissue, body.support, body.composition)
    prescribed = np.full((body.node_count, 3), np.nan)
    if body.fixed is not None:
        prescribed[body.fixed.reshape(-1, 3)] = 0.0
    found = equilibrium_path(mixed, Loading(prescribed, body.whole_load), load_factors)
    return EquilibriumPath(tuple(map(_as_state, found.states)), found.reached, found.failure)


def _as_state(state: EquilibriumState) -> State:
    return State(
        state.factor,
        state.displacement.ravel(),
        state.largest_strain,
        state.smallest_volume,
        state.energy,
        state.residuals,
        state.iterations,
    )


def _state(problem: HyperelasticSolid, at: _Iterate, iterations: int) -> State:
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


def _newton(problem: HyperelasticSolid, start: _Iterate, factor: float) -> _Iterate:
    """Newton's method at one load."""
    load, u = factor * problem.load, start.displacement
    residuals: list[float] = []
    failure = NO_EQUILIBRIUM
    while slow_iterations(residuals) < MOST_ITERATIONS:
        residual = load - problem.internal_force(u)
        residuals.append(float(np.linalg.norm(residual) / np.linalg.norm(load)))
        factors = symmetric_factors(problem.tangent(u))
        if residuals[-1] <= TOLERANCE:
            # An indefinite tangent during the iterations does no harm; at equilibrium it is a
            # loss of stability.
            failure = "" if has_inertia(factors) else UNSTABLE
            break
        step = _newton_step(factors, residual)
        length = _step_length(problem, load, u, step, float(residual @ step))
        if length == 0.0:
            failure = NO_STEP
            break
        u = u + length * step
    return _Iterate(factor, u, tuple(residuals), failure)


def _step_length(
    problem: HyperelasticSolid, load: Floats, u: Floats, step: Floats, slope: float
) -> float:
    """Largest admissible fraction 1, 1/2, 1/4, ... of a Newton step; 0 without one.

    No element may invert. The work of the residual along the step, `slope` at its start, may change
    sign but not exceed half of it in magnitude. A test of the energy itself would be lost in
    rounding near the equilibrium.
    """
    length = 1.0 if slope > 0.0 else 0.0
    while length > 0.0:
        trial = u + length * step
        if np.linalg.det(problem.deformation(trial)).min() > 0.0:
            trial_slope = float((load - problem.internal_force(trial)) @ step)
            if trial_slope >= -0.5 * slope:
                break
        length = 0.5 * length if length > SHORTEST_STEP else 0.0
    return length


def _newton_step(factors: Any, residual: Floats) -> Floats:
    """Newton step [m]; zero for a singular tangent."""
    return np.zeros_like(residual) if factors is None else np.asarray(factors.solve(residual))
