"""The study of a scene: every model that it names, run and compared."""

from __future__ import annotations

import time
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from study.mesh.save import save
from study.models.estimates import FuzzyResults, estimates, run_fuzzy
from study.models.linear_limits import STRAIN_LIMIT
from study.models.model import SILENT, ModelRun, Watch
from study.models.table import is_tuned, references
from study.problem.response import Response
from study.problem.trajectory import Trajectory
from study.results import Results
from study.results.arrays import Arrays
from study.results.provenance import mesh_sha256, organ_sha256, provenance, tissue_sha256
from study.results.records import (
    ControlPoint,
    Dimensionless,
    ErrorBudget,
    LatticeLimits,
    ModelRecord,
    Provenance,
    StudyRecord,
)
from study.results.tables import (
    BandSample,
    CertifiedSample,
    FieldDifference,
    Iso18571Rating,
    ScoreDifference,
    ScoreError,
    SimilarityScore,
    ToolForceScore,
)
from study.run.assumptions import assumptions
from study.run.preparation import PreparedPointScene, prepare_scene
from study.run.problem_record import ProblemRecord
from study.run.requirement import requirement_checks
from study.run.score_errors import error_rows, rating_rows
from study.run.stages import SERIAL, RunOptions, Stage, Stages
from study.run.suiting import suited
from study.run.tables import band_rows, certified_rows, curve_rows, difference_rows, similarity_rows
from study.run.tool_forces import force_rows, force_scores, largest_forces
from study.run.visual_output import visual_arrays
from study.run.warnings import warnings
from study.scene import Scene
from study.scene.file import validate, write_scene
from study.scene.part import without
from study.stages.fingerprint import key
from study.stages.job_pool import job_pool
from study.stages.threads import threads
from study.system.progress import Progress

if TYPE_CHECKING:
    from study.run.organ_stages import OrganStages

SUITED, FUZZY, SIMILARITY = "scene suited to the organ", "fuzzy systems", "similarity"
NON_FUZZY_TABLES = (
    *("organ", "support", "tool", "lattice", "damping", "basafa", "reference"),
    *("superposition", "corrected", "region"),
    *("time", "control_points"),
)
"""Tables of a scene that its fuzzy systems do not read."""


@dataclass(frozen=True)
class StudyRuns:
    """The runs of all models of a scene by name, and the other results on its problem."""

    response: Response
    runs: dict[str, ModelRun]
    notes: tuple[str, ...] = ()
    fields: Arrays = field(default_factory=dict)
    dimensionless: Dimensionless | None = None
    lattice_limits: LatticeLimits | None = None
    control_point: ControlPoint | None = None
    budgets: tuple[ErrorBudget, ...] = ()


def run_study(scene: Scene, watch: Watch = SILENT, options: RunOptions = SERIAL) -> Results:
    """Run everything that a scene names, or take it from the store, and collect the results.

    Raises ValueError, before anything is computed, for whatever `study.run.preparation` refuses.
    """
    started = time.perf_counter()
    workers = 1 if scene.is_point else options.workers  # a point takes less time than a process
    with job_pool(workers, watch.progress) as pool, threads(workers):
        stages = Stages(options, pool, watch.progress)
        scene = _suited(scene, stages)
        # The files are hashed before the run, in case somebody changes them meanwhile.
        files = scene.organ.mesh, scene.fuzzy.rule_base, tissue_sha256(scene)
        made_by = provenance(write_scene(scene), *files)
        if scene.is_point:
            found = _run_point(scene, stages, watch, made_by)
        else:
            found = _run_organ(scene, stages, watch, made_by)
        fuzzy = stages.results().get(FUZZY, FuzzyResults())
        similarity = stages.compute(_similarity_stage(scene, found))
    results = _results(scene, fuzzy, found, similarity, made_by)
    wall = time.perf_counter() - started
    record = replace(results.record, stages=stages.records(), workers=workers, study_wall_s=wall)
    return replace(results, record=record)


def _suited(scene: Scene, stages: Stages) -> Scene:
    """The scene with the keys of `organ.suit` adapted to the organ file."""
    if not scene.organ.suit or scene.organ.mesh is None:
        return scene
    found = key(SUITED, scene, mesh_sha256(scene.organ.mesh), modules=("study.run.suiting",))
    text = stages.compute(Stage(SUITED, str, found, lambda p: write_scene(suited(scene, p))))
    return validate(tomllib.loads(text), SUITED)


