"""The reference as a model of the study: a body under the tool, from rest."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fem_reference.contact.outcome import ContactOutcome
from fem_reference.dynamics import March, Oscillator, State, hermite, hht, march
from fem_reference.elasticity import Body, Loaded, discretise, loaded_surface
from fem_reference.elements import AUTO
from fem_reference.grid import Projection
from fem_reference.memory import refuse_too_large
from fem_reference.observation import at_points, evaluation
from fem_reference.pace import Pace, own_pace
from fem_reference.recording import Recorder
from fem_reference.solvers import solve_static, solver
from fem_reference.superposition import (
    LOAD_STEPS,
    Choose,
    CurveChange,
    Near,
    Superposed,
    enough_modes,
    enough_ritz_vectors,
    excitation_of,
    superposed,
)
from study.mesh.kinds import TetrahedralMesh
from study.problem.contact import ToolPatch
from study.problem.damping import RayleighDamping
from study.problem.supports import Support
from study.problem.tissue import Tissue
from study.problem.trajectory import Observation, Trajectory

Floats = NDArray[np.float64]
Factor = Callable[[Floats], Floats]
Advance = Callable[[float], None]

DEFAULT = "ritz-vectors"


@dataclass(frozen=True)
class Method:
    """How the motion is found: a name of `METHODS`, steps per sample, modes of `modal`.

    Without `steps_per_sample` a motion has its own steps, however often it is sampled. Of either
    `times` as many are taken, a power of two.
    """

    name: str = DEFAULT
    steps_per_sample: int | None = None
    modes: int = 100
    times: int = 1

    def pace(self, factor: Factor, sampled: Floats) -> Pace:
        """Steps of a motion under a load history that is sampled at these times [s]."""
        if self.steps_per_sample is not None:
            return Pace(self.steps_per_sample * self.times)
        return own_pace(factor, sampled, self._parts).times(self.times)

    def load_pace(self, factor: Factor, sampled: Floats) -> Pace:
        """Steps over which the load of a superposition is linear."""
        return self.pace(factor, sampled).times(LOAD_STEPS)

    @property
    def _parts(self) -> int:
        return 1 if self.name in STEPPING else LOAD_STEPS


@dataclass(frozen=True)
class Solution:
    """Trajectory with what it took; `wall` [s] has the solution in it, not the assembly.

    `time_step` [s] and `steps`: for a superposition those of the load. `superposed`: how a
    superposition was made, and the motion of all nodes; none of steps in time. `largest_strain`:
    largest absolute principal strain in the kept frames, of a superposition also where a control
    point is farthest out, and `largest_rotation` [rad] likewise; linear elasticity is good for a
    few per cent of either. `start` [m] (n,): where the motion starts under what acts at all times,
    None where nothing does. `moving`: displacement [m] and velocity [m/s] (n,) of all unknowns at a
    sample, counted from the given shape, None of steps in time. `contact`: with moved tools.
    """

    trajectory: Trajectory
    nodes: int
    elements: int
    element: str
    time_step: float
    steps: int
    wall: float
    largest_strain: float
    largest_rotation: float
    superposed: Superposed | None = None
    start: Floats | None = None
    moving: Callable[[int], State] | None = None
    contact: ContactOutcome | None = None

    @property
    def truncation(self) -> CurveChange | None:
        """How far the last quarter of a subspace changes the curves, None of steps in time."""
        if self.contact is not None:
            return self.contact.truncation
        return None if self.superposed is None else self.superposed.truncation

    @property
    def vectors(self) -> int | None:
        """Of the subspace, None of steps in time."""
        if self.contact is not None:
            return self.contact.vectors
        return None if self.superposed is None else self.superposed.subspace.load.size

    def rest(self, body: Body) -> Floats:
        """Displacement [m] (n,) of the body at rest under all loads in full."""
        if self.contact is not None:
            return self.contact.at_rest
        if self.superposed is None:
            return solve_static(body)
        moved = self.superposed.subspace.rest(body.full)
        return moved if self.start is None else moved + self.start


MotionMethod = Callable[[Body, RayleighDamping, Factor, Recorder, Method, Near, Advance], Solution]
"""Motion under a load history, as a recorder observes it, by the settings of a method."""


def _stepped(
    scheme: March,
    body: Body,
    damping: RayleighDamping,
    factor: Factor,
    recorder: Recorder,
    method: Method,
    near: Near,
    advance: Advance,
) -> Solution:
    """By equal steps in time; samples within a step are those of its cubic."""
    del near  # a step is solved by factors
    times = recorder.observation.times
    pace = method.pace(factor, times)
    step, count = pace.length(float(times[1] - times[0])), pace.steps(len(times) - 1)
    system = Oscillator(body.mass, body.stiffness, body.loads, damping)
    started = time.perf_counter()
    before: State | None = None
    for n, after in enumerate(scheme(system, factor, step, count)):
        if n % pace.per_sample == 0:
            _record(recorder, n // pace.per_sample * pace.samples, before, after, step, pace)
            advance(n / count)
        before = after
    return _solution(body, recorder, step, count, time.perf_counter() - started)


def _record(
    recorder: Recorder, last: int, before: State | None, after: State, step: float, pace: Pace
) -> None:
    """Keep a sample at the end of a step, and those within the step."""
    start = after if before is None else before
    ends = [_at_probes(recorder, state) for state in (start, after)]
    first = last if before is None else last - pace.samples + 1
    for sample in range(first, min(last + 1, len(recorder.observation.times))):
        share = 1.0 - (last - sample) / pace.samples
        recorder.motion(sample, *hermite(ends[0], ends[1], share, step))
        if sample in recorder.observation.frames:
            recorder.field(sample, hermite(start, after, share, step)[0])


def _at_probes(recorder: Recorder, state: State) -> State:
    u, v = (at_points(recorder.at_probes, x) for x in state)
    return u, v


def _superposed(
    choose: Choose,
    body: Body,
    damping: RayleighDamping,
    factor: Factor,
    recorder: Recorder,
    method: Method,
    near: Near,
    advance: Advance,
) -> Solution:
    """In a subspace; its strain also where a control point is farthest out."""
    started = time.perf_counter()
    pace = method.load_pace(factor, recorder.observation.times)
    excitation = excitation_of(damping, factor, recorder, pace)
    found = superposed(excitation, choose(body, excitation, method.modes, near, advance))
    wall = time.perf_counter() - started
    for sample in range(len(recorder.observation.times)):
        recorder.motion(sample, *(curve[sample] for curve in found.curves))
    for frame in set(recorder.observation.frames):
        recorder.field(frame, found.state(frame)[0])
    farthest = np.linalg.norm(found.curves.displacement, axis=2).max(axis=1).argmax()
    recorder.look(found.state(int(farthest))[0])
    seen = _solution(body, recorder, found.time_step, found.steps, wall)
    return replace(seen, superposed=found)


STEPPING: dict[str, March] = {"tr-bdf2": march, "hht-alpha": hht}
METHODS: dict[str, MotionMethod] = {
    "ritz-vectors": partial(_superposed, enough_ritz_vectors),
    "modal": partial(_superposed, enough_modes),
    **{name: partial(_stepped, scheme) for name, scheme in STEPPING.items()},
}


def build(
    mesh: TetrahedralMesh,
    tissue: Tissue,
    foundation: Support,
    tool: ToolPatch,
    element: str = AUTO,
    project: Projection | None = None,
    method: str = DEFAULT,
    loaded: Loaded | None = None,
) -> Body:
    """Discretised body. ValueError, before anything is assembled, if memory does not hold it.

    `loaded`: what `refuse` gave of the same, if it was asked.
    """
    if loaded is None:
        refuse_too_large(mesh, tissue, element, stepping=method in STEPPING)
    return discretise(mesh, tissue, foundation, tool, element, project, loaded)


def refuse(
    mesh: TetrahedralMesh,
    tissue: Tissue,
    foundation: Support,
    tool: ToolPatch,
    element: str = AUTO,
    project: Projection | None = None,
    method: str = DEFAULT,
) -> Loaded:
    """ValueError for all that `build` refuses, without what takes most time in it.

    The surface that is held and loaded, of which a body is made sooner.
    """
    refuse_too_large(mesh, tissue, element, stepping=method in STEPPING)
    return loaded_surface(mesh, tissue, foundation, tool, element, project)


def run(
    body: Body,
    damping: RayleighDamping,
    factor: Factor,
    observation: Observation,
    method: Method = Method(),
    on_progress: Advance = lambda _: None,
    near: Near = None,
) -> Solution:
    """Motion from rest under `factor` of the body's load, or of each of its loads.

    `near` (n, k): vectors near those of its superposition, as those on a coarser mesh, by which
    they are found sooner. ValueError for an unknown method.
    """
    if method.name not in METHODS:
        raise ValueError(f"reference.method: {method.name} is not one of {', '.join(METHODS)}")
    start = start_of(body)
    recorded = (Recorder(body, observation, start), method, near, on_progress)
    found = METHODS[method.name](body, damping, factor, *recorded)
    return replace(found, start=start, moving=_moving(found.superposed, recorded[0].start))


def _moving(superposed: Superposed | None, start: Floats) -> Callable[[int], State] | None:
    if superposed is None:
        return None

    def moving(sample: int) -> State:
        u, v = superposed.state(sample)
        return start + u, v

    return moving


def start_of(body: Body) -> Floats | None:
    """Displacement [m] (n,) at rest under what acts at all times; None where nothing does."""
    return None if body.dead is None else solver(body)(body.dead)


def static_field(body: Body, points: Floats) -> Floats:
    """Displacement [m] (q, 3) at points under the full load at rest."""
    return at_points(evaluation(body, points), solve_static(body))


def _solution(body: Body, recorder: Recorder, step: float, steps: int, wall: float) -> Solution:
    sizes = body.node_count, len(body.mesh.tetrahedra), body.element
    seen = recorder.strain, recorder.rotation
    return Solution(recorder.trajectory, *sizes, step, steps, wall, *seen)
