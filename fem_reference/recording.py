"""Recording of a body's motion in a trajectory."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fem_reference.elasticity import Body
from fem_reference.observation import at_points, evaluation, strain_and_rotation
from study.problem.trajectory import Observation, empty_trajectory

Floats = NDArray[np.float64]


class Recorder:
    """Writes observed quantities into the arrays of a trajectory.

    `start` [m] (n,): displacement at the start of the motion, which recorded states do not
    include. `strain` and `rotation` [rad]: the largest of the recorded fields so far.
    """

    def __init__(
        self, body: Body, observation: Observation, start: Floats | None = None, tools: int = 0
    ) -> None:
        self.body, self.observation = body, observation
        self.start = np.zeros(body.load.size) if start is None else start
        self.at_probes = evaluation(body, observation.probes)
        self.in_volume = evaluation(body, observation.volume_points)
        self.on_surface = evaluation(body, observation.surface_points)
        self.trajectory = empty_trajectory(observation, tools)
        self._start_of_probes = at_points(self.at_probes, self.start)
        self.strain = self.rotation = 0.0

    def motion(self, sample: int, displacement: Floats, velocity: Floats) -> None:
        """Record displacement [m] and velocity [m/s] (probes, 3) at one sample."""
        self.trajectory.displacement[sample] = self._start_of_probes + displacement
        self.trajectory.velocity[sample] = velocity

    def field(self, sample: int, u: Floats) -> None:
        """Record the field at the frames; update strain and rotation at the first and last."""
        for i, frame in enumerate(self.observation.frames):  # the peak may be the last sample too
            if frame == sample:
                total = self.start + u
                self.trajectory.volume_field[i] = at_points(self.in_volume, total)
                self.trajectory.surface_field[i] = at_points(self.on_surface, total)
        if sample in self.observation.ends:
            self.look(u)

    def look(self, u: Floats) -> None:
        """Update the largest strain and rotation with a state u [m] (n,)."""
        strain, rotation = strain_and_rotation(self.body, self.start + u)
        self.strain, self.rotation = max(self.strain, strain), max(self.rotation, rotation)