def _start_fuzzy(scene: Scene, stages: Stages, rule_base: str | None) -> None:
    """Start the fuzzy systems, if a model uses their estimates and no result is stored."""
    stage = fuzzy_stage(scene, rule_base)
    if is_tuned(scene) and stages.cached(stage) is None:
        stages.start(stage)


def fuzzy_stage(scene: Scene, rule_base: str | None) -> Stage[FuzzyResults]:
    """The stage of a scene's fuzzy systems; `rule_base`: SHA-256 of the user's rule base."""
    seen = without(scene, NON_FUZZY_TABLES)
    found = key(FUZZY, seen, rule_base, modules=("study.models.estimates",))
    return Stage(FUZZY, FuzzyResults, found, partial(_fuzzy, seen))


def _fuzzy(seen: Scene, progress: Progress) -> FuzzyResults:
    with progress.stage(FUZZY):
        return run_fuzzy(seen)


def _run_point(scene: Scene, stages: Stages, watch: Watch, made_by: Provenance) -> StudyRuns:
    given = prepare_scene(scene)
    assert isinstance(given, PreparedPointScene)  # noqa: S101 - the scene is a point
    _start_fuzzy(scene, stages, made_by.rule_base_sha256)
    problem = given.problem
    runs = {model.name: model.run(problem, watch) for model in given.models}
    point = ControlPoint(mass_kg=problem.mass, rest_length_m=problem.rest_length)
    persistence = watch.persistence
    wanted = persistence is not None and persistence.fields is not None
    notes = ("No fields are kept: a single point has none.",) if wanted else ()
    return StudyRuns(problem.response, runs, notes, control_point=point)


def _run_organ(scene: Scene, stages: Stages, watch: Watch, made_by: Provenance) -> StudyRuns:
    # The models of an organ take long to import, and a point does not need them.
    from study.run.organ_stages import OrganStages

    tuned = estimates(scene) if is_tuned(scene) else {}
    _start_fuzzy(scene, stages, made_by.rule_base_sha256)
    organ_stages = OrganStages(scene, tuned, organ_sha256(scene), stages, watch)
    problem_record = organ_stages.start()
    found = organ_stages.results(problem_record)
    if stages.options.mesh is not None:
        _save_mesh(organ_stages, problem_record, stages.options.mesh)
    return StudyRuns(
        problem_record.response,
        found.runs,
        (*problem_record.notes, *found.notes),
        _fields(problem_record, found.runs),
        problem_record.dimensionless,
        found.limits,
        budgets=found.budgets,
    )


def _save_mesh(organ_stages: OrganStages, problem_record: ProblemRecord, path: Path) -> None:
    """Write the tetrahedra of the run. ValueError if they cannot be generated again."""
    if organ_stages.builder.mesh != problem_record.mesh:
        raise ValueError(
            "--save-mesh: the mesher made another mesh than that of the results kept in the store; "
            "add --fresh to compute on the new one"
        )
    save(organ_stages.builder.problem.geometry.mesh, path)


def _fields(problem_record: ProblemRecord, runs: dict[str, ModelRun]) -> Arrays:
    """Arrays for figures: surface, tools, control points, inclusions, and each model's fields."""
    seen = problem_record.visual_output
    found = {
        "points": problem_record.points,
        "triangles": problem_record.triangles,
        "tool": problem_record.tool,
        "probes": problem_record.probes,
        **({"inclusions": problem_record.inclusions} if len(problem_record.inclusions) else {}),
        **({"ways": problem_record.travel_paths} if len(problem_record.travel_paths) else {}),
        "held": seen.held,
        "loaded": seen.loaded,
        "cut": seen.points,
        "cut_triangles": seen.triangles,
        "film": np.unique(seen.samples),
    }
    for name, run in runs.items():
        found |= visual_arrays(seen, name, run.trajectory.surface_field)
    return found


@dataclass(frozen=True)
class SimilarityTables:
    """Similarity of the motions: rows of the tables, and notes on pairs without scores."""

    scores: tuple[SimilarityScore, ...]
    unscored: tuple[str, ...]
    ratings: tuple[Iso18571Rating, ...]
    errors: tuple[ScoreError, ...]
    differences: tuple[ScoreDifference, ...]
    field_differences: tuple[FieldDifference, ...]
    tool_scores: tuple[ToolForceScore, ...] = ()


