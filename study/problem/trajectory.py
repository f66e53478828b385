"""What a model is asked to record, and what it gives back."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Status = Literal["finished", "diverged", "not finished"]
"""Not finished: no state was found to go on from, or the means of the run did not suffice."""


@dataclass(frozen=True, eq=False)
class Observation:
    """When and where a model is looked at.

    `times` [s] (samples,), equally spaced from zero;
    `probes` [m] (probes, 3); `frames`: samples at which the whole field is kept, the first and last
    of which are what strains are looked for at; `volume_points` [m] (q, 3) and `surface_points` [m]
    (s, 3): where it is kept.
    """

    times: Floats
    probes: Floats
    frames: tuple[int, ...]
    volume_points: Floats
    surface_points: Floats

    @property
    def ends(self) -> tuple[int, ...]:
        """First and last of the frames; none without frames."""
        return self.frames[:1] + self.frames[-1:]


@dataclass(frozen=True)
class Trajectory:
    """Motion of one model.

    `displacement` [m] and `velocity` [m/s], shape (samples, probes, 3); `volume_field` [m], shape
    (frames, q, 3); `surface_field` [m], shape (frames, s, 3). `tool_force` [N], shape (samples,
    tools, 3): what the body does to each rigid tool of the problem. A motion that did not finish
    keeps NaN from where it `ended_at` [s] on, 0 if it never began: one that diverged, if it has
    nodes, near the rest position [m] of which.
    """

    displacement: Floats
    velocity: Floats
    volume_field: Floats
    surface_field: Floats
    tool_force: Floats = field(default_factory=lambda: np.zeros((0, 0, 3)))
    status: Status = "finished"
    ended_at: float | None = None
    ended_near: Floats | None = None


def empty_trajectory(observation: Observation, tools: int = 0) -> Trajectory:
    """Arrays of the right shape, filled with NaN, for a model to write into."""
    samples, frames = len(observation.times), len(observation.frames)
    return Trajectory(
        np.full((samples, len(observation.probes), 3), np.nan),
        np.full((samples, len(observation.probes), 3), np.nan),
        np.full((frames, len(observation.volume_points), 3), np.nan),
        np.full((frames, len(observation.surface_points), 3), np.nan),
        np.full((samples, tools, 3), np.nan),
    )
