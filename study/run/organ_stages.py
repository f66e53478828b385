"""Stages of a scene with an organ: its models, run side by side where no stored result exists."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, NamedTuple

from study.models.lattice import LatticeModel, PreparedLattice
from study.models.model import Estimates, Model, ModelRun, Prepared, Watch
from study.models.table import kind, models_of, references
from study.results.records import ErrorBudget, LatticeLimits
from study.run.budget import Attribution, attribution, error_budgets
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
from study.run.unfinished import run_or_unfinished, with_time_limit
from study.run.visual_output import with_end_fields_only
from study.scene import Scene
from study.similarity.batch import compile_measures
from study.stages.fingerprint import key
from study.system.progress import Progress

Work = Callable[[Progress], Any]

ORGAN, AT_REST, BUDGET = "organ", "lattice at rest", "error budget against {}"
SINGLE_LOAD_ONLY = (
    "The limits of the lattice at rest and its error budget are computed for a single load on a "
    "weightless body only."
)
LIMITS_REFERENCE = "fem"
"""The reference against which the limits of a lattice are reported."""


@dataclass(frozen=True)
class ModelResult:
    """The run of a model, and of a reference its displacement at rest if it was requested.

    `reason`: why part of what was requested is missing; empty if nothing is.
    """

    run: ModelRun
    rest: ReferenceAtRest | None = None
    reason: str = ""


def _finished(found: ModelResult) -> bool:
    """Whether the model produced a motion, be it one that diverged."""
    return found.run.record.status != "not finished"


@dataclass(frozen=True)
class LatticeRestResult:
    """The lattice at rest, or the reason why there is no such result."""

    found: LatticeAtRest | None
    reason: str = ""


@dataclass(frozen=True)
class BudgetResult:
    """The terms of an error budget against one reference, or the reason why there are none."""

    found: Attribution | None
    reason: str = ""


class PlannedStage(NamedTuple):
    """A stage, and the names of the models that must be prepared before it runs."""

    stage: Stage[Any]
    needs: tuple[str, ...] = ()


@dataclass(frozen=True)
class OrganResults:
    """Runs by model, the comparisons between them, and notes on comparisons that are missing."""

    runs: dict[str, ModelRun]
    limits: LatticeLimits | None
    budgets: tuple[ErrorBudget, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class OrganStages:
    """The stages of a scene with an organ.

    `organ`: SHA-256 of the files of the organ, None for a built-in organ; `prepared`: models by
    name, filled as stages need them.
    """

    scene: Scene
    estimates: Estimates
    organ: str | None
    stages: Stages
    watch: Watch
    prepared: dict[str, Prepared] = field(default_factory=dict)

    @cached_property
    def builder(self) -> ProblemBuilder:
        """Builds the problem when it is first needed."""
        return ProblemBuilder(self.scene, self.watch.progress)

    @cached_property
    def models(self) -> dict[str, Model]:
        """All models of the scene by name, in the order in which they run."""
        return {one.name: one for one in models_of(self.scene, self.estimates)}

    @cached_property
    def lattice(self) -> str | None:
        """Name of the lattice whose error budget stands for all, None if there is none.

        It is the first lattice that is not a reference, uniform lattices before graded ones. One
        suffices, since the budget starts from the same tissue modulus for every lattice.
        """
        if self.scene.features:  # the lattice at rest is compared under a single load only
            return None
        of_springs = {n: one for n, one in self.models.items() if isinstance(one, LatticeModel)}
        names = sorted(of_springs, key=lambda name: of_springs[name].graded)
        return next((name for name in names if name not in references(self.scene)), None)

    @property
    def reports_limits(self) -> bool:
        """Whether the lattice's limits are reported: for estimates beside finite elements only."""
        return bool(self.estimates) and LIMITS_REFERENCE in self.models

    def start(self) -> ProblemRecord:
        """Take stored results, start the missing stages, and return the record of the problem.

        ValueError for whatever a run would refuse, raised before any result is awaited.
        """
        problem_record = self.stages.compute(self.problem_record())
        uncached = self._uncached(problem_record.mesh)
        # A mesher that is not deterministic has made another mesh than that of the stored results.
        if uncached and problem_record.mesh != self.builder.mesh:
            problem_record = self.builder.problem_record()
            uncached = self._uncached(problem_record.mesh)
        for stage, needs in uncached:
            for name in needs:
                self._prepare(name)
            self.stages.start(stage)
        if uncached:
            self.stages.start_background("compiled measures", compile_measures)
        return problem_record

    def results(self, problem_record: ProblemRecord) -> OrganResults:
        """Collect the results of all stages, after they have ended."""
        given = self.stages.results()
        ran: dict[str, ModelResult] = {name: given[name] for name in self.models}
        limits, notes = self._limits(given, problem_record)
        terms: dict[str, BudgetResult] = {
            name: given[BUDGET.format(name)]
            for name in references(self.scene)
            if BUDGET.format(name) in given
        }
        notes += [f"There is no error budget: {x.reason}." for x in terms.values() if x.reason]
        if self.scene.features:
            notes.append(SINGLE_LOAD_ONLY)
        budgets = error_budgets(
            {name: x.found for name, x in terms.items() if x.found is not None},
            {name: one.run for name, one in ran.items()},
            {name: one.rest.field for name, one in ran.items() if one.rest is not None},
            problem_record.response.volumes,
        )
        runs = {name: one.run for name, one in ran.items()}
        return OrganResults(runs, limits, budgets, tuple(dict.fromkeys(notes)))

    def _limits(
        self, given: dict[str, Any], problem_record: ProblemRecord
    ) -> tuple[LatticeLimits | None, list[str]]:
        """The limits of the lattice, or a note on why they are unknown."""
        if AT_REST not in given:
            return None, []
        lattice: LatticeRestResult = given[AT_REST]
        reference: ModelResult = given[LIMITS_REFERENCE]
        reason = lattice.reason or reference.reason
        if lattice.found is None or reference.rest is None or reason:
            return None, [f"What the lattice cannot do at rest is not known: {reason}."]
        nu, volumes = self.scene.tissue.poisson_ratio, problem_record.response.volumes
        return lattice_limits(lattice.found, reference.rest, nu, volumes), []

    # --- the stages --------------------------------------------------------------------------

    def problem_record(self) -> Stage[ProblemRecord]:
        """The stage that builds the problem and keeps its record."""
        lattice = self.scene.lattice
        given = (self.builder.part, self.organ, lattice.springs, lattice.spacing)
        found = key(ORGAN, *given, modules=(__name__,))
        return Stage(ORGAN, ProblemRecord, found, lambda _: self.builder.problem_record())

    def _uncached(self, mesh: str) -> list[PlannedStage]:
        """Stages without a stored result, the most expensive first."""
        return [one for one in self.all_stages(mesh) if self.stages.cached(one.stage) is None]

    def all_stages(self, mesh: str) -> Iterator[PlannedStage]:
        """All stages on a mesh, identified by its SHA-256."""
        yield from (self._model_stage(name, mesh) for name in self.models)
        if self.lattice is None:
            return
        if self.reports_limits:
            seen = kind("tissue").relevant_part(self.scene)
            yield PlannedStage(
                self._stage(
                    AT_REST, LatticeRestResult, partial(self._lattice_rest, seen), mesh, seen
                )
            )
        for name in references(self.scene):
            yield self._budget_stage(self.lattice, name, mesh)

    def _model_stage(self, name: str, mesh: str) -> PlannedStage:
        model, persistence = self.models[name], self.watch.persistence
        at_rest, at_quarter = self._rest_requests(name)
        work = partial(self._run_model, name, at_rest=at_rest, at_quarter=at_quarter)
        stage = self._stage(name, ModelResult, work, mesh, model, at_rest, at_quarter)
        # A stored result does not include the fields of all nodes.
        readable = persistence is None or persistence.fields is None
        # A model that is not finished may finish in another run, on a machine that is less busy.
        return PlannedStage(replace(stage, readable=readable, lasting=_finished), (name,))

    def _budget_stage(self, lattice: str, name: str, mesh: str) -> PlannedStage:
        """The error budget of a lattice against the reference `name`.

        Its stiffness estimate has no part in it, so one result serves every lattice of the scene.
        """
        model, reference = self.models[lattice], self.models[name]
        assert isinstance(model, LatticeModel)  # noqa: S101 - see `lattice`
        toward = reference if isinstance(reference, LatticeModel) else None
        work = partial(self._attribute, lattice, name)
        stage = self._stage(BUDGET.format(name), BudgetResult, work, mesh, model.scene, toward)
        return PlannedStage(stage, (lattice, name))

    def _stage(self, name: str, of: type, work: Work, mesh: str, *given: object) -> Stage[Any]:
        """A stage that depends on the problem, the mesh and the values `given`."""
        found = key(name, of, self.builder.part, self.organ, mesh, *given, modules=(__name__,))
        return Stage(name, of, found, work)

    def _rest_requests(self, name: str) -> tuple[bool, bool]:
        """Whether a model is needed at rest, and also at rest with Poisson ratio 1/4."""
        of_springs = isinstance(self.models[name], LatticeModel)
        wanted = self.lattice is not None and not of_springs and name in references(self.scene)
        return wanted, wanted and self.reports_limits and name == LIMITS_REFERENCE

    # --- the work of the stages ------------------------------------------------------------------

    def _prepare(self, name: str) -> Prepared:
        """A model, prepared once. ValueError for one that cannot run."""
        if name not in self.prepared:
            one = [self.models[name]]
            self.prepared.update(prepare_models(one, self.builder.problem, self.watch.progress))
        return self.prepared[name]

    def _run_model(
        self, name: str, progress: Progress, *, at_rest: bool, at_quarter: bool
    ) -> ModelResult:
        """The run of a model and, as requested, its displacement at rest."""
        prepared, watch = self._prepare(name), self.watch
        watch = replace(watch, progress=with_time_limit(progress, self.stages.options.minutes))
        run = with_end_fields_only(
            run_or_unfinished(self.models[name], prepared, self.builder.problem, watch)
        )
        if run.record.status == "not finished":
            return ModelResult(run, None, f"{name} is not finished")
        if not at_rest:
            return ModelResult(run)
        with progress.stage(f"{name}: at rest"):
            try:
                return ModelResult(run, reference_at_rest(prepared, at_quarter=at_quarter))
            except ValueError as error:
                return ModelResult(run, reference_at_rest(prepared, at_quarter=False), str(error))

    def _lattice_rest(self, seen: Scene, progress: Progress) -> LatticeRestResult:
        with progress.stage(AT_REST):
            try:
                return LatticeRestResult(lattice_at_rest(seen, self.builder.problem))
            except ValueError as error:  # this lattice is none of the scene's own
                return LatticeRestResult(None, str(error))

    def _attribute(self, lattice: str, reference: str, progress: Progress) -> BudgetResult:
        prepared = self._prepare(lattice)
        assert isinstance(prepared, PreparedLattice)  # noqa: S101 - its model is a lattice
        with progress.stage(BUDGET.format(reference)):
            try:
                return BudgetResult(attribution(prepared, self._prepare(reference)))
            except ValueError as error:  # a modified lattice cannot be built
                return BudgetResult(None, str(error))
