"""The study of a scene: every model that it names, run and compared."""

from __future__ import annotations

import time
import tomllib
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from study.mesh.save import save
from study.models.estimates import FuzzySide, estimates, run_fuzzy
from study.models.linear_limits import STRAIN_LIMIT
from study.models.model import SILENT, ModelRun, Watch
from study.models.table import is_tuned, references
from study.problem.response import Response
from study.problem.trajectory import Trajectory
from study.progress import Progress
from study.results.folder import Arrays, Results
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
from study.run.visual_output import kept
from study.run.warnings import warnings
from study.scene import Scene
from study.scene.file import validate, write_scene
from study.scene.part import without
from study.stages.fingerprint import key
from study.stages.job_pool import job_pool
from study.stages.threads import threads

if TYPE_CHECKING:
    from study.run.organ_stages import OrganStages

SUITED, FUZZY, SIMILARITY = "scene suited to the organ", "fuzzy systems", "similarity"
NO_FUZZY = (
    *("organ", "support", "tool", "lattice", "damping", "basafa", "reference"),
    *("superposition", "corrected", "region"),
    *("time", "control_points"),
)
"""Tables of a scene that its fuzzy systems do not read."""


@dataclass(frozen=True)
class Compared:
    """Runs of all models of a scene by name, and what else was found on its problem."""

    response: Response
    runs: dict[str, ModelRun]
    notes: tuple[str, ...] = ()
    fields: Arrays = field(default_factory=dict)
    dimensionless: Dimensionless | None = None
    lattice_limits: LatticeLimits | None = None
    control_point: ControlPoint | None = None
    budgets: tuple[ErrorBudget, ...] = ()


def run_study(scene: Scene, watch: Watch = SILENT, options: RunOptions = SERIAL) -> Results:
    """Run all that the scene names, or take it from the store, and gather the results.

    Raises ValueError, before anything is computed, for whatever `study.run.preparation` refuses.
    """
    started = time.perf_counter()
    workers = 1 if scene.is_point else options.workers  # a point is moved before a process is there
    with job_pool(workers, watch.progress) as side_by_side, threads(workers):
        stages = Stages(options, side_by_side, watch.progress)
        scene = _suited(scene, stages)
        # Files as they are now, not after the run.
        files = scene.organ.mesh, scene.fuzzy.rule_base, tissue_sha256(scene)
        made_by = provenance(write_scene(scene), *files)
        if scene.is_point:
            found = _on_point(scene, stages, watch, made_by)
        else:
            found = _on_organ(scene, stages, watch, made_by)
        fuzzy = stages.results().get(FUZZY, FuzzySide())
        alike = stages.now(_likeness_stage(scene, found))
    results = _results(scene, fuzzy, found, alike, made_by)
    wall = time.perf_counter() - started
    record = replace(results.record, stages=stages.records(), workers=workers, study_wall_s=wall)
    return replace(results, record=record)


def _suited(scene: Scene, stages: Stages) -> Scene:
    """The scene with the keys chosen that are to suit its organ, whose file is looked at."""
    if not scene.organ.suit or scene.organ.mesh is None:
        return scene
    found = key(SUITED, scene, mesh_sha256(scene.organ.mesh), modules=("study.run.suiting",))
    text = stages.now(Stage(SUITED, str, found, lambda p: write_scene(suited(scene, p))))
    return validate(tomllib.loads(text), SUITED)


def _start_fuzzy(scene: Scene, stages: Stages, rule_base: str | None) -> None:
    """Let the fuzzy systems be evaluated, if a model is tuned by them and it is not kept."""
    stage = fuzzy_stage(scene, rule_base)
    if is_tuned(scene) and stages.kept(stage) is None:
        stages.start(stage)


def fuzzy_stage(scene: Scene, rule_base: str | None) -> Stage[FuzzySide]:
    """The fuzzy systems of a scene; `rule_base`: SHA-256 of a file of one's own rules."""
    seen = without(scene, NO_FUZZY)
    found = key(FUZZY, seen, rule_base, modules=("study.models.estimates",))
    return Stage(FUZZY, FuzzySide, found, partial(_fuzzy, seen))


def _fuzzy(seen: Scene, progress: Progress) -> FuzzySide:
    with progress.stage(FUZZY):
        return run_fuzzy(seen)


def _on_point(scene: Scene, stages: Stages, watch: Watch, made_by: Provenance) -> Compared:
    given = prepare_scene(scene)
    assert isinstance(given, PreparedPointScene)  # noqa: S101 - of such a scene
    _start_fuzzy(scene, stages, made_by.rule_base_sha256)
    problem = given.problem
    runs = {model.name: model.run(problem, watch) for model in given.models}
    point = ControlPoint(mass_kg=problem.mass, rest_length_m=problem.rest_length)
    persistence = watch.persistence
    wanted = persistence is not None and persistence.fields is not None
    notes = ("No fields are kept: a single point has none.",) if wanted else ()
    return Compared(problem.response, runs, notes, control_point=point)


