"""What a model is asked to record, and the motion that it returns."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Status = Literal["finished", "diverged", "not finished"]
""""not finished": no next state was found, or the resources of the run did not suffice."""


@dataclass(frozen=True, eq=False)
class Observation:
    """When and where a model is observed.

    `times` [s] (samples,), equally spaced from zero; `probes` [m] (probes, 3); `frames`: samples at
    which fields are recorded, of which the first and the last are used for strains; `volume_points`
    [m] (q, 3) and `surface_points` [m] (s, 3): where fields are recorded.
    """

    times: Floats
    probes: Floats
    frames: tuple[int, ...]
    volume_points: Floats
    surface_points: Floats

    @property
    def ends(self) -> tuple[int, ...]:
        """First and last of the frames; empty without frames."""
        return self.frames[:1] + self.frames[-1:]


@dataclass(frozen=True)
class Trajectory:
    """Motion of one model.

    `displacement` [m] and `velocity` [m/s] (samples, probes, 3); `volume_field` [m] (frames, q, 3);
    `surface_field` [m] (frames, s, 3); `tool_force` [N] (samples, tools, 3): force of the body on
    each rigid tool. A motion that did not finish is NaN from the time `ended_at` [s] on, which is 0
    if it never began; one that diverged also has the rest position [m] of the node where it did, if
    known.
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
    """Arrays of the right shapes, filled with NaN, for a model to write into."""
    samples, frames = len(observation.times), len(observation.frames)
    return Trajectory(
        np.full((samples, len(observation.probes), 3), np.nan),
        np.full((samples, len(observation.probes), 3), np.nan),
        np.full((frames, len(observation.volume_points), 3), np.nan),
        np.full((frames, len(observation.surface_points), 3), np.nan),
        np.full((samples, tools, 3), np.nan),
    )
