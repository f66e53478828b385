"""Finite elements at large strain: a neo-Hookean organ in motion under moved tools and loads."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from fem_reference import model as fem
from fem_reference.contact import large_motion
from fem_reference.contact.large_motion import (
    ContactProblem,
    Integrator,
    LargeSolution,
    linear_rest,
)
from fem_reference.contact.outcome import ContactOutcome
from fem_reference.elasticity import Body, without_fixed
from fem_reference.memory import refuse_too_large
from fem_reference.observation import at_points, evaluation
from msm.timestep import whole_steps
from study.models.damping import reference_damping
from study.models.elements_record import mesh_levels, model_record
from study.models.errors import (
    mean_velocity_error,
    step_checks,
    time_step_errors,
    tool_force_errors,
)
from study.models.finite_elements import (
    FRAME_RATE,
    SUPPORTED_FEATURES,
    FiniteElements,
    PreparedElements,
)
from study.models.in_contact import contact_record, rest_in_contact
from study.models.mesh_error import MeshSolution, mesh_error
from study.models.model import Estimates, ModelKind, ModelRun, Simulation, Stepper, Watch
from study.models.persistence import write_motion
from study.organ.geometry import Level
from study.organ.grading import resolved
from study.problem.problem import Problem
from study.problem.rigid import PLATE, RigidTool
from study.problem.trajectory import Observation, Trajectory
from study.results.fields import Mesh
from study.results.records import CurveErrors, ElementsRecord, ModelRecord
from study.scene import Reference, Scene
from study.system.progress import Progress

Floats = NDArray[np.float64]

ELEMENT, LAW, METHOD = "taylor-hood", "neo-hookean", "sdirk2"
COARSER = (-2, 0)
"""Meshes below and of the model's own level, whose difference shows the error of the finer."""
FEWEST = 5
"""Samples of a motion of which every other one shows the error by steps."""
BELOW = 3
"""Levels by which the mesh that is refined under the tools is coarser than that of the organ."""
UNDER, GROWING = 0.7, 0.7
"""Longest edge under a tool over its radius, and by how much edges grow with the distance."""
WITHIN = 0.5
"""Distance from a tool at which edges begin to grow, over its radius."""
RATIO = 0.75
"""Size of elements over that of the next coarser level."""
OWN_STEPS = 100
"""Least number of steps of a motion, where the scene gives none."""
OVERLOOKED = 0.02
"""Depth, over the travel, at which a note says that a tool is inside tissue beyond its contact."""


@dataclass(frozen=True, kw_only=True)
class HyperelasticElements:
    """Neo-Hookean elements as the scene's table `reference` has their size and steps.

    `level`: mesh of the organ, 0 that of the scene, larger is finer; `rate`: steps per second [Hz]
    of simulations, None for the model's own.
    """

    reference: Reference
    linear: FiniteElements
    level: int = 0
    rate: float | None = None
    name: str = "hyperelastic"
    label: str = "Finite elements, neo-Hookean"

    def varied(self, **settings: Any) -> Self:
        """With another level or rate, or other keys of the scene's table `reference`."""
        own = {key: settings.pop(key) for key in ("level", "rate") if key in settings}
        return replace(self, reference=replace(self.reference, **settings), **own)

    def prepare(self, problem: Problem) -> PreparedHyperelastic:
        """Set up; a body is assembled when it is needed, mesh by mesh."""
        return PreparedHyperelastic(self, problem)


