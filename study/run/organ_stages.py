"""The models of a scene on its organ: moved where no stage of them is kept, side by side."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, NamedTuple

from study.models.lattice import LatticeModel, PreparedLattice
from study.models.model import Estimates, Model, ModelRun, Prepared, Watch
from study.models.table import kind, models_of, references
from study.progress import Progress
from study.results.records import ErrorBudget, LatticeLimits
from study.run.budget import Mending, error_budgets, mending
from study.run.limits import (
    LatticeAtRest,
    ReferenceAtRest,
    lattice_at_rest,
    lattice_limits,
    reference_at_rest,
)
from study.run.preparation import prepare_models
from study.run.problem_record import ProblemBuilder, ProblemRecord
from study.run.stages import Stage, Stages
from study.run.unfinished import moved, within
from study.run.visual_output import with_end_fields_only
from study.scene import Scene
from study.similarity.batch import compile_measures
from study.stages.fingerprint import key

Work = Callable[[Progress], Any]

ORGAN, AT_REST, BUDGET = "organ", "lattice at rest", "error budget against {}"
AT_REST_OF_ONE_LOAD = (
    "What the lattice cannot do at rest, and the parts of its error, are told for one load on a "
    "weightless body only."
)
WITH_LIMITS = "fem"
"""The reference that a lattice's limits are told against."""


@dataclass(frozen=True)
class ModelResult:
    """The run of a model; of a solid also at rest, if it is asked for, or why part of it is not."""

    run: ModelRun
    rest: ReferenceAtRest | None = None
    why: str = ""


def _finished(found: ModelResult) -> bool:
    """Whether there is a motion, if one that diverged."""
    return found.run.record.status != "not finished"


@dataclass(frozen=True)
class LatticeRestResult:
    """The lattice at rest, or why it is not."""

    found: LatticeAtRest | None
    why: str = ""


@dataclass(frozen=True)
class BudgetResult:
    """A lattice mended toward a reference, or why it is not."""

    found: Mending | None
    why: str = ""


class Wanted(NamedTuple):
    """A stage, and the names of the models that it needs set up."""

    stage: Stage[Any]
    needs: tuple[str, ...] = ()


