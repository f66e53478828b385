"""Rests along a path of growing load, by increments that follow how easily each is found."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Generic, NamedTuple, Protocol, TypeVar


class Rest(Protocol):
    """Where a search for a rest ended."""

    @property
    def factor(self) -> float:
        """Multiple of what is asked for."""

    @property
    def residuals(self) -> tuple[float, ...]:
        """Before each iteration and after the last."""

    @property
    def failure(self) -> str:
        """Why it is none; empty if it is one."""


R = TypeVar("R", bound=Rest)


class Increments(NamedTuple):
    """How a path is divided.

    `easy`: after as few iterations the next increment is twice as large; `smallest`: share of the
    target below which an increment that fails is not halved again; `unit`: what a factor
    multiplies, in words.
    """

    easy: int
    smallest: float
    unit: str = "what is asked for"


@dataclass(frozen=True)
class Followed(Generic[R]):
    """Rests at the factors asked for, as far as they were reached.

    `iterations`: spent on each since the one before; `reached`: factor of the last rest found,
    which need not be one asked for; `failure` says why the path ends there, empty if it does not.
    """

    rests: tuple[R, ...]
    iterations: tuple[int, ...]
    reached: float
    failure: str = ""


def follow(
    start: R, factors: Iterable[float], rest: Callable[[R, float], R], by: Increments
) -> Followed[R]:
    """Rests at the factors in the order given; `rest` looks for one, starting from another."""
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
    """The rest at a target, or the last before it, the iterations spent, and why it ended there.

    First the whole way is tried; an increment at which no rest is found is halved.
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
