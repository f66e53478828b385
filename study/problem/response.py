"""What is compared of a motion: displacement and velocity along the tool's push."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from study.problem.trajectory import Trajectory

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """Time [s], displacement [m] and velocity [m/s] of a point along a line, (samples,)."""

    time: Floats
    displacement: Floats
    velocity: Floats


@dataclass(frozen=True)
class Response:
    """The response quantities: times [s], names of the probes, unit vector of the tool's push.

    `volumes` [m^3] (q,) weigh the points of the volume field.
    """

    times: Floats
    probes: tuple[str, ...]
    direction: Floats
    volumes: Floats

    def motion(self, trajectory: Trajectory, probe: int) -> Motion:
        """Displacement and velocity of a probe along the push."""
        return Motion(
            self.times,
            trajectory.displacement[:, probe] @ self.direction,
            trajectory.velocity[:, probe] @ self.direction,
        )
