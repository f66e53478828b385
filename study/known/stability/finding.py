"""What a case found: how it ended, and a figure beside the one known beforehand."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Ending = Literal["value", "bounded", "diverged", "refused", "error"]


@dataclass(frozen=True)
class Finding:
    """How a case ended, with what was predicted and what was measured.

    `difference`: of the two, relative, as the function that made the finding says. `ending`: a
    `value` came out, a motion stayed `bounded` or `diverged`, bad input was `refused`; an `error`
    is none of these.
    """

    ending: Ending
    predicted: float | None = None
    measured: float | None = None
    difference: float | None = None
    message: str = ""


def value(
    predicted: float, measured: float, message: str = "", ending: Ending = "value"
) -> Finding:
    """A number beside the one it should be; relative to it, or to 1 where it is zero."""
    size = abs(predicted) if predicted else 1.0
    return Finding(ending, predicted, measured, abs(measured - predicted) / size, message)


def beside(
    expected: NDArray[np.float64], found: NDArray[np.float64], ending: Ending = "value"
) -> Finding:
    """A field beside the one it should be: their norms, and that of their difference over it."""
    size = float(np.linalg.norm(expected))
    apart = float(np.linalg.norm(found - expected) / size)
    return Finding(ending, size, float(np.linalg.norm(found)), apart, "norm of all values")


def at_most(
    bound: float, measured: float, message: str = "", ending: Ending = "bounded"
) -> Finding:
    """A number beside a positive bound on it; the difference is by how much it goes beyond."""
    excess = max(0.0, measured / bound - 1.0) if math.isfinite(measured) else math.inf
    return Finding(ending, bound, measured, excess, message)
