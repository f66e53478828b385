"""Fuzzy sets: a membership function and the uncertainty of its position.

An uncertain mean moves the whole function by at most `spread` either way. The upper and the lower
membership are the largest and the smallest value met on the way. Every function here rises to a
peak and falls after it, so both have closed forms for all kinds alike.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Kind = Literal["gaussian", "left-shoulder", "right-shoulder", "triangle", "trapezoid"]

PARAMETER_COUNT = {
    "gaussian": 2,
    "left-shoulder": 2,
    "right-shoulder": 2,
    "triangle": 3,
    "trapezoid": 4,
}


@dataclass(frozen=True)
class FuzzySet:
    """A named set on one variable, in the variable's unit.

    `parameters` are (centre, sd) of a Gaussian or a shoulder, or the corners, left to right, of a
    triangle or a trapezoid. A left shoulder is 1 below its centre, a right shoulder 1 above.
    `spread` is the half-width of the uncertain position; 0 is a type-1 set.
    """

    name: str
    kind: Kind
    parameters: tuple[float, ...]
    spread: float = 0.0

    def __post_init__(self) -> None:
        if self.kind not in PARAMETER_COUNT:
            raise ValueError(f"set {self.name!r}: kind {self.kind!r}; use {[*PARAMETER_COUNT]}")
        expected = PARAMETER_COUNT[self.kind]
        if len(self.parameters) != expected:
            raise ValueError(
                f"set {self.name!r}: {self.kind} takes {expected} parameters, "
                f"got {len(self.parameters)}"
            )
        if not _shaped(self.kind, self.parameters):
            raise ValueError(
                f"set {self.name!r}: parameters {self.parameters} do not form a {self.kind}; "
                "give a positive sd, or corners that rise and fall over a positive width"
            )
        if not 0 <= self.spread < np.inf:
            raise ValueError(f"set {self.name!r}: spread {self.spread} must be 0 or more")


def _shaped(kind: Kind, parameters: tuple[float, ...]) -> bool:
    if not np.isfinite(parameters).all():
        return False
    if kind in ("triangle", "trapezoid"):
        return parameters[0] < parameters[1] <= parameters[-2] < parameters[-1]
    return parameters[1] > 0


def gaussian(x: Array, centre: float, sd: float) -> Array:
    """exp(-(x - centre)^2 / 2 sd^2), MATLAB's `gaussmf`."""
    return np.asarray(np.exp(-0.5 * ((x - centre) / sd) ** 2))


def trapezoid(x: Array, a: float, b: float, c: float, d: float) -> Array:
    """Rises over [a, b], 1 over [b, c], falls over [c, d]."""
    return np.clip(np.minimum((x - a) / (b - a), (d - x) / (d - c)), 0.0, 1.0)


def peak(fuzzy_set: FuzzySet) -> float:
    """A position where the membership is 1."""
    corners = fuzzy_set.kind in ("triangle", "trapezoid")
    return fuzzy_set.parameters[1 if corners else 0]


def membership(fuzzy_set: FuzzySet, x: Array) -> Array:
    """Type-1 membership of x, any shape, with the set in its central position."""
    p = fuzzy_set.parameters
    match fuzzy_set.kind:
        case "gaussian":
            return gaussian(x, *p)
        case "left-shoulder":
            return gaussian(np.maximum(x, p[0]), *p)
        case "right-shoulder":
            return gaussian(np.minimum(x, p[0]), *p)
        case "triangle":
            return trapezoid(x, p[0], p[1], p[1], p[2])
        case "trapezoid":
            return trapezoid(x, *p)


def upper_membership(fuzzy_set: FuzzySet, x: Array) -> Array:
    """Largest membership of x over all positions of the set."""
    # Moving the set by s is moving x by -s; the best x within reach is the one nearest the peak.
    spread = fuzzy_set.spread
    return membership(fuzzy_set, np.clip(peak(fuzzy_set), x - spread, x + spread))


def lower_membership(fuzzy_set: FuzzySet, x: Array) -> Array:
    """Smallest membership of x over all positions of the set."""
    # A function that rises and then falls is smallest at an end of any interval.
    spread = fuzzy_set.spread
    return np.minimum(membership(fuzzy_set, x - spread), membership(fuzzy_set, x + spread))
