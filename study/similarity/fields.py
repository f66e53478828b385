"""How far apart two displacement fields are, over the volume of the organ."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def norm(field: Floats, volumes: Floats) -> float:
    """L2 norm over the organ of a field (q, 3) at points that stand for `volumes` [m^3] (q,)."""
    return float(np.sqrt(volumes @ (field**2).sum(axis=1)))


def relative_l2(field: Floats, reference: Floats, volumes: Floats) -> float:
    """Relative L2 difference of two fields over the organ."""
    return norm(field - reference, volumes) / norm(reference, volumes)


def best_factor(field: Floats, reference: Floats, volumes: Floats) -> float:
    """Factor on a field that brings it nearest to the reference.

    A linear model at rest is softer by this factor if its stiffness is divided by it, so what is
    left at the best factor is what no estimate of one stiffness can remove.
    """
    product = volumes @ (field * reference).sum(axis=1)
    return float(product / norm(field, volumes) ** 2)
