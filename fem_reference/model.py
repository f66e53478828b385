"""The reference as a model of the study: a body under the tool, from rest."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fem_reference.contact.outcome import ContactOutcome
from fem_reference.dynamics import March, Oscillator, State, hermite, hht, march
from fem_reference.elasticity import Body, Loaded, discretise, loaded_surface
from fem_reference.elements import AUTO
from fem_reference.grid import Projection
from fem_reference.memory import refuse_too_large
from fem_reference.observation import at_points, evaluation
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
from fem_reference.time_steps import TimeSteps, steps_for_load
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
    """Solution method of the motion: a name of `METHODS`, steps per sample, modes of `modal`.

    Without `steps_per_sample`, the load history determines the steps (`fem_reference.time_steps`).
    Either number is multiplied by `times`, a power of two.
    """

    name: str = DEFAULT
    steps_per_sample: int | None = None
    modes: int = 100
    times: int = 1

    def time_steps(self, factor: Factor, sampled: Floats) -> TimeSteps:
        """Time steps of a motion under a load history, sampled at these times [s]."""
        if self.steps_per_sample is not None:
            return TimeSteps(self.steps_per_sample * self.times)
        return steps_for_load(factor, sampled, self._parts).refined(self.times)

    def load_steps(self, factor: Factor, sampled: Floats) -> TimeSteps:
        """Steps over which the load of a superposition is linear."""
        return self.time_steps(factor, sampled).refined(LOAD_STEPS)

    @property
    def _parts(self) -> int:
        return 1 if self.name in STEPPING else LOAD_STEPS


@dataclass(frozen=True)
class Solution:
    """Trajectory of a run with its cost; `wall` [s] of the solution, without assembly.

    `time_step` [s] and `steps`: for a superposition those of the load. `superposed`: the subspace
    and modal motion of a superposition, None for direct time integration. `largest_strain`: largest
    absolute principal strain in the recorded frames, of a superposition also where a control point
    is farthest out; `largest_rotation` [rad] likewise. Linear elasticity is valid up to a few per
    cent of either. `start` [m] (n,): equilibrium under the dead load, None without one. `moving`:
    displacement [m] from the given shape and velocity [m/s] (n,) of all unknowns at a sample, None
    for direct time integration. `contact`: outcome with tools of prescribed motion.
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
        """Change of the curves by the last quarter of a subspace; None for direct integration."""
        if self.contact is not None:
            return self.contact.truncation
        return None if self.superposed is None else self.superposed.truncation

    @property
    def vectors(self) -> int | None:
        """Dimension of the subspace; None for direct integration."""
        if self.contact is not None:
            return self.contact.vectors
        return None if self.superposed is None else self.superposed.subspace.load.size

    def rest(self, body: Body) -> Floats:
        """Static displacement [m] (n,) under all loads in full."""
        if self.contact is not None:
            return self.contact.at_rest
        if self.superposed is None:
            return solve_static(body)
        moved = self.superposed.subspace.rest(body.full)
        return moved if self.start is None else moved + self.start


class MotionTask(NamedTuple):
    """A motion under a load history, as a recorder observes it, by the settings of a method.

    `near`: approximations of the vectors of a superposition, see `run`.
    """

    body: Body
    damping: RayleighDamping
    factor: Factor
    recorder: Recorder
    method: Method
    near: Near
    advance: Advance


MotionMethod = Callable[[MotionTask], Solution]


def _stepped(scheme: March, task: MotionTask) -> Solution:
    """Direct time integration; samples within a step come from its cubic interpolant."""
    body, recorder = task.body, task.recorder
    times = recorder.observation.times
    steps = task.method.time_steps(task.factor, times)
    step, count = steps.step(float(times[1] - times[0])), steps.count(len(times) - 1)
    system = Oscillator(body.mass, body.stiffness, body.loads, task.damping)
    started = time.perf_counter()
    before: State | None = None
    for n, after in enumerate(scheme(system, task.factor, step, count)):
        if n % steps.per_sample == 0:
            _record(recorder, n // steps.per_sample * steps.samples, before, after, step, steps)
            task.advance(n / count)
        before = after
    return _solution(body, recorder, step, count, time.perf_counter() - started)


def _record(
    recorder: Recorder,
    last: int,
    before: State | None,
    after: State,
    step: float,
    steps: TimeSteps,
) -> None:
    """Record the sample at the end of a step and those within it."""
    start = after if before is None else before
    ends = [_at_probes(recorder, state) for state in (start, after)]
    first = last if before is None else last - steps.samples + 1
    for sample in range(first, min(last + 1, len(recorder.observation.times))):
        share = 1.0 - (last - sample) / steps.samples
        recorder.motion(sample, *hermite(ends[0], ends[1], share, step))
        if sample in recorder.observation.frames:
            recorder.field(sample, hermite(start, after, share, step)[0])


def _at_probes(recorder: Recorder, state: State) -> State:
    u, v = (at_points(recorder.at_probes, x) for x in state)
    return u, v


def _superposed(choose: Choose, task: MotionTask) -> Solution:
    """Superposition in a subspace; strain also where a control point is farthest out."""
    started = time.perf_counter()
    body, recorder = task.body, task.recorder
    steps = task.method.load_steps(task.factor, recorder.observation.times)
    excitation = excitation_of(task.damping, task.factor, recorder, steps)
    chosen = choose(body, excitation, task.method.modes, task.near, task.advance)
    found = superposed(excitation, chosen)
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
    """The discretised body. ValueError, before any assembly, if it does not fit into memory.

    `loaded`: result of `refuse` for the same arguments, if known.
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
    """Raise the ValueError of `build`, if any, without its expensive assembly.

    Returns the supported and loaded surface, which `build` reuses.
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
    """Motion from rest under the body's loads times their `factor` of the time [s].

    `near` (n, k): approximations of the vectors of the superposition, such as those of a coarser
    mesh, which reduce the iterations. ValueError for an unknown method.
    """
    if method.name not in METHODS:
        raise ValueError(f"reference.method: {method.name} is not one of {', '.join(METHODS)}")
    start = start_of(body)
    recorder = Recorder(body, observation, start)
    found = METHODS[method.name](
        MotionTask(body, damping, factor, recorder, method, near, on_progress)
    )
    return replace(found, start=start, moving=_moving(found.superposed, recorder.start))


def _moving(superposed: Superposed | None, start: Floats) -> Callable[[int], State] | None:
    if superposed is None:
        return None

    def moving(sample: int) -> State:
        u, v = superposed.state(sample)
        return start + u, v

    return moving


def start_of(body: Body) -> Floats | None:
    """Static displacement [m] (n,) under the dead load; None without one."""
    return None if body.dead is None else solver(body)(body.dead)


def static_field(body: Body, points: Floats) -> Floats:
    """Static displacement [m] (q, 3) at points [m] (q, 3) under the full load."""
    return at_points(evaluation(body, points), solve_static(body))


def _solution(body: Body, recorder: Recorder, step: float, steps: int, wall: float) -> Solution:
    sizes = body.node_count, len(body.mesh.tetrahedra), body.element
    seen = recorder.strain, recorder.rotation
    return Solution(recorder.trajectory, *sizes, step, steps, wall, *seen)
