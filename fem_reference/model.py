"""The reference as a model of the study: a body under the tool, from rest."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fem_reference.dynamics import Damping, March, Oscillator, hht, march
from fem_reference.elasticity import Body, discretise
from fem_reference.grid import Projection
from fem_reference.memory import refuse_too_large
from fem_reference.observation import at_points, evaluation
from fem_reference.recording import Recorder
from fem_reference.solvers import solve_static
from fem_reference.superposition import Superposed, superposed
from study.mesh.kinds import TetrahedralMesh
from study.problem.contact import Foundation, ToolPatch
from study.problem.tissue import Tissue
from study.problem.trajectory import Observation, Trajectory

Floats = NDArray[np.float64]
Factor = Callable[[Floats], Floats]
Advance = Callable[[float], None]

STEPPING: dict[str, March] = {"tr-bdf2": march, "hht-alpha": hht}
METHODS = ("ritz-vectors", "modal", *STEPPING)


@dataclass(frozen=True)
class Method:
    """How the motion is found: a name of `METHODS`, steps per sample, modes of `modal`."""

    name: str = "ritz-vectors"
    steps_per_sample: int = 1
    modes: int = 100


@dataclass(frozen=True)
class Reference:
    """Trajectory with what it took; `wall` [s] has the solution in it, not the assembly.

    `time_step` [s] and `steps`: for a superposition those of the load. `superposed`: how a
    superposition was made, and the motion of all nodes; none of steps in time. `largest_strain`:
    largest absolute principal strain in the kept frames, of a superposition also where a control
    point is farthest out, and `largest_rotation` [rad] likewise; linear elasticity is good for a
    few per cent of either.
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

    def rest(self, body: Body) -> Floats:
        """Displacement [m] (n,) of the body at rest under the full load."""
        return solve_static(body) if self.superposed is None else self.superposed.subspace.rest()


def build(
    mesh: TetrahedralMesh,
    tissue: Tissue,
    foundation: Foundation,
    tool: ToolPatch,
    element: str = "auto",
    project: Projection | None = None,
    method: str = METHODS[0],
) -> Body:
    """Discretised body. ValueError, before anything is assembled, if memory does not hold it."""
    refuse_too_large(mesh, tissue, element, stepping=method in STEPPING)
    return discretise(mesh, tissue, foundation, tool, element, project)


def run(
    body: Body,
    damping: Damping,
    factor: Factor,
    observation: Observation,
    method: Method = Method(),
    on_progress: Advance = lambda _: None,
) -> Reference:
    """Motion from rest."""
    if method.name not in METHODS:
        raise ValueError(f"reference.method: {method.name} is not one of {', '.join(METHODS)}")
    recorder = Recorder(body, observation)
    if method.name in STEPPING:
        return _stepped(body, damping, factor, recorder, method, on_progress)
    return _superposed(body, damping, factor, recorder, method, on_progress)


def static_field(body: Body, points: Floats) -> Floats:
    """Displacement [m] (q, 3) at points under the full load at rest."""
    return at_points(evaluation(body, points), solve_static(body))


def _stepped(
    body: Body,
    damping: Damping,
    factor: Factor,
    recorder: Recorder,
    method: Method,
    advance: Advance,
) -> Reference:
    times, every = recorder.observation.times, method.steps_per_sample
    step, count = float(times[1] - times[0]) / every, (len(times) - 1) * every
    system = Oscillator(body.mass, body.stiffness, body.load, damping)
    started, seen = time.perf_counter(), recorder.at_probes
    for n, (u, v) in enumerate(STEPPING[method.name](system, factor, step, count)):
        if n % every == 0:
            recorder.motion(n // every, at_points(seen, u), at_points(seen, v))
            recorder.field(n // every, u)
            advance(n / count)
    return _reference(body, recorder, step, count, time.perf_counter() - started)


def _superposed(
    body: Body,
    damping: Damping,
    factor: Factor,
    recorder: Recorder,
    method: Method,
    advance: Advance,
) -> Reference:
    modes = method.modes if method.name == "modal" else None
    started = time.perf_counter()
    found = superposed(body, damping, factor, recorder, method.steps_per_sample, modes, advance)
    wall = time.perf_counter() - started
    for sample in range(len(recorder.observation.times)):
        recorder.motion(sample, *(curve[sample] for curve in found.curves))
    for frame in set(recorder.observation.frames):
        recorder.field(frame, found.state(frame)[0])
    farthest = np.linalg.norm(found.curves.displacement, axis=2).max(axis=1).argmax()
    recorder.look(found.state(int(farthest))[0])
    seen = _reference(body, recorder, found.time_step, found.steps, wall)
    return replace(seen, superposed=found)


def _reference(body: Body, recorder: Recorder, step: float, steps: int, wall: float) -> Reference:
    sizes = body.node_count, len(body.mesh.tetrahedra), body.element
    seen = recorder.strain, recorder.rotation
    return Reference(recorder.trajectory, *sizes, step, steps, wall, *seen)