@dataclass(frozen=True)
class Motions:
    """Runs by model, what was found on their differences, and notes on what was not."""

    runs: dict[str, ModelRun]
    limits: LatticeLimits | None
    budgets: tuple[ErrorBudget, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class OrganStages:
    """A scene with an organ, to be moved by stages.

    `organ`: SHA-256 of the file that it names, if any.
    """

    scene: Scene
    estimates: Estimates
    organ: str | None
    stages: Stages
    watch: Watch
    prepared: dict[str, Prepared] = field(default_factory=dict)

    @cached_property
    def builder(self) -> ProblemBuilder:
        """The problem, built when it is needed."""
        return ProblemBuilder(self.scene, self.watch.progress)

    @cached_property
    def models(self) -> dict[str, Model]:
        """All models of the scene by name, in the order in which they run."""
        return {one.name: one for one in models_of(self.scene, self.estimates)}

    @cached_property
    def lattice(self) -> str | None:
        """Name of the first lattice that is no reference, if there is one: all are mended alike.

        One of cells of one size before any of several.
        """
        if self.scene.features:  # what is told of a lattice at rest is of one load
            return None
        of_springs = {n: one for n, one in self.models.items() if isinstance(one, LatticeModel)}
        names = sorted(of_springs, key=lambda name: of_springs[name].graded)
        return next((name for name in names if name not in references(self.scene)), None)

    @property
    def has_limits(self) -> bool:
        """Whether the limits of the lattice are told: of tuned lattices beside finite elements."""
        return bool(self.estimates) and WITH_LIMITS in self.models

    def start(self) -> ProblemRecord:
        """Take what is kept, and start what is not; the problem as its results tell it.

        ValueError for whatever a run would refuse, before it is waited for.
        """
        problem_record = self.stages.now(self.problem_record())
        missing = self._missing(problem_record.mesh)
        if missing and problem_record.mesh != self.builder.mesh:  # made anew, and otherwise
            problem_record = self.builder.problem_record()
            missing = self._missing(problem_record.mesh)
        for stage, needs in missing:
            for name in needs:
                self._prepare(name)
            self.stages.start(stage)
        if missing:
            self.stages.beside("compiled measures", compile_measures)
        return problem_record

    def motions(self, problem_record: ProblemRecord) -> Motions:
        """What all stages gave, once they have ended."""
        given = self.stages.results()
        ran: dict[str, ModelResult] = {name: given[name] for name in self.models}
        limits, notes = self._limits(given, problem_record)
        ways: dict[str, BudgetResult] = {
            name: given[BUDGET.format(name)]
            for name in references(self.scene)
            if BUDGET.format(name) in given
        }
        notes += [f"There is no error budget: {way.why}." for way in ways.values() if way.why]
        if self.scene.features:
            notes.append(AT_REST_OF_ONE_LOAD)
        budgets = error_budgets(
            {name: way.found for name, way in ways.items() if way.found is not None},
            {name: one.run for name, one in ran.items()},
            {name: one.rest.field for name, one in ran.items() if one.rest is not None},
            problem_record.response.volumes,
        )
        runs = {name: one.run for name, one in ran.items()}
        return Motions(runs, limits, budgets, tuple(dict.fromkeys(notes)))

    def _limits(
        self, given: dict[str, Any], problem_record: ProblemRecord
    ) -> tuple[LatticeLimits | None, list[str]]:
        """The limits of the lattice, or a note on why they are not known."""
        if AT_REST not in given:
            return None, []
        lattice: LatticeRestResult = given[AT_REST]
        reference: ModelResult = given[WITH_LIMITS]
        why = lattice.why or reference.why
        if lattice.found is None or reference.rest is None or why:
            return None, [f"What the lattice cannot do at rest is not known: {why}."]
        nu, volumes = self.scene.tissue.poisson_ratio, problem_record.response.volumes
        return lattice_limits(lattice.found, reference.rest, nu, volumes), []

    # --- the stages --------------------------------------------------------------------------

    def problem_record(self) -> Stage[ProblemRecord]:
        """The problem as its results tell it."""
        lattice = self.scene.lattice
        given = (self.builder.part, self.organ, lattice.springs, lattice.spacing)
        found = key(ORGAN, *given, modules=(__name__,))
        return Stage(ORGAN, ProblemRecord, found, lambda _: self.builder.problem_record())

    def _missing(self, mesh: str) -> list[Wanted]:
        """What is not kept, the dearest first."""
        return [one for one in self.all_stages(mesh) if self.stages.kept(one.stage) is None]

    def all_stages(self, mesh: str) -> Iterator[Wanted]:
        """All stages on a mesh."""
        yield from (self._of_model(name, mesh) for name in self.models)
        if self.lattice is None:
            return
        if self.has_limits:
            seen = kind("tissue").seen(self.scene)
            yield Wanted(
                self._stage(AT_REST, LatticeRestResult, partial(self._rest, seen), mesh, seen)
            )
        for name in references(self.scene):
            yield self._of_budget(self.lattice, name, mesh)

    def _of_model(self, name: str, mesh: str) -> Wanted:
        model, persistence = self.models[name], self.watch.persistence
        at_rest, at_quarter = self._asked_at_rest(name)
        work = partial(self._move, name, at_rest, at_quarter)
        stage = self._stage(name, ModelResult, work, mesh, model, at_rest, at_quarter)
        # Of a stage that is kept there are no fields of all nodes.
        readable = persistence is None or persistence.fields is None
        # What was not to be had may be had by another run, on a machine that is less busy.
        return Wanted(replace(stage, readable=readable, lasting=_finished), (name,))

    def _of_budget(self, lattice: str, name: str, mesh: str) -> Wanted:
        """A lattice mended toward a reference, whatever its own stiffness is."""
        mended, reference = self.models[lattice], self.models[name]
        assert isinstance(mended, LatticeModel)  # noqa: S101 - as it was chosen
        toward = reference if isinstance(reference, LatticeModel) else None
        work = partial(self._mend, lattice, name)
        stage = self._stage(BUDGET.format(name), BudgetResult, work, mesh, mended.scene, toward)
        return Wanted(stage, (lattice, name))

    def _stage(self, name: str, of: type, work: Work, mesh: str, *given: object) -> Stage[Any]:
        """A stage on a mesh of the problem, and of what else it is given."""
        found = key(name, of, self.builder.part, self.organ, mesh, *given, modules=(__name__,))
        return Stage(name, of, found, work)

    def _asked_at_rest(self, name: str) -> tuple[bool, bool]:
        """Whether a model is wanted at rest, and with a Poisson ratio of 1/4."""
        of_springs = isinstance(self.models[name], LatticeModel)
        wanted = self.lattice is not None and not of_springs and name in references(self.scene)
        return wanted, wanted and self.has_limits and name == WITH_LIMITS

    # --- their work ------------------------------------------------------------------------------

    def _prepare(self, name: str) -> Prepared:
        """A model set up once. ValueError for one that would not run."""
        if name not in self.prepared:
            one = [self.models[name]]
            self.prepared.update(prepare_models(one, self.builder.problem, self.watch.progress))
        return self.prepared[name]

    def _move(self, name: str, at_rest: bool, at_quarter: bool, progress: Progress) -> ModelResult:
        prepared, watch = self._prepare(name), self.watch
        watch = replace(watch, progress=within(progress, self.stages.options.minutes))
        run = with_end_fields_only(moved(self.models[name], prepared, self.builder.problem, watch))
        if run.record.status == "not finished":
            return ModelResult(run, None, f"{name} is not finished")
        if not at_rest:
            return ModelResult(run)
        with progress.stage(f"{name}: at rest"):
            try:
                return ModelResult(run, reference_at_rest(prepared, at_quarter=at_quarter))
            except ValueError as error:
                return ModelResult(run, reference_at_rest(prepared, at_quarter=False), str(error))

    def _rest(self, seen: Scene, progress: Progress) -> LatticeRestResult:
        with progress.stage(AT_REST):
            try:
                return LatticeRestResult(lattice_at_rest(seen, self.builder.problem))
            except ValueError as error:  # of a lattice beside those of the scene
                return LatticeRestResult(None, str(error))

    def _mend(self, lattice: str, reference: str, progress: Progress) -> BudgetResult:
        mended = self._prepare(lattice)
        assert isinstance(mended, PreparedLattice)  # noqa: S101 - as its model is a lattice
        with progress.stage(BUDGET.format(reference)):
            try:
                return BudgetResult(mending(mended, self._prepare(reference)))
            except ValueError as error:  # of a lattice that is mended
                return BudgetResult(None, str(error))
