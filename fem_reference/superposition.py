"""Motion as a superposition of few vectors, and how many of them it takes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from fem_reference.elasticity import Body
from fem_reference.observation import at_points
from fem_reference.pace import Pace
from fem_reference.recording import Recorder
from fem_reference.subspace import Subspace, modal_subspace, ritz_subspaces, superposition
from study.problem.damping import RayleighDamping
from study.problem.trajectory import Observation

Floats = NDArray[np.float64]
Factor = Callable[[Floats], Floats]
Advance = Callable[[float], None]

LOAD_STEPS = 16
"""Per step of a motion: the load is linear between them."""
GROWTH = 4
MAX_VECTORS, MOST_VECTORS = 80, 160
"""Per load: as a rule, and where the displacement still changes by more than `GOOD`."""
GOOD = 5e-3
TINY = 1e-300
TRUNCATION = 1e-3
"""Relative L2 change of a control point's motion by the last vectors, at which there are enough."""


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

    `curves`: at the control points; `truncation`: their largest relative L2 changes by the last
    quarter of the vectors; `time_step` [s] and `steps` of the load.
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
        """The larger of the two."""
        return max(self.truncation)

    def state(self, sample: int) -> tuple[Floats, Floats]:
        """Displacement [m] and velocity [m/s] (n,) of all unknowns at a sample."""
        V = self.subspace.vectors
        return V @ self.coordinates[sample], V @ self.rates[sample]


@dataclass(frozen=True)
class Excitation:
    """What the motion follows from beside the body; the load is linear between `times` [s].

    There are `samples` at the `pace` of these steps; `at_probes` takes nodal values to control
    points.
    """

    damping: RayleighDamping
    factor: Factor
    times: Floats
    pace: Pace
    samples: int
    at_probes: csr_array

    def coordinates(self, subspace: Subspace) -> tuple[Floats, Floats]:
        """Coordinates and rates (samples, m)."""
        given = (self.damping, self.factor, self.times, self.pace.samples)
        y, rate = superposition(subspace, *given)
        every = self.pace.per_sample
        return y[::every][: self.samples], rate[::every][: self.samples]

    def curves(self, subspace: Subspace, coordinates: tuple[Floats, Floats]) -> ProbeCurves:
        """The motion of the control points by its coordinates and rates."""
        nodes, m = self.at_probes.shape[1], subspace.load.size
        shapes = (self.at_probes @ subspace.vectors.reshape(nodes, 3 * m)).reshape(-1, 3, m)
        return ProbeCurves(*(np.einsum("pdm,tm->tpd", shapes, y) for y in coordinates))

    def change(self, subspace: Subspace, whole: ProbeCurves) -> CurveChange:
        """Largest relative L2 changes of its curves by the last quarter of the vectors."""
        less = subspace.leading(fewer(subspace.load.size))
        return curve_change(whole, self.curves(less, self.coordinates(less)))


def fewer(vectors: int) -> int:
    """So many vectors without their last quarter."""
    return max(1, (3 * vectors) // 4)


def curve_change(whole: ProbeCurves, other: ProbeCurves) -> CurveChange:
    """Of curves by other ones, relative to the whole."""
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
    damping: RayleighDamping, factor: Factor, recorder: Recorder, pace: Pace
) -> Excitation:
    """That of a recorder's samples, with steps of the load at a pace."""
    samples = recorder.observation.times
    count = pace.steps(len(samples) - 1)
    end = samples[0] + (samples[-1] - samples[0]) * (
        count * pace.samples / (pace.per_sample * (len(samples) - 1))
    )
    times = np.linspace(samples[0], end, count + 1)
    return Excitation(damping, factor, times, pace, len(samples), recorder.at_probes)


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
    """What is recorded of a body's motion in a given subspace, by so many steps of the load."""
    recorder = Recorder(body, observation)
    seen, V = recorder.at_probes, subspace.vectors
    pace = Pace(steps_per_sample)
    coordinates = excitation_of(damping, factor, recorder, pace).coordinates(subspace)
    for sample, (y, rate) in enumerate(zip(*coordinates, strict=True)):
        u, v = V @ y, V @ rate
        recorder.motion(sample, at_points(seen, u), at_points(seen, v))
        recorder.field(sample, u)
    return recorder


Near = Floats | None
"""Vectors (n, k) near those of a subspace, as of the same body on another mesh, if there are."""
Choose = Callable[[Body, Excitation, int, Near, Advance], Subspace]
"""A subspace for a body's motion, of so many modes where they are asked for, from vectors near."""


def enough_modes(
    body: Body, excitation: Excitation, modes: int, near: Near, advance: Advance
) -> Subspace:
    """So many modes of vibration."""
    del excitation, near, advance
    return modal_subspace(body, modes)


def enough_ritz_vectors(
    body: Body, excitation: Excitation, modes: int, near: Near, advance: Advance
) -> Subspace:
    """Load-dependent Ritz vectors, until the last ones change little."""
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
            break  # what is left are waves in the velocity, of which each mesh has its own
    return found
