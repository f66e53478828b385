"""What is kept of a body's motion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fem_reference.elasticity import Body
from fem_reference.observation import at_points, evaluation, largest_rotation, largest_strain
from study.problem.trajectory import Observation, empty_trajectory

Floats = NDArray[np.float64]


class Recorder:
    """Writes what is observed into the arrays of a trajectory.

    `strain` and `rotation` [rad]: the largest of the states looked at so far.
    """

    def __init__(self, body: Body, observation: Observation) -> None:
        self.body, self.observation = body, observation
        self.at_probes = evaluation(body, observation.probes)
        self.in_volume = evaluation(body, observation.volume_points)
        self.on_surface = evaluation(body, observation.surface_points)
        self.trajectory = empty_trajectory(observation)
        self.strain = self.rotation = 0.0

    def motion(self, sample: int, displacement: Floats, velocity: Floats) -> None:
        """Keep displacement [m] and velocity [m/s] (probes, 3) at one sample."""
        self.trajectory.displacement[sample] = displacement
        self.trajectory.velocity[sample] = velocity

    def field(self, sample: int, u: Floats) -> None:
        """Keep the field if the sample is one of the frames."""
        for i, frame in enumerate(self.observation.frames):  # the peak may be the last sample too
            if frame == sample:
                self.trajectory.volume_field[i] = at_points(self.in_volume, u)
                self.trajectory.surface_field[i] = at_points(self.on_surface, u)
                self.look(u)

    def look(self, u: Floats) -> None:
        """Take note of how far a state is from small displacements."""
        self.strain = max(self.strain, largest_strain(self.body, u))
        self.rotation = max(self.rotation, largest_rotation(self.body, u))
