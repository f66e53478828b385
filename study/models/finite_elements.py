"""The finite-element reference: linear elasticity on several meshes that show its error."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from fem_reference import model as fem
from fem_reference.contact.motion import run as in_contact
from fem_reference.dynamics import ORDER, Oscillator, SteppedMotion
from fem_reference.elasticity import Body, Loaded, bare, of_tissue
from fem_reference.external_loads import external_loads, with_external_loads
from fem_reference.grid import Projection
from fem_reference.memory import refuse_too_large
from fem_reference.observation import at_points, evaluation
from fem_reference.solvers import solve_static
from fem_reference.time_steps import TimeSteps
from msm.timestep import whole_steps
from study.models.damping import reference_damping
from study.models.elements_record import mesh_levels, model_record
from study.models.errors import (
    DISPLACEMENT_LIMIT,
    VELOCITY_LIMIT,
    mean_velocity_error,
    step_checks,
    time_step_errors,
)
from study.models.grading import GROWTHS, growth_for, is_graded, next_graded, next_graded_by
from study.models.in_contact import contact_record, force_step_errors, resolving, rest_in_contact
from study.models.large_strain import compare
from study.models.linear_limits import is_large
from study.models.mesh_error import (
    MeshSolution,
    is_too_coarse,
    locks,
    mesh_error,
    next_size,
    why_unknown,
)
from study.models.model import Estimates, ModelKind, ModelRun, Simulation, Stepper, Watch
from study.models.persistence import write_motion
from study.organ.geometry import Level
from study.problem.contact import ToolPatch
from study.problem.damping import RayleighDamping
from study.problem.problem import Problem
from study.problem.supports import Support
from study.problem.tissue import Tissue
from study.results.fields import Mesh
from study.results.records import (
    Check,
    CurveErrors,
    DiscretisationError,
    ElementsRecord,
    LargeStrain,
)
from study.scene import Reference, Scene
from study.system.progress import Progress

Floats = NDArray[np.float64]

COARSER = 2
"""Number of meshes coarser than the scene's: three in all show the order of convergence."""
GRADED = 3
"""Least number of graded meshes, for the same reason."""
MOST_HALVED = 2
"""Largest factor on the number of the model's own steps for contact forces."""
FINER = 12
"""Largest number of levels above the scene's that an accuracy may require, memory permitting."""
FRAME_RATE = 60.0
"""Steps per second [Hz] of a model stepped by hand, where it has no rate."""


@dataclass(frozen=True, kw_only=True)
class FiniteElements:
    """Finite elements as specified by the scene's table `reference`.

    `level`: mesh of the organ used by `simulate`, 0 being the scene's, larger is finer; a run uses
    several. `rate`: steps per second [Hz] of `simulate`, None for those of the table.
    """

    reference: Reference
    damping: RayleighDamping
    level: int = 0
    rate: float | None = None
    name: str = "fem"
    label: str = "Finite elements"

    def varied(self, **settings: Any) -> Self:
        """The model with another level or rate, or other keys of the table `reference`."""
        own = {key: settings.pop(key) for key in ("level", "rate") if key in settings}
        return replace(self, reference=replace(self.reference, **settings), **own)

    def prepare(self, problem: Problem) -> PreparedElements:
        """Set up; a body is assembled when it is needed, mesh by mesh."""
        return PreparedElements(self, problem)

    def method(self, times: int = 1) -> fem.Method:
        """The method of the motion, with `times` as many steps as usual."""
        chosen = self.reference
        return fem.Method(chosen.method, chosen.steps_per_sample, chosen.modes, times)


def _has(level: Level, elements: int) -> bool:
    return len(level.mesh.tetrahedra) == elements


