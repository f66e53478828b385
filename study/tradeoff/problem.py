"""Sampling of the problem that all contenders solve, and storage of its numbers."""

from __future__ import annotations

from dataclasses import replace
from math import ceil

import numpy as np
from numpy.typing import NDArray

from study.scene import Scene

Floats = NDArray[np.float64]

SAMPLING = 0.05
"""Interval [s] of samples: a whole number of frames at 60 Hz and of steps at 1 kHz.

Under moved tools it is divided until it does not exceed the scene's own, to resolve their force.
"""
FEWEST_SAMPLES = 16
DIGITS = 8
TIDY_DIGITS = 12


def sampled(scene: Scene) -> Scene:
    """The scene at samples that frames and steps of the usual rates divide.

    The remainder of its duration is cut off. A scene too short for that keeps its own samples.
    ValueError if it is a single mass point.
    """
    if scene.is_point:
        raise ValueError(
            'organ.shape: "point" has no displacement field to be accurate in; choose a scene with '
            "an organ"
        )
    free = replace(scene.lattice, time_step=None, step_rate=None)  # contenders have their own
    scene = replace(scene, lattice=free)
    interval = SAMPLING / (_parts(scene) if "moved-tools" in scene.features else 1)
    count = int(scene.time.duration / interval * (1.0 + 1e-9))
    if count + 1 < FEWEST_SAMPLES:
        return scene
    return replace(
        scene, time=replace(scene.time, duration=tidy(count * interval), samples=count + 1)
    )


def _parts(scene: Scene) -> int:
    own = scene.time.duration / (scene.time.samples - 1)
    return max(1, ceil(SAMPLING / own * (1.0 - 1e-9)))


def tidy(value: float) -> float:
    """The value without the rounding of a product, as one would write it in a scene."""
    return float(f"{value:.{TIDY_DIGITS}g}")


def plain(values: Floats) -> list[float]:
    """All entries, in eight digits."""
    return [float(f"{value:.{DIGITS}g}") for value in values.ravel()]
