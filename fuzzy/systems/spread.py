"""Quasi-random points in the unit cube, the same on every run."""

import numpy as np

from fuzzy.systems.sets import Array


def spread(count: int, dimensions: int) -> Array:
    """Points (count, dimensions) in [0, 1) by an additive recurrence.

    Its steps are powers of 1/g, where g > 1 solves g^(d + 1) = g + 1 in d dimensions; in one it is
    the golden section.
    """
    g = 2.0
    for _ in range(60):  # each pass gains half a digit or more
        g = (1.0 + g) ** (1.0 / (dimensions + 1))
    steps = g ** -np.arange(1.0, dimensions + 1.0)
    return np.asarray((0.5 + np.outer(np.arange(1, count + 1), steps)) % 1.0)