@dataclass(eq=False)
class PreparedElements:
    """Finite elements of a problem; after a run, `best` is the solution on its last mesh."""

    model: FiniteElements
    problem: Problem
    best: MeshSolution | None = field(default=None, init=False)
    _times: int = field(default=1, init=False)  # factor on the number of own steps
    _force_steps: Floats = field(default_factory=lambda: np.zeros(0), init=False)
    _mean_velocity: float | None = field(default=None, init=False)
    _looked_at: tuple[Level, Loaded] | None = field(default=None, init=False)

    @property
    def critical_time_step(self) -> float:
        """Critical time step [s]: infinite, since steps are implicit or exact in a subspace."""
        return float("inf")

    def describe(self) -> list[str]:
        """Size of the mesh."""
        tetrahedra = len(self.problem.geometry.mesh.tetrahedra)
        asked = self.model.reference.accuracy is not None
        finer = ", refined for reference.accuracy" if asked else ""
        return [f"finite-element mesh: {tetrahedra} tetrahedra{finer}"]

    def refuse(self) -> None:
        """Raise ValueError for a mesh that exceeds the memory, or misses support or tool."""
        self._refuse(self.own_level())

    def _refuse(self, level: Level) -> Loaded:
        return fem.refuse(level.mesh, *self._body_arguments(), self.model.reference.method)

    def _body_arguments(self) -> tuple[Tissue, Support, ToolPatch, str, Projection | None]:
        """What a body consists of beside its mesh."""
        problem, element = self.problem, self.model.reference.element
        geometry = problem.geometry
        return problem.tissue, problem.foundation, problem.tool, element, geometry.project

    def own_level(self) -> Level:
        """The level of the model. ValueError if the organ has no such level."""
        found = self.problem.geometry.level(self.model.level)
        if found is None:
            raise ValueError(
                f"level {self.model.level}: the organ has no such mesh; choose another level"
            )
        return found

    def body(self, level: Level | None = None) -> Body:
        """The body on a level, by default the model's. ValueError if there is no such level."""
        found, method = level or self.own_level(), self.model.reference.method
        loaded = self._looked_at[1] if self._looked_at and self._looked_at[0] is found else None
        self._looked_at = None  # releases its shape functions on the facets, which are large
        built = fem.build(found.mesh, *self._body_arguments(), method, loaded)
        return with_external_loads(built, external_loads(self.problem))

    def simulate(self, longest: float | None = None) -> Simulation:
        """The motion on one level, by the table's steps, those of the rate, or equal ones."""
        seen, method, rate = self.problem.observation, self.model.method(), self.model.rate
        longest = 1.0 / rate if longest is None and rate is not None else longest
        if longest is not None:
            every = whole_steps(float(seen.times[1] - seen.times[0]), longest)
            method = replace(method, steps_per_sample=every, times=1)
        found = self._motion(self.body(), method)
        return Simulation(found.trajectory, found.time_step)

    def rest(self) -> Floats:
        """Displacement [m] (q, 3) at rest at the points of the volume field.

        After a run, on the mesh of that run.
        """
        best, body = self.best, self._best_body()
        u = self._at_rest(body) if best is None else best.found.rest(body)
        return at_points(evaluation(body, self.problem.observation.volume_points), u)

    def rest_at(self, poisson_ratio: float) -> Floats:
        """Displacement [m] (q, 3) at rest as `rest`, at another Poisson ratio.

        After a run, on the mesh of that run, whose matrices are released: both sets together would
        exceed the memory of a run.
        """
        tissue = replace(self.problem.tissue, poisson_ratio=poisson_ratio)
        own, start = self._best_body(), None
        if self.best is not None:
            start, self.best = self.best.found.rest(own), self.best.outlined
        own = bare(own)
        body = of_tissue(own, tissue, self.model.reference.element)
        points = self.problem.observation.volume_points
        return at_points(evaluation(body, points), self._at_rest(body, start))

    def _at_rest(self, body: Body, start: Floats | None = None) -> Floats:
        """Displacement [m] (n,) at rest, iterated from a nearby `start`."""
        if self.problem.rigid_tools:
            return rest_in_contact(self.problem, body)
        return solve_static(body, start=start)

    def _best_body(self) -> Body:
        """The body of the last run, or of the model's level, with its matrices."""
        return self.body() if self.best is None else self._body_of(self.best)

    def _body_of(self, solved: MeshSolution) -> Body:
        """The body of a solution, with its matrices assembled again if necessary."""
        return solved.body if isinstance(solved.body, Body) else self.body(solved.level)

    def stepper(self) -> Stepper:
        """Steps of TR-BDF2 at the rate, with one factorisation, whatever the method of a run."""
        body, step = self.body(), 1.0 / (self.model.rate or FRAME_RATE)
        system = Oscillator(body.mass, body.stiffness, body.loads, self.model.damping)
        motion = SteppedMotion(
            system, self.problem.factors, step
        )  # solves the rest state and factorises

        sag = fem.start_of(body)

        def displacement() -> Floats:
            u = motion.displacement if sag is None else motion.displacement + sag
            return u.reshape(-1, 3)

        return Stepper(motion.take_step, displacement, step, body.stiffness.size)

    def run(self, watch: Watch) -> ModelRun:
        """The motion on the finest of the meshes that show its error."""
        coarsest, steps = self._solve_coarsest(watch.progress)
        solved, error = self._solve(coarsest, watch.progress)
        best = self.best = solved[-1]
        strained, note = self._at_large_strain(solved, watch.progress)
        model, elements = self.model, self._elements(solved, error, strained)
        record = model_record(
            model.name, model.label, self.problem, model.damping, best, steps, elements
        )
        checks = (*self._step_checks(steps), *_subspace_checks(best))
        notes = [self._keep_fields(best, watch), note]
        if error is None:
            why = why_unknown(self.problem, best)
            notes.append(f"The reference's discretisation error is not estimated: {why}.")
        return ModelRun(best.found.trajectory, record, checks, tuple(filter(None, notes)))

    def _solve_coarsest(self, progress: Progress) -> tuple[MeshSolution, dict[str, CurveErrors]]:
        """Solve on the coarsest mesh, where halving the steps is cheap; with the step error.

        The model's own steps that span several samples are halved until the error is small enough.
        """
        coarsest = self.solved_on(self.coarsest, progress)
        while True:
            half = self._halved(coarsest, progress)
            whole = coarsest.found.trajectory
            errors = time_step_errors(ORDER, self.problem.probes, whole, half.trajectory)
            self._mean_velocity = mean_velocity_error(ORDER, self.problem, whole, half.trajectory)
            missed = not all(check.passed for check in self._step_checks(errors))
            self._force_steps = force_step_errors(whole, half.trajectory)
            missed = missed or bool((self._force_steps > DISPLACEMENT_LIMIT).any())
            if not (missed and self._may_halve()):
                return coarsest, errors
            self._times *= 2
            coarsest = replace(coarsest, found=half)

    def _step_checks(self, errors: dict[str, CurveErrors]) -> Iterator[Check]:
        return step_checks(self.model.name, errors, self._mean_velocity)

    def _may_halve(self) -> bool:
        """Whether the steps are the model's own, and could be shorter."""
        if self.problem.rigid_tools:
            own = self.model.reference.steps_per_sample is None
            return own and self._times < MOST_HALVED
        return self._pace().samples > 1

    def _pace(self) -> TimeSteps:
        problem = self.problem
        return self.model.method(self._times).time_steps(problem.factors, problem.observation.times)

    def _solve(
        self, coarsest: MeshSolution, progress: Progress
    ) -> tuple[list[MeshSolution], DiscretisationError | None]:
        """Solve on meshes that show the error, until it is small enough."""
        return (self._solve_graded if self._graded else self._solve_uniform)(coarsest, progress)

    @property
    def _graded(self) -> bool:
        return is_graded(self.model.reference, self.problem)

    def _solve_graded(
        self, coarsest: MeshSolution, progress: Progress
    ) -> tuple[list[MeshSolution], DiscretisationError | None]:
        """Solve on meshes refined where the error originates, up to the scene's size or beyond."""
        asked, solved = self.model.reference.accuracy, [coarsest]
        error: DiscretisationError | None = None
        while (
            len(solved) < GRADED
            or solved[-1].found.elements < self._fewest
            or (is_too_coarse(asked, error) and not locks(self.problem, solved[-1]))
        ):
            growth = growth_for(self._excess(asked, error, solved[-1].found.elements))
            with progress.stage(f"{self.model.name}: where the error is"):
                finer = self.refined(solved[-1].level, self._body_of(solved[-1]), growth)
            if finer is None:
                break
            self._refine(solved, finer, progress)
            error = mesh_error(self.problem, solved, graded=True)
        return solved, error

    def _excess(
        self, asked: float | None, error: DiscretisationError | None, elements: int
    ) -> float:
        """Elements expected to be needed over those of the last mesh; infinite if unknown."""
        if error is None or asked is None or elements < self._fewest:
            return np.inf
        return error.worst.displacement / asked

    @property
    def _fewest(self) -> int:
        """Elements of the scene's mesh, the least number on the last graded mesh."""
        return len(self.problem.geometry.mesh.tetrahedra)

    def refined(self, level: Level, body: Body, growth: float = GROWTHS[-1]) -> Level | None:
        """The next graded mesh, from the body on a level; None if it is too large."""
        found = next_graded(self.problem, level, body, growth)
        return None if found is None or self._exceeds_memory(found, body) else found

    def _exceeds_memory(self, level: Level, body: Body) -> bool:
        try:
            method = self.model.reference.method
            refuse_too_large(
                level.mesh, self.problem.tissue, body.element, stepping=method in fem.STEPPING
            )
        except ValueError:
            return True
        return False

    def level_of(self, counts: Sequence[int], progress: Progress) -> Level | None:
        """The last of the meshes with these numbers of elements; None if there is none.

        `counts`: of all meshes of a run, coarse to fine. No motion is solved.
        """
        if not self._graded:
            levels = filter(None, map(self.problem.geometry.level, range(FINER + 1)))
            return next((one for one in levels if _has(one, counts[-1])), None)
        level = self.coarsest
        if not _has(level, counts[0]):
            return None
        for count in counts[1:]:
            with progress.stage(f"{self.model.name}: where the error is"):
                finer = next_graded_by(self.problem, level, self.body(level), GROWTHS[::-1])
                found = next((one for one in finer if one and _has(one, count)), None)
            if found is None:
                return None
            level = found
        return level

    @property
    def coarsest(self) -> Level:
        """The first mesh of a run."""
        found = next(self._usable(range(-COARSER, 0)), self._level_zero)
        return resolving(self.problem, found) if self._graded else found

    @property
    def _level_zero(self) -> Level:
        found = self.problem.geometry.level(0)
        assert found is not None  # noqa: S101 - an organ has one
        return found

    def _solve_uniform(
        self, coarsest: MeshSolution, progress: Progress
    ) -> tuple[list[MeshSolution], DiscretisationError | None]:
        """Solve on the scene's mesh and coarser ones, then on finer ones until accurate enough."""
        geometry, accuracy = self.problem.geometry, self.model.reference.accuracy
        levels = filter(None, (*self._usable(range(-COARSER, 0)), geometry.level(0)))
        solved = [coarsest]
        for level in [level for level in levels if level is not coarsest.level]:
            self._refine(solved, level, progress)
        error = mesh_error(self.problem, solved)
        while is_too_coarse(accuracy, error):
            finer = self._finer(solved[-1].level, next_size(accuracy, error))
            if finer is None:
                break
            self._refine(solved, finer, progress)
            error = mesh_error(self.problem, solved)
        return solved, error

    def _refine(self, solved: list[MeshSolution], level: Level, progress: Progress) -> None:
        """Solve on one more mesh, after releasing the matrices of the previous one."""
        solved[-1] = solved[-1].outlined
        solved.append(self.solved_on(level, progress, solved[-1]))

    def _finer(self, last: Level, share: float) -> Level | None:
        """The level expected to meet the accuracy, or the finest available if that is finer."""
        levels = filter(None, map(self.problem.geometry.level, range(1, FINER + 1)))
        finer = [level for level in levels if level.size < last.size]
        enough = [level for level in finer if level.size <= share * last.size]
        coarser = finer[: len(finer) - len(enough)]
        return next(filter(self._is_usable, (*enough, *reversed(coarser))), None)

    def _usable(self, numbers: range) -> Iterator[Level]:
        """Levels that exist and on which a body can be assembled."""
        levels = map(self.problem.geometry.level, numbers)
        return filter(self._is_usable, filter(None, levels))

    def _is_usable(self, level: Level) -> bool:
        try:
            self._looked_at = level, self._refuse(level)
        except ValueError:  # misses the tool, or exceeds the memory
            return False
        return True

    def solved_on(
        self, level: Level | None, progress: Progress, coarser: MeshSolution | None = None
    ) -> MeshSolution:
        """Body and motion on a mesh, None for the model's own; faster after a coarser one."""
        level = level or self.own_level()
        name = f"{self.model.name}: {len(level.mesh.tetrahedra)} tetrahedra"
        with progress.stage(f"{name}, assembly"):
            body = self.body(level)
        with progress.stage(name) as advance:
            near = None if coarser is None else coarser.near(body)
            found = self._motion(body, self.model.method(self._times), advance, near)
            return MeshSolution(level, body, found)

    def _motion(
        self,
        body: Body,
        method: fem.Method,
        advance: fem.Advance = lambda _: None,
        near: Floats | None = None,
    ) -> fem.Solution:
        """The motion of a body, in contact where tools are moved."""
        problem, damping = self.problem, self.model.damping
        given = (damping, problem.factors, problem.observation, method, advance)
        if problem.rigid_tools:
            return in_contact(body, problem.rigid_tools, *given)
        return fem.run(body, *given, near)

    def _halved(self, solved: MeshSolution, progress: Progress) -> fem.Solution:
        body = self._body_of(solved)
        with progress.stage(f"{self.model.name}: halved steps") as advance:
            return self._motion(body, self.model.method(2 * self._times), advance)

    def _at_large_strain(
        self, solved: Sequence[MeshSolution], progress: Progress
    ) -> tuple[LargeStrain | None, str]:
        """Linear and hyperelastic rest compared, where strains are large."""
        law, found = self.model.reference.large_strain, solved[-1].found
        if law == "none" or not is_large(found.largest_strain, found.largest_rotation):
            return None, ""
        if self.problem.rigid_tools:
            return None, f"No {law} solution is compared: tools are moved."
        count = len(self.problem.geometry.mesh.tetrahedra)
        own = min(solved, key=lambda one: abs(one.found.elements - count))
        with progress.stage(f"{self.model.name}: {law}"):
            compared = compare(self.problem, self._body_of(own), law)
        if isinstance(compared, str):
            return None, f"No {law} solution at the peak load: {compared}."
        return compared, ""

    def _keep_fields(self, best: MeshSolution, watch: Watch) -> str:
        """Write the motion of the vertices if requested; returns why that is impossible."""
        persistence = watch.persistence
        if persistence is None or persistence.fields is None:
            return ""
        moving, mesh = best.found.moving, best.level.mesh
        if moving is None:
            return "Fields of fem are kept of a superposition only, not of steps in time."
        times, vertices = self.problem.observation.times, len(mesh.points)
        states = (
            [x.reshape(-1, 3)[:vertices] for x in moving(sample)] for sample in range(len(times))
        )
        write_motion(
            persistence, self.model.name, Mesh(mesh.points, mesh.tetrahedra), times, states
        )
        return ""

    def _elements(
        self,
        solved: Sequence[MeshSolution],
        error: DiscretisationError | None,
        strained: LargeStrain | None,
    ) -> ElementsRecord:
        best, accuracy = solved[-1], self.model.reference.accuracy
        truncation = best.found.truncation
        missed = error is not None and is_too_coarse(accuracy, error)
        return ElementsRecord(
            element=best.found.element,
            elements=best.found.elements,
            unknowns=best.body.unknowns,
            method=self.model.reference.method,
            subspace_vectors=best.found.vectors,
            truncation_error=None if truncation is None else max(truncation),
            truncation=None if truncation is None else CurveErrors(**truncation._asdict()),
            largest_rotation_rad=best.found.largest_rotation,
            levels=mesh_levels(solved),
            mesh_error=error,
            accuracy_missed=accuracy if missed else None,
            large_strain=strained,
            contact=contact_record(self.problem, solved, self._force_steps, graded=self._graded),
        )