def _similarity_stage(scene: Scene, found: StudyRuns) -> Stage[SimilarityTables]:
    """The stage of scores and differences, which depend on motions and records alone."""
    # A model whose cells inverted is warned about and has no scores.
    scorable = {n: one.trajectory for n, one in found.runs.items() if not one.record.inverted_cells}
    records = tuple(replace(run.record, wall_s=None) for run in found.runs.values())
    given = (found.response, scorable, records, tuple(references(scene)))
    name = key(SIMILARITY, *given, modules=(__name__,))
    return Stage(
        SIMILARITY, SimilarityTables, name, lambda progress: _similarity_tables(*given, progress)
    )


def _similarity_tables(
    response: Response,
    scorable: dict[str, Trajectory],
    records: tuple[ModelRecord, ...],
    compared_with: tuple[str, ...],
    progress: Progress,
) -> SimilarityTables:
    with progress.stage(SIMILARITY):
        scores, unscored = similarity_rows(response, scorable, compared_with)
        errors, differences = error_rows(response, scorable, records, scores)
        has_field = response.volumes.size > 0
        of_field = difference_rows(response, scorable, compared_with) if has_field else ()
        tool_scores, unscored_tools = force_scores(response, scorable, compared_with)
        return SimilarityTables(
            scores=scores,
            unscored=(*unscored, *unscored_tools),
            ratings=tuple(rating_rows(response, scorable, scores)),
            errors=errors,
            differences=differences,
            field_differences=tuple(of_field),
            tool_scores=tool_scores,
        )


def _results(
    scene: Scene,
    fuzzy: FuzzyResults,
    found: StudyRuns,
    similarity: SimilarityTables,
    made_by: Provenance,
) -> Results:
    runs, response = found.runs, found.response
    trajectories = {name: run.trajectory for name, run in runs.items()}
    return Results(
        scene,
        _record(scene, fuzzy, found, similarity.unscored, made_by),
        curves=tuple(curve_rows(response, trajectories)),
        bands=tuple(_bands(found)),
        certified=tuple(_certified(found)),
        tool_forces=tuple(force_rows(response, trajectories)),
        tool_scores=similarity.tool_scores,
        scores=similarity.scores,
        ratings=similarity.ratings,
        score_errors=similarity.errors,
        score_differences=similarity.differences,
        field_differences=similarity.field_differences,
        sensitivity=fuzzy.sensitivity,
        fields=found.fields,
        fuzzy=fuzzy.arrays,
    )


def _bands(found: StudyRuns) -> Iterator[BandSample]:
    for name, run in found.runs.items():
        if run.bounds is not None:
            yield from band_rows(found.response, name, run.bounds)


def _certified(found: StudyRuns) -> Iterator[CertifiedSample]:
    for name, run in found.runs.items():
        if run.certified is not None:
            yield from certified_rows(found.response, name, run.certified)


def _record(
    scene: Scene,
    fuzzy: FuzzyResults,
    found: StudyRuns,
    unscored: Sequence[str],
    made_by: Provenance,
) -> StudyRecord:
    runs = found.runs
    models = tuple(run.record for run in runs.values())
    # Models on one lattice share the check of its mass, which is listed once.
    checks = tuple(dict.fromkeys(check for run in runs.values() for check in run.checks))
    checks += tuple(requirement_checks(scene, found.response.probes, runs))
    of_models = (note for run in runs.values() for note in run.notes)
    return StudyRecord(
        title=scene.title,
        probes=found.response.probes,
        fuzzy=fuzzy.record,
        models=models,
        references=tuple(references(scene)),
        checks=checks,
        warnings=warnings(scene, models, checks),
        assumptions=assumptions(scene, found.control_point),
        notes=(*scene.remarks, *fuzzy.notes, *found.notes, *of_models, *unscored),
        strain_limit=STRAIN_LIMIT,
        study_wall_s=None,
        provenance=made_by,
        dimensionless=found.dimensionless,
        lattice_limits=found.lattice_limits,
        control_point=found.control_point,
        budgets=found.budgets,
        tools=tuple(largest_forces(found.response, runs)),
    )
