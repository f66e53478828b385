"""Equilibria along a path of increasing load, by increments that adapt to the iterations needed."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Generic, NamedTuple, Protocol, TypeVar

NO_EQUILIBRIUM = "no equilibrium found"
NO_STEP = "Newton's method found no admissible step"
UNSTABLE = "the equilibrium is unstable"
"""Why a search for an equilibrium failed, in the words of every solver."""


class Iterate(Protocol):
    """The last iterate of a search for an equilibrium."""

    @property
    def factor(self) -> float:
        """Load factor, relative to the full load."""

    @property
    def residuals(self) -> tuple[float, ...]:
        """Residuals before each iteration and after the last."""

    @property
    def failure(self) -> str:
        """Why it is no equilibrium; empty if it is one."""


FAST = 0.1
"""An iteration that leaves no more than this share of the residual does not count to a limit."""

T = TypeVar("T", bound=Iterate)
S = TypeVar("S")


class Increments(NamedTuple):
    """How a load path is divided.

    `easy`: number of iterations up to which the next increment is doubled; `smallest`: share of the
    target below which a failed increment is not halved again; `unit`: name of the loaded quantity.
    """

    easy: int
    smallest: float
    unit: str = "the prescribed loading"


@dataclass(frozen=True)
class EquilibriumPath(Generic[S]):
    """Equilibria at the requested load factors, up to the last one found.

    `reached`: factor of the last equilibrium found, which need not be a requested one; `failure`:
    why the path ends there, empty if it is complete.
    """

    states: tuple[S, ...]
    reached: float
    failure: str

    @property
    def converged(self) -> bool:
        """Whether there is a state at every requested load factor."""
        return not self.failure


def slow_iterations(residuals: Sequence[float]) -> int:
    """Number of iterations that left more than FAST of the residual.

    A limit on them ends a search that makes no progress, but none that is converging.
    """
    return sum(after > FAST * before for before, after in pairwise(residuals))


def follow(
    start: T,
    load_factors: Sequence[float],
    search: Callable[[T, float], T],
    state: Callable[[T, int], S],
    by: Increments,
) -> EquilibriumPath[S]:
    """Equilibria at the load factors in the given order.

    `search` finds one from another; `state` makes a state of the path from an equilibrium and the
    iterations spent since the one before. ValueError for a factor that is zero or not finite.
    """
    if not all(math.isfinite(one) and one for one in load_factors):
        raise ValueError(f"load_factors: {tuple(load_factors)} must be finite and not zero")
    at, states = start, list[S]()
    for factor in load_factors:
        at, iterations, failure = _move_up(at, factor, search, by)
        if failure:
            return EquilibriumPath(tuple(states), at.factor, failure)
        states.append(state(at, iterations))
    return EquilibriumPath(tuple(states), at.factor, "")


def _move_up(
    start: T, target: float, search: Callable[[T, float], T], by: Increments
) -> tuple[T, int, str]:
    """The equilibrium at a target or the last one before it, the iterations, and the failure.

    First the whole increment is tried; an increment without an equilibrium is halved.
    """
    at, increment, iterations = start, target - start.factor, 0
    while at.factor != target:
        left = target - at.factor
        goal = target if abs(increment) >= abs(left) else at.factor + increment
        found = search(at, goal)
        spent = len(found.residuals) - 1
        iterations += spent
        if not found.failure:
            at = found
            increment *= 2.0 if spent <= by.easy else 1.0
            continue
        increment = 0.5 * (goal - at.factor)
        if abs(increment) < by.smallest * abs(target):
            return at, iterations, f"{found.failure} at {goal:.4g} times {by.unit}"
    return at, iterations, ""
