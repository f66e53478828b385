"""What a verification problem is, and what it finds."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Finding:
    """One quantity beside its exact value.

    `exact` and `ours`: none where a whole field is compared. `error`: relative, of an order the
    difference. `order`: observed from the last two meshes or steps. `limit` of the error; none
    where a shortcoming is shown and nothing is judged.
    """

    quantity: str
    error: float
    limit: float | None = None
    exact: float | None = None
    ours: float | None = None
    order: float | None = None

    @property
    def passed(self) -> bool:
        """Whether the error is within its limit; one that is not a number is not."""
        return self.limit is None or self.error <= self.limit


@dataclass(frozen=True)
class Problem:
    """A problem, the source of its exact solution, and whether it is solved in about a second."""

    name: str
    source: str
    findings: Callable[[], Iterator[Finding]]
    quick: bool = True


def value(
    quantity: str, exact: float, ours: float, limit: float | None, order: float | None = None
) -> Finding:
    """A number beside its exact value, which is not zero."""
    return Finding(quantity, abs(ours / exact - 1.0), limit, exact, ours, order)


def observed_order(errors: list[float], ratio: float = 2.0) -> float:
    """Order from the last two errors, where the spacing or step shrinks by `ratio`."""
    return float(np.log(errors[-2] / errors[-1]) / np.log(ratio))


def convergence(
    quantity: str, errors: list[float], order: float, tolerance: float, limit: float
) -> Iterator[Finding]:
    """The error at the finest spacing, each half of the one before, and how the order came out."""
    found = observed_order(errors)
    yield Finding(quantity, errors[-1], limit, order=found)
    yield Finding(f"order of {quantity}", abs(found - order), tolerance, order, found)
