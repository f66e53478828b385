"""The reference as a model of the study: a body under the tool, from rest."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem_reference.dynamics import Oscillator, march, solve_static
from fem_reference.elasticity import Body, discretise, evaluation, largest_strain
from study.contact import Foundation, ToolPatch
from study.mesh.kinds import TetrahedralMesh
from study.scene import Tissue
from study.trajectory import Observation, Trajectory, empty_trajectory

Floats = NDArray[np.float64]

MAX_UNKNOWNS = 90_000
"""Direct factors beyond this take minutes and gigabytes."""


@dataclass(frozen=True)
class Reference:
    """Trajectory with what it took; `wall` [s] has the factorisation in it, not the assembly.

    `largest_strain`: largest absolute principal strain in the kept frames; linear elasticity is
    good for a few per cent.
    """

    trajectory: Trajectory
    nodes: int
    elements: int
    time_step: float
    steps: int
    wall: float
    largest_strain: float


def build(mesh: TetrahedralMesh, tissue: Tissue, foundation: Foundation, tool: ToolPatch) -> Body:
    """Discretised body. ValueError if it is too large for a direct solver."""
    expected = 3 * (len(mesh.points) + int(1.25 * len(mesh.tetrahedra)))
    if expected > MAX_UNKNOWNS:
        raise ValueError(
            f"the finite-element mesh has {len(mesh.tetrahedra)} tetrahedra, about {expected} "
            f"unknowns; the direct solver takes {MAX_UNKNOWNS}: enlarge reference.element_size or "
            "coarsen organ.mesh"
        )
    return discretise(mesh, tissue, foundation, tool)


def run(
    body: Body,
    damping_rate: float,
    factor: Callable[[Floats], Floats],
    observation: Observation,
    steps_per_sample: int = 1,
    on_progress: Callable[[float], None] = lambda _: None,
) -> Reference:
    """Motion from rest; one step, or more, per sample."""
    times = observation.times
    step = float(times[1] - times[0]) / steps_per_sample
    count = (len(times) - 1) * steps_per_sample
    recorder = _Recorder(body, observation)
    strain = 0.0
    started = time.perf_counter()
    system = Oscillator(body.mass, body.stiffness, body.load, damping_rate)
    for n, (u, v) in enumerate(march(system, factor, step, count)):
        if n % steps_per_sample == 0:
            recorder.record(n // steps_per_sample, u, v)
            if n // steps_per_sample in observation.frames:
                strain = max(strain, largest_strain(body, u))
            on_progress(n / count)
    wall = time.perf_counter() - started
    elements = len(body.mesh.tetrahedra)
    return Reference(recorder.trajectory, body.node_count, elements, step, count, wall, strain)


def static_field(body: Body, points: Floats) -> Floats:
    """Displacement [m] (q, 3) at points under the full load at rest."""
    return np.asarray(
        (evaluation(body, points) @ solve_static(body.stiffness, body.load)).reshape(-1, 3)
    )


class _Recorder:
    """Writes what is observed into the arrays of a trajectory."""

    def __init__(self, body: Body, observation: Observation) -> None:
        self.frames = observation.frames
        self.trajectory = empty_trajectory(observation)
        self.at_probes = evaluation(body, observation.probes)
        self.in_volume = evaluation(body, observation.volume_points)
        self.on_surface = evaluation(body, observation.surface_points)

    def record(self, sample: int, u: Floats, v: Floats) -> None:
        """Keep the motion at one sample."""
        self.trajectory.displacement[sample] = (self.at_probes @ u).reshape(-1, 3)
        self.trajectory.velocity[sample] = (self.at_probes @ v).reshape(-1, 3)
        for i, frame in enumerate(self.frames):  # the peak may be the last sample too
            if frame == sample:
                self.trajectory.volume_field[i] = (self.in_volume @ u).reshape(-1, 3)
                self.trajectory.surface_field[i] = (self.on_surface @ u).reshape(-1, 3)