def _subspace_checks(solved: MeshSolution) -> Iterator[Check]:
    truncation = solved.found.truncation
    if truncation is None:
        return
    for kind, limit in (("displacement", DISPLACEMENT_LIMIT), ("velocity", VELOCITY_LIMIT)):
        yield Check(
            name=f"fem: {kind} by subspace",
            value=getattr(truncation, kind),
            limit=limit,
            meaning=f"largest relative L2 change of a {kind} curve by the subspace's last quarter",
        )


def reference_of(scene: Scene) -> FiniteElements:
    """The finite elements of a scene."""
    return FiniteElements(reference=scene.reference, damping=reference_damping(scene))


def models(scene: Scene, _: Estimates) -> Iterator[FiniteElements]:
    """The finite elements of a scene, one model."""
    yield reference_of(scene)


def assumptions(scene: Scene) -> list[str]:
    """On strain and damping, and on the scope of a comparison with the reference."""
    damping = (
        "the mass-proportional damping of eq. (2) at the reference modulus"
        if scene.damping.kind == "eq-2"
        else "the Rayleigh damping of the fuzzy-tuned models"
    )
    return [
        f"The finite-element reference is linear in strain and has {damping}. Comparison with "
        "it is code to code, not validation against an experiment."
    ]


SUPPORTED_FEATURES = frozenset(
    {
        "moved-tools",
        "several-loads",
        "travelling-loads",
        "gravity",
        "weights",
        "inclusions",
        "fixed-surfaces",
    }
)

KIND = ModelKind(
    models=models, assumptions=assumptions, is_reference=True, supported_features=SUPPORTED_FEATURES
)
