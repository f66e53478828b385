"""Modal superposition of the motion in a subspace, and the choice of its dimension."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from fem_reference.elasticity import Body
from fem_reference.observation import at_points
from fem_reference.recording import Recorder
from fem_reference.subspace import Subspace, modal_subspace, ritz_subspaces, superposition
from fem_reference.time_steps import TimeSteps
from study.problem.damping import RayleighDamping
from study.problem.trajectory import Observation

Floats = NDArray[np.float64]
Factor = Callable[[Floats], Floats]
Advance = Callable[[float], None]

LOAD_STEPS = 16
"""Steps of the load, linear in each, per time step of a motion."""
GROWTH = 4
MAX_VECTORS, MOST_VECTORS = 80, 160
"""Vectors per load, usually, and where the displacement still changes by more than `GOOD`."""
GOOD = 5e-3
TINY = 1e-300
TRUNCATION = 1e-3
"""Relative L2 change of a control point's motion by the last vectors, at convergence."""


class ProbeCurves(NamedTuple):
    """Displacement [m] and velocity [m/s] of the control points, (samples, probes, 3)."""

    displacement: Floats
    velocity: Floats


class CurveChange(NamedTuple):
    """Relative L2 change of displacement and of velocity, the largest of any control point."""

    displacement: float
    velocity: float


@dataclass(frozen=True)
class Superposed:
    """Motion in a subspace: `coordinates` and their `rates` (samples, m).

    `curves`: motion of the control points; `truncation`: its largest relative L2 change by the last
    quarter of the vectors; `time_step` [s] and number of `steps` of the load.
    """

    subspace: Subspace
    coordinates: Floats
    rates: Floats
    curves: ProbeCurves
    truncation: CurveChange
    time_step: float
    steps: int

    @property
    def truncation_error(self) -> float:
        """The larger of the relative changes of displacement and velocity."""
        return max(self.truncation)

    def state(self, sample: int) -> tuple[Floats, Floats]:
        """Displacement [m] and velocity [m/s] (n,) of all unknowns at a sample."""
        V = self.subspace.vectors
        return V @ self.coordinates[sample], V @ self.rates[sample]


@dataclass(frozen=True)
class Excitation:
    """Damping, load history and sampling of a motion; the load is linear between `times` [s].

    `steps`: ratio of these steps to the `samples`; `at_probes` interpolates nodal values at the
    control points.
    """

    damping: RayleighDamping
    factor: Factor
    times: Floats
    steps: TimeSteps
    samples: int
    at_probes: csr_array

    def coordinates(self, subspace: Subspace) -> tuple[Floats, Floats]:
        """Coordinates and their rates at the samples, each (samples, m)."""
        given = (self.damping, self.factor, self.times, self.steps.samples)
        y, rate = superposition(subspace, *given)
        every = self.steps.per_sample
        return y[::every][: self.samples], rate[::every][: self.samples]

    def curves(self, subspace: Subspace, coordinates: tuple[Floats, Floats]) -> ProbeCurves:
        """Motion of the control points from coordinates and rates."""
        nodes, m = self.at_probes.shape[1], subspace.load.size
        shapes = (self.at_probes @ subspace.vectors.reshape(nodes, 3 * m)).reshape(-1, 3, m)
        return ProbeCurves(*(np.einsum("pdm,tm->tpd", shapes, y) for y in coordinates))

    def change(self, subspace: Subspace, whole: ProbeCurves) -> CurveChange:
        """Largest relative L2 changes of its curves by the last quarter of the vectors."""
        less = subspace.leading(fewer(subspace.load.size))
        return curve_change(whole, self.curves(less, self.coordinates(less)))


def fewer(vectors: int) -> int:
    """Three quarters of a number of vectors, rounded down, at least 1."""
    return max(1, (3 * vectors) // 4)


def curve_change(whole: ProbeCurves, other: ProbeCurves) -> CurveChange:
    """Largest L2 difference of two sets of curves, relative to the first."""
    return CurveChange(
        *(
            max(
                float(np.linalg.norm(a[:, i] - b[:, i])) / max(float(np.linalg.norm(a[:, i])), TINY)
                for i in range(a.shape[1])
            )
            for a, b in zip(whole, other, strict=True)
        )
    )


def excitation_of(
    damping: RayleighDamping, factor: Factor, recorder: Recorder, steps: TimeSteps
) -> Excitation:
    """The excitation of a motion sampled by a recorder, with given steps of the load."""
    samples = recorder.observation.times
    count = steps.count(len(samples) - 1)
    end = samples[0] + (samples[-1] - samples[0]) * (
        count * steps.samples / (steps.per_sample * (len(samples) - 1))
    )
    times = np.linspace(samples[0], end, count + 1)
    return Excitation(damping, factor, times, steps, len(samples), recorder.at_probes)


def superposed(excitation: Excitation, subspace: Subspace) -> Superposed:
    """Motion in a subspace."""
    coordinates = excitation.coordinates(subspace)
    curves = excitation.curves(subspace, coordinates)
    change = excitation.change(subspace, curves)
    step, count = excitation.times[1] - excitation.times[0], len(excitation.times) - 1
    return Superposed(subspace, *coordinates, curves, change, float(step), count)


def subspace_motion(
    body: Body,
    subspace: Subspace,
    damping: RayleighDamping,
    factor: Factor,
    observation: Observation,
    steps_per_sample: int,
) -> Recorder:
    """Recorded motion of a body in a given subspace, with so many steps of the load per sample."""
    recorder = Recorder(body, observation)
    at_probes, V = recorder.at_probes, subspace.vectors
    steps = TimeSteps(steps_per_sample)
    coordinates = excitation_of(damping, factor, recorder, steps).coordinates(subspace)
    for sample, (y, rate) in enumerate(zip(*coordinates, strict=True)):
        u, v = V @ y, V @ rate
        recorder.motion(sample, at_points(at_probes, u), at_points(at_probes, v))
        recorder.field(sample, u)
    return recorder


Near = Floats | None
"""Approximations (n, k) of the vectors of a subspace, such as those on another mesh, or None."""
Choose = Callable[[Body, Excitation, int, Near, Advance], Subspace]
"""Makes the subspace of a motion from the number of modes and approximate vectors."""


def enough_modes(
    body: Body, excitation: Excitation, modes: int, near: Near, advance: Advance
) -> Subspace:
    """A given number of modes of vibration."""
    del excitation, near, advance
    return modal_subspace(body, modes)


def enough_ritz_vectors(
    body: Body, excitation: Excitation, modes: int, near: Near, advance: Advance
) -> Subspace:
    """Load-dependent Ritz vectors, until the last quarter changes the curves little."""
    del modes
    growing = ritz_subspaces(body, near)
    loads = body.loads.shape[1]
    usual, limit = (
        min(count * loads, body.stiffness.size) for count in (MAX_VECTORS, MOST_VECTORS)
    )
    tried, change = 1, CurveChange(np.inf, np.inf)
    for found in growing:
        size = found.load.size
        if size < min(tried + GROWTH, limit):
            continue
        tried, whole = size, excitation.curves(found, excitation.coordinates(found))
        change = excitation.change(found, whole)
        advance(min(1.0, size / usual))
        if max(change) <= TRUNCATION or size >= limit:
            break
        if size >= usual and change.displacement < GOOD:
            break  # the rest are waves in the velocity that the mesh does not resolve
    return found
