"""Relative L2 distance of time histories, the plain check beside ISO/TS 18571."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def relative_l2_distance(candidate: Floats, reference: Floats) -> float:
    """||candidate - reference|| / ||reference|| over equal time steps; shape (samples,), 0 best."""
    return float(np.linalg.norm(candidate - reference) / np.linalg.norm(reference))


def relative_l2_score(candidate: Floats, reference: Floats) -> float:
    """max(0, 1 - distance): 0 once the error is as large as the reference itself."""
    return max(0.0, 1.0 - relative_l2_distance(candidate, reference))
