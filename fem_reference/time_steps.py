"""Choice of the time step of a motion from its load history, not from its sampling."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Factor = Callable[[Floats], Floats]

LEAST_STEPS = 200
"""Least number of steps of a motion with more samples; with fewer, one step per sample."""
LOAD_TOLERANCE = 1e-3
"""Relative L2 error, over the samples, of a load history interpolated over the steps."""


class TimeSteps(NamedTuple):
    """Steps `per_sample`, or `samples` per step; one of the two is 1."""

    per_sample: int = 1
    samples: int = 1

    def refined(self, ratio: int) -> TimeSteps:
        """With `ratio` times the steps, a power of two where a step has several samples."""
        common = min(ratio, self.samples)
        return TimeSteps(self.per_sample * (ratio // common), self.samples // common)

    def count(self, intervals: int) -> int:
        """Number of steps over a number of sampling intervals."""
        return self.per_sample * -(-intervals // self.samples)

    def step(self, interval: float) -> float:
        """Time step [s] for a sampling interval [s]."""
        return interval * self.samples / self.per_sample


def steps_for_load(factor: Factor, times: Floats, parts: int = 1) -> TimeSteps:
    """Time steps of a motion under a load history, with samples at equally spaced times [s].

    The number of samples per step is the largest power of two with at least LEAST_STEPS steps and
    an error of the load, interpolated linearly over each of the `parts` of a step, within
    LOAD_TOLERANCE.
    """
    samples = 1
    while 2 * samples * LEAST_STEPS <= len(times) - 1:
        if not _is_resolved(factor, times, 2 * samples // parts):
            break
        samples *= 2
    return TimeSteps(samples=samples)


def _is_resolved(factor: Factor, times: Floats, stride: int) -> bool:
    """Whether linear interpolation between every `stride`-th sample reproduces the load history."""
    if stride <= 1:
        return True
    exact_values = factor(times)
    nodes = times[0] + (times[1] - times[0]) * np.arange(0, len(times) + stride, stride)
    columns = (np.reshape(f, (len(f), -1)).T for f in (factor(nodes), exact_values))
    return all(
        np.linalg.norm(np.interp(times, nodes, coarse) - exact)
        <= LOAD_TOLERANCE * np.linalg.norm(exact)
        for coarse, exact in zip(*columns, strict=True)
    )
