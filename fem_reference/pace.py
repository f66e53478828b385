"""How long the steps of a motion are: by what they have to follow, not by how often it is seen."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Factor = Callable[[Floats], Floats]

OWN_STEPS = 200
"""Fewest steps of a motion that is sampled more often; one sampled less has a step per sample."""
LOAD_TOLERANCE = 1e-3
"""Relative L2 error, over the samples, of a load that is linear over own steps."""


class Pace(NamedTuple):
    """So many steps `per_sample`, or `samples` in each step; one of the two is 1."""

    per_sample: int = 1
    samples: int = 1

    def times(self, count: int) -> Pace:
        """With so many times the steps, a power of two where a step holds several samples."""
        shared = min(count, self.samples)
        return Pace(self.per_sample * (count // shared), self.samples // shared)

    def steps(self, intervals: int) -> int:
        """How many steps take a motion over the intervals between its samples."""
        return self.per_sample * -(-intervals // self.samples)

    def length(self, interval: float) -> float:
        """Of a step [s], for samples so far apart [s]."""
        return interval * self.samples / self.per_sample


def own_pace(factor: Factor, times: Floats, parts: int = 1) -> Pace:
    """Steps of a motion under a load history that is sampled at equally spaced times [s].

    The samples in a step are a power of two, as many as leave `OWN_STEPS` and the load, linear over
    each of the `parts` of a step, within `LOAD_TOLERANCE`.
    """
    held = 1
    while 2 * held * OWN_STEPS <= len(times) - 1 and _follows(factor, times, 2 * held // parts):
        held *= 2
    return Pace(samples=held)


def _follows(factor: Factor, times: Floats, held: int) -> bool:
    """Whether the load at every so many samples, and linear between, is that at all of them."""
    if held <= 1:
        return True
    whole = factor(times)
    nodes = times[0] + (times[1] - times[0]) * np.arange(0, len(times) + held, held)
    histories = zip(*(np.reshape(f, (len(f), -1)).T for f in (factor(nodes), whole)), strict=True)
    return all(
        np.linalg.norm(np.interp(times, nodes, held) - exact)
        <= LOAD_TOLERANCE * np.linalg.norm(exact)
        for held, exact in histories
    )