@dataclass(eq=False)
class PreparedHyperelastic:
    """Elements of a problem; after a run, `best` is what was solved on its finest mesh."""

    model: HyperelasticElements
    problem: Problem
    best: MeshSolution | None = field(default=None, init=False)

    @property
    def critical_time_step(self) -> float:
        """Critical time step [s]: infinite, since the steps are implicit."""
        return float("inf")

    def describe(self) -> list[str]:
        """Size of the mesh."""
        count = len(self.level().mesh.tetrahedra)
        return [f"{self.model.name}: {count} tetrahedra, small under the tools"]

    def refuse(self) -> None:
        """ValueError for damping that it does not have, or a mesh that exceeds the memory."""
        problem, level = self.problem, self.level()
        large_motion.refuse(self.model.linear.damping, problem.tissue)
        refuse_too_large(level.mesh, problem.tissue, ELEMENT, stepping=True)
        self._linear.refuse()

    @cached_property
    def _linear(self) -> PreparedElements:
        """The linear elements, whose nodes, mass, supports and loads are those of the body."""
        return self.model.linear.prepare(self.problem)

    def level(self, below: int = 0) -> Level:
        """The mesh of the model's level, or of one as much coarser."""
        number, geometry = self.model.level + below, self.problem.geometry
        wanted = range(number - BELOW, 1)
        found = next(filter(None, map(geometry.level, wanted)))
        fine = partial(_wanted, self.problem, RATIO**number)
        return resolved(geometry, found, fine) or found

    def body(self, level: Level) -> Body:
        """The body on a mesh. ValueError if it is not held or touched."""
        return self._linear.body(level)

    def contact_problem(self, body: Body) -> ContactProblem:
        """The contact problem of a body with the tools and loads of the problem."""
        problem, borne = self.problem, None
        if problem.given_loaded and problem.gravity.any():
            gravity = np.tile(problem.gravity, body.node_count)
            borne = without_fixed(body.nodal_mass * gravity, body.fixed)
        times = problem.observation.times
        given = (problem.tissue, problem.rigid_tools, self.model.linear.damping)
        return large_motion.contact_problem(body, *given, problem.factors, times, borne)

    def simulate(self, longest: float | None = None) -> Simulation:
        """The motion on the model's own mesh, by its own steps, those of its rate or equal ones."""
        times = self.problem.observation.times
        every = self._per_sample
        longest = 1.0 / self.model.rate if longest is None and self.model.rate else longest
        if longest is not None:
            every = whole_steps(float(times[1] - times[0]), longest)
        body = self.body(self.level())
        found = large_motion.run(body, self.contact_problem(body), self.problem.observation, every)
        return Simulation(found.trajectory, found.step, largest_strain=found.largest_strain)

    @property
    def time_step(self) -> float:
        """Length of the model's own steps [s], which are halved where no balance is found."""
        return float(self.problem.observation.times[1]) / self._per_sample

    @property
    def _per_sample(self) -> int:
        asked = self.model.reference.steps_per_sample
        return asked or -(-OWN_STEPS // (len(self.problem.observation.times) - 1))

    def rest(self) -> Floats:
        """Displacement [m] (q, 3) at rest at the points of the volume field, linearised."""
        problem, body = self.problem, self.body(self.level())
        tools = bool(problem.rigid_tools)
        u = rest_in_contact(problem, body) if tools else linear_rest(body, problem.tissue)
        return at_points(evaluation(body, problem.observation.volume_points), u)

    def stepper(self) -> Stepper:
        """Steps at the rate, each to an equilibrium."""
        body, step = self.body(self.level()), 1.0 / (self.model.rate or FRAME_RATE)
        contact = self.contact_problem(body)
        steps = Integrator(contact)
        states = steps.march(steps.start(), step)
        now = [next(states)]

        def take_step() -> None:
            now[0] = next(states)

        def displacement() -> Floats:
            return contact.body.given(now[0].w).reshape(-1, 3)

        return Stepper(take_step, displacement, step, len(contact.body.free))

    def run(self, watch: Watch) -> ModelRun:
        """The motion on two meshes, on the coarser also by steps twice as long."""
        name, progress = self.model.name, watch.progress
        solved: list[MeshSolution] = []
        for below in COARSER:
            level = self.level(below)
            body = self.body(level)
            contact = self.contact_problem(body)
            found = self._moved(body, contact, self.problem.observation, progress)
            if not solved:
                errors, force_steps, mean = self._by_steps(
                    body, contact, found.trajectory, progress
                )
            solved = [*(one.outlined for one in solved), self._solution(level, body, found)]
        self.best = solved[-1]
        record = self._record(solved, errors, force_steps)
        checks = tuple(step_checks(name, errors, mean)) if errors else ()
        self._keep_fields(body, contact, found, watch)
        return ModelRun(found.trajectory, record, checks, tuple(self._of_overlooked(found)))

    def _moved(
        self, body: Body, contact: ContactProblem, seen: Observation, progress: Progress
    ) -> LargeSolution:
        text = f"{self.model.name}: {len(body.mesh.tetrahedra)} tetrahedra"
        doubled = seen is not self.problem.observation
        with progress.stage(text + (", doubled steps" if doubled else "")) as advance:
            return large_motion.run(body, contact, seen, self._per_sample, advance)

    def _by_steps(
        self, body: Body, contact: ContactProblem, found: Trajectory, progress: Progress
    ) -> tuple[dict[str, CurveErrors], Floats, float | None]:
        """Errors of curves, tools' forces (tools,) and mean velocity by the steps.

        None if it diverged. By how much steps twice as long change them, as if that were of first
        order: where contact begins and ends, the order of the steps is not seen.
        """
        seen, problem = self.problem.observation, self.problem
        if found.status != "finished" or len(seen.times) < FEWEST:
            return {}, np.zeros(0), None
        thinned = replace(seen, times=seen.times[::2], frames=(0,))
        other = self._moved(body, contact, thinned, progress).trajectory
        if other.status != "finished":
            return {}, np.zeros(0), None
        own = replace(
            found,
            displacement=found.displacement[::2],
            velocity=found.velocity[::2],
            tool_force=found.tool_force[::2],
        )
        names = tuple(one.name for one in problem.rigid_tools)
        errors = {
            probe: CurveErrors(displacement=0.5 * one.displacement, velocity=0.5 * one.velocity)
            for probe, one in time_step_errors(1, problem.probes, other, own).items()
        }
        of_forces = tool_force_errors(1, names, other, own)
        forces = np.array([0.5 * of_forces[name] for name in names])
        mean = mean_velocity_error(1, problem, other, own)
        return errors, forces, None if mean is None else 0.5 * mean

    def _solution(self, level: Level, body: Body, found: LargeSolution) -> MeshSolution:
        sizes = body.node_count, len(body.mesh.tetrahedra), body.element
        contact = None
        if self.problem.rigid_tools:
            nothing = np.zeros(0)
            contact = ContactOutcome(
                found.vertices, None, None, nothing, found.penetration, nothing, nothing
            )
        seen = fem.Solution(
            found.trajectory,
            *sizes,
            found.step,
            found.steps,
            found.wall,
            found.largest_strain,
            0.0,
            contact=contact,
        )
        return MeshSolution(level, body, seen)

    def _record(
        self, solved: list[MeshSolution], errors: dict[str, CurveErrors], force_steps: Floats
    ) -> ModelRecord:
        best, model = solved[-1], self.model
        elements = ElementsRecord(
            element=ELEMENT,
            elements=best.found.elements,
            unknowns=best.body.unknowns,
            method=METHOD,
            levels=mesh_levels(solved),
            mesh_error=mesh_error(self.problem, solved, graded=True),
            contact=contact_record(self.problem, solved, force_steps, graded=True),
            law=LAW,
        )
        damping = model.linear.damping
        return model_record(model.name, model.label, self.problem, damping, best, errors, elements)

    def _keep_fields(
        self, body: Body, contact: ContactProblem, found: LargeSolution, watch: Watch
    ) -> None:
        """Write the motion of the vertices if requested."""
        mesh, times = body.mesh, self.problem.observation.times
        states = (
            [x.reshape(-1, 3)[: len(mesh.points)] for x in (contact.body.given(state.w), state.v)]
            for state in found.states
        )
        shown = Mesh(mesh.points, mesh.tetrahedra)
        write_motion(watch.persistence, self.model.name, shown, times, states)

    def _of_overlooked(self, found: LargeSolution) -> Iterator[str]:
        """A note where a tool is inside tissue with which contact was not considered."""
        times, tools = self.problem.observation.times, self.problem.rigid_tools
        travel = max(
            (float(np.linalg.norm(one.travel(times), axis=1).max()) for one in tools), default=0.0
        )
        if found.overlooked > OVERLOOKED * travel:
            yield (
                f"In {self.model.name} {1e3 * found.overlooked:.2g} mm of a tool are inside the "
                "organ where contact is not considered, apart from what it would touch of the "
                "undeformed surface."
            )


def _wanted(problem: Problem, share: float, centres: Floats, longest: Floats) -> Floats:
    """Longest edge [m] (n,) of tetrahedra that have such centres (n, 3) and longest edges (n,).

    A `share` of what the level 0 has: fine under the tools on their way, and coarser away from it.
    """
    found = np.full(len(centres), np.inf)
    places = [
        (tip, one.radius)
        for one in problem.rigid_tools
        if one.shape != PLATE
        for tip in _along_surface(one, problem.observation.times)
    ]
    patches = [load.tool for load in problem.loads]
    patches += [problem.tool] if problem.tool.force else []
    places += [(patch.centre, patch.radius) for patch in patches]
    for tip, radius in places:
        away = np.linalg.norm(centres - tip, axis=1) - 0.5 * longest
        edge = UNDER * radius + GROWING * np.maximum(away - WITHIN * radius, 0.0)
        found = np.minimum(found, share * edge)
    return found


def _along_surface(tool: RigidTool, times: Floats) -> list[Floats]:
    """Places [m] of a tool's tip where it starts and moves aside, half a radius apart or more."""
    travel = tool.travel(times)
    places = tool.tip + travel - np.outer(travel @ tool.axis, tool.axis)
    found = [tool.tip]
    for spot in places:
        if min(np.linalg.norm(spot - other) for other in found) >= WITHIN * tool.radius:
            found.append(spot)
    return found


def models(scene: Scene, _: Estimates) -> Iterator[HyperelasticElements]:
    """The one hyperelastic reference."""
    reference = replace(
        scene.reference, element=ELEMENT, method=fem.DEFAULT, large_strain="none", accuracy=None
    )
    linear = FiniteElements(reference=reference, damping=reference_damping(scene))
    yield HyperelasticElements(reference=scene.reference, linear=linear)


def assumptions(scene: Scene) -> list[str]:
    """On its law, its damping, and on what its errors are."""
    del scene
    return [
        "The hyperelastic reference has the compressible neo-Hookean law of the tissue, damping "
        "by mass, and dead loads; its error by the mesh is estimated from one coarser mesh."
    ]


KIND = ModelKind(
    models=models, assumptions=assumptions, is_reference=True, supported_features=SUPPORTED_FEATURES
)
