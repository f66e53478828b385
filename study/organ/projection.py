"""The nearest surface of an implicit shape."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

STEPS = 8
DIFFERENCE = 1e-6
"""[m]; the function is smooth over millimetres."""


def onto_surface(signed: Callable[[Floats], Floats], points: Floats) -> Floats:
    """Points [m] (n, 3) moved along the gradient to where `signed` is zero, by Newton's method.

    From close by that is nearly the nearest point of the surface.
    """
    for _ in range(STEPS):
        gradient = _gradient(signed, points)
        share = signed(points) / (gradient**2).sum(axis=1)
        points = points - share[:, None] * gradient
    return points


def _gradient(signed: Callable[[Floats], Floats], points: Floats) -> Floats:
    columns = [
        (signed(points + DIFFERENCE * axis) - signed(points - DIFFERENCE * axis)) / (2 * DIFFERENCE)
        for axis in np.eye(3)
    ]
    return np.stack(columns, axis=1)
