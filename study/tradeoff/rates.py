"""Steps and cost of a frame: a state is due at every whole number of periods of a rate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from msm.timestep import whole_steps

Floats = NDArray[np.float64]

RATES = {"25hz": 25.0, "60hz": 60.0, "1khz": 1000.0}
"""Frames per second [Hz] of a film, a screen and a haptic device."""
SLOW = 95.0
"""Percentile of the frame times that stands for a slow frame."""


@dataclass(frozen=True)
class Frame:
    """One frame: number of steps, median wall [s], and that of a slow frame if enough were timed.

    `in_time`: whether even a slow frame is ready before the next is due.
    """

    substeps: int
    wall: float
    slow: float | None
    in_time: bool


def frame(rate: float, step: float, walls: Floats) -> Frame:
    """A frame at a rate [Hz] from the walls [s] of single steps, each of at most `step` [s].

    Steps are shortened until a whole number of them makes the frame; a shorter step costs as much.
    """
    substeps = whole_steps(1.0 / rate, step)
    taken = np.ravel(walls)
    if substeps > len(taken):
        wall = substeps * float(taken.mean())
        return Frame(substeps, wall, None, wall <= 1.0 / rate)
    frames = sliding_window_view(taken, substeps).sum(axis=1)
    wall, slow = (float(p) for p in np.percentile(frames, [50.0, SLOW]))
    return Frame(substeps, wall, slow, slow <= 1.0 / rate)
