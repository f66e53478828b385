"""Norms and differences of displacement fields over the organ, and of curves over time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

TINY = 1e-300
"""Replaces the norm of curves that do not move."""


def norm(field: Floats, volumes: Floats) -> float:
    """L2 norm over the organ of a field (q, 3) at points with weights `volumes` [m^3] (q,)."""
    return float(np.sqrt(volumes @ (field**2).sum(axis=1)))


def relative_l2(field: Floats, reference: Floats, volumes: Floats) -> float:
    """Relative L2 difference of two fields over the organ."""
    return norm(field - reference, volumes) / norm(reference, volumes)


def best_factor(field: Floats, reference: Floats, volumes: Floats) -> float:
    """Factor on a field that minimises its distance from the reference.

    Dividing the stiffness of a linear model at rest by this factor multiplies its displacement by
    it, so what remains at the best factor is what no estimate of one stiffness can remove.
    """
    product = volumes @ (field * reference).sum(axis=1)
    return float(product / norm(field, volumes) ** 2)


def relative_l2_of_curves(difference: Floats, of: Floats) -> Floats:
    """L2 norm over time of curves (samples, probes, 3) over that of others, (probes,)."""
    sizes = [np.sqrt((x**2).sum(axis=(0, 2))) for x in (difference, of)]
    return np.asarray(sizes[0] / np.maximum(sizes[1], TINY))
