"""Load histories and the sample that shows the peak."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from study.scene import History


def load_factor(history: History, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share of the tool's force at each time [s]; same shape as `times`."""
    if history.kind == "step":
        return np.ones_like(times)
    if history.kind == "sinusoid":
        return np.asarray(np.sin(2.0 * np.pi * history.frequency * times))
    corners = np.cumsum([0.0, history.ramp, history.hold, history.release])
    return np.interp(times, corners, [0.0, 1.0, 1.0, 0.0])


def peak_sample(factors: NDArray[np.float64]) -> int:
    """Last sample at which the load is largest: where the organ has yielded the longest."""
    size = np.abs(factors)
    return int(np.flatnonzero(size >= size.max() * (1.0 - 1e-9))[-1])