def _on_organ(scene: Scene, stages: Stages, watch: Watch, made_by: Provenance) -> Compared:
    from study.run.organ_stages import (
        OrganStages,  # imports what moves an organ, which a point has no need of
    )

    tuned = estimates(scene) if is_tuned(scene) else {}
    _start_fuzzy(scene, stages, made_by.rule_base_sha256)
    organ_stages = OrganStages(scene, tuned, organ_sha256(scene), stages, watch)
    problem_record = organ_stages.start()
    found = organ_stages.motions(problem_record)
    if stages.options.mesh is not None:
        _save_mesh(organ_stages, problem_record, stages.options.mesh)
    return Compared(
        problem_record.response,
        found.runs,
        (*problem_record.notes, *found.notes),
        _fields(problem_record, found.runs),
        problem_record.dimensionless,
        found.limits,
        budgets=found.budgets,
    )


def _save_mesh(organ_stages: OrganStages, problem_record: ProblemRecord, path: Path) -> None:
    """Write the tetrahedra that the run was on. ValueError where they cannot be made again."""
    if organ_stages.builder.mesh != problem_record.mesh:
        raise ValueError(
            "--save-mesh: the mesher made another mesh than that of the results kept in the store; "
            "add --fresh to compute on the new one"
        )
    save(organ_stages.builder.problem.geometry.mesh, path)


def _fields(problem_record: ProblemRecord, runs: dict[str, ModelRun]) -> Arrays:
    """Surface, tool, its way, probes, inclusions, and what is kept of each model to draw."""
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
        found |= kept(seen, name, run.trajectory.surface_field)
    return found


@dataclass(frozen=True)
class Likeness:
    """How like the motions are: rows of the tables, and notes on pairs that have none."""

    scores: tuple[SimilarityScore, ...]
    unscored: tuple[str, ...]
    ratings: tuple[Iso18571Rating, ...]
    errors: tuple[ScoreError, ...]
    differences: tuple[ScoreDifference, ...]
    of_field: tuple[FieldDifference, ...]
    of_tools: tuple[ToolForceScore, ...] = ()


def _likeness_stage(scene: Scene, found: Compared) -> Stage[Likeness]:
    """Scores and differences of all that were moved; they follow from motions and records alone."""
    # One that diverged leaves a note in place of its scores.
    sound = {n: one.trajectory for n, one in found.runs.items() if not one.record.inverted_cells}
    records = tuple(replace(run.record, wall_s=None) for run in found.runs.values())
    given = (found.response, sound, records, tuple(references(scene)))
    name = key(SIMILARITY, *given, modules=(__name__,))
    return Stage(SIMILARITY, Likeness, name, lambda progress: _likeness(*given, progress))


def _likeness(
    response: Response,
    sound: dict[str, Trajectory],
    records: tuple[ModelRecord, ...],
    compared_with: tuple[str, ...],
    progress: Progress,
) -> Likeness:
    with progress.stage(SIMILARITY):
        scores, unscored = similarity_rows(response, sound, compared_with)
        errors, apart = error_rows(response, sound, records, scores)
        ratings = tuple(rating_rows(response, sound, scores))
        has_field = response.volumes.size > 0
        of_field = difference_rows(response, sound, compared_with) if has_field else ()
        of_tools, silent = force_scores(response, sound, compared_with)
        notes = (*unscored, *silent)
        return Likeness(scores, notes, ratings, errors, apart, tuple(of_field), of_tools)


def _results(
    scene: Scene, fuzzy: FuzzySide, found: Compared, alike: Likeness, made_by: Provenance
) -> Results:
    runs, response = found.runs, found.response
    models = tuple(run.record for run in runs.values())
    # A lattice's mass is checked for each model on it, and is told once.
    checks = tuple(dict.fromkeys(check for run in runs.values() for check in run.checks))
    checks += tuple(requirement_checks(scene, response.probes, runs))
    record = StudyRecord(
        title=scene.title,
        probes=response.probes,
        fuzzy=fuzzy.record,
        models=models,
        references=tuple(references(scene)),
        checks=checks,
        warnings=warnings(scene, models, checks),
        assumptions=assumptions(scene, found.control_point),
        notes=(
            *scene.remarks,
            *fuzzy.notes,
            *found.notes,
            *(note for run in runs.values() for note in run.notes),
            *alike.unscored,
        ),
        strain_limit=STRAIN_LIMIT,
        study_wall_s=None,
        provenance=made_by,
        dimensionless=found.dimensionless,
        lattice_limits=found.lattice_limits,
        control_point=found.control_point,
        budgets=found.budgets,
        tools=tuple(largest_forces(response, runs)),
    )
    trajectories = {name: run.trajectory for name, run in runs.items()}
    return Results(
        scene,
        record,
        tuple(curve_rows(response, trajectories)),
        tuple(
            row
            for name, run in runs.items()
            if run.bounds is not None
            for row in band_rows(response, name, run.bounds)
        ),
        tuple(
            row
            for name, run in runs.items()
            if run.certified is not None
            for row in certified_rows(response, name, run.certified)
        ),
        tuple(force_rows(response, trajectories)),
        alike.of_tools,
        alike.scores,
        alike.ratings,
        alike.errors,
        alike.differences,
        alike.of_field,
        fuzzy.sensitivity,
        found.fields,
        fuzzy.arrays,
    )
