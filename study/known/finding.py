"""The finding of a case: how it ended, and a figure beside the one known beforehand."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Ending = Literal["value", "bounded", "diverged", "refused", "error"]


@dataclass(frozen=True)
class Finding:
    """How a case ended, with the predicted and the measured number.

    `ending`: a `value` was computed, a motion stayed `bounded` or `diverged`, bad input was
    `refused`; an `error` is none of these. `difference` of the two numbers, which are None where a
    whole field is compared: relative, or as the function that made the finding states. A case with
    several findings gives each a `quantity`, and the `limit` of its difference, None where a
    shortcoming is shown without a criterion. `order`: observed from the last two meshes or steps.
    """

    ending: Ending
    predicted: float | None = None
    measured: float | None = None
    difference: float | None = None
    message: str = ""
    quantity: str = ""
    limit: float | None = None
    order: float | None = None


def value(
    predicted: float, measured: float, message: str = "", ending: Ending = "value"
) -> Finding:
    """A number beside its exact value; the difference is relative, or absolute where that is 0."""
    size = abs(predicted) if predicted else 1.0
    return Finding(ending, predicted, measured, abs(measured - predicted) / size, message)


def beside(
    expected: NDArray[np.float64], found: NDArray[np.float64], ending: Ending = "value"
) -> Finding:
    """A field beside the exact one: their norms, and the norm of their difference over it."""
    size = float(np.linalg.norm(expected))
    apart = float(np.linalg.norm(found - expected) / size)
    return Finding(ending, size, float(np.linalg.norm(found)), apart, "norm of all values")


def at_most(
    bound: float, measured: float, message: str = "", ending: Ending = "bounded"
) -> Finding:
    """A number beside a positive bound; the difference is by how much it exceeds the bound."""
    excess = max(0.0, measured / bound - 1.0) if math.isfinite(measured) else math.inf
    return Finding(ending, bound, measured, excess, message)


def error_of(
    quantity: str, error: float, limit: float | None = None, order: float | None = None
) -> Finding:
    """The error of a quantity that is not a single number, such as a field, and its limit."""
    return Finding("value", difference=error, quantity=quantity, limit=limit, order=order)


def number_of(
    quantity: str, exact: float, ours: float, limit: float, order: float | None = None
) -> Finding:
    """A quantity beside its exact, nonzero value, with the limit of its relative error."""
    error = abs(ours / exact - 1.0)
    return Finding("value", exact, ours, error, quantity=quantity, limit=limit, order=order)


def observed_order(errors: list[float], ratio: float = 2.0) -> float:
    """Order from the last two errors, where the spacing or step shrinks by `ratio`."""
    return float(np.log(errors[-2] / errors[-1]) / np.log(ratio))


def convergence(
    quantity: str, errors: list[float], order: float, tolerance: float, limit: float
) -> Iterator[Finding]:
    """The error at the finest spacing, each half of the one before, and the observed order.

    The difference of an order is absolute.
    """
    found = observed_order(errors)
    yield error_of(quantity, errors[-1], limit, found)
    off, name = abs(found - order), f"order of {quantity}"
    yield Finding("value", order, found, off, quantity=name, limit=tolerance)
