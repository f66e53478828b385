"""Equilibria along a path of increasing load, by increments that adapt to the iterations needed."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Generic, NamedTuple, Protocol, TypeVar


class Rest(Protocol):
    """The result of a search for an equilibrium."""

    @property
    def factor(self) -> float:
        """Load factor, relative to the full load."""

    @property
    def residuals(self) -> tuple[float, ...]:
        """Residuals before each iteration and after the last."""

    @property
    def failure(self) -> str:
        """Why it is no equilibrium; empty if it is one."""


R = TypeVar("R", bound=Rest)


class Increments(NamedTuple):
    """How a load path is divided.

    `easy`: number of iterations up to which the next increment is doubled; `smallest`: share of the
    target below which a failed increment is not halved again; `unit`: name of the loaded quantity.
    """

    easy: int
    smallest: float
    unit: str = "what is asked for"


@dataclass(frozen=True)
class Followed(Generic[R]):
    """Equilibria at the requested load factors, as far as they were reached.

    `iterations`: spent on each since the one before; `reached`: factor of the last equilibrium
    found, which need not be a requested one; `failure`: why the path ends there, empty if it is
    complete.
    """

    rests: tuple[R, ...]
    iterations: tuple[int, ...]
    reached: float
    failure: str = ""


def follow(
    start: R, factors: Iterable[float], rest: Callable[[R, float], R], by: Increments
) -> Followed[R]:
    """Equilibria at the factors in the given order; `rest` searches for one from another."""
    at, rests, spent = start, list[R](), list[int]()
    for factor in factors:
        at, iterations, failure = _move_up(at, factor, rest, by)
        if failure:
            return Followed(tuple(rests), tuple(spent), at.factor, failure)
        rests.append(at)
        spent.append(iterations)
    return Followed(tuple(rests), tuple(spent), at.factor)


def _move_up(
    start: R, target: float, rest: Callable[[R, float], R], by: Increments
) -> tuple[R, int, str]:
    """The equilibrium at a target or the last one before it, the iterations, and the failure.

    First the whole increment is tried; an increment without an equilibrium is halved.
    """
    at, increment, iterations = start, target - start.factor, 0
    while at.factor != target:
        left = target - at.factor
        goal = target if abs(increment) >= abs(left) else at.factor + increment
        found = rest(at, goal)
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
