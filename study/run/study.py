"""The study of a scene: every model that it names, run and compared."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace

import numpy as np

from study.models.estimates import FuzzySide, run_fuzzy
from study.models.linear_limits import STRAIN_LIMIT
from study.models.model import SILENT, ModelRun, Watch
from study.models.table import is_tuned, references
from study.problem.problem import Problem
from study.problem.response import Response
from study.results.folder import Arrays, Results
from study.results.provenance import provenance
from study.results.records import (
    ControlPoint,
    Dimensionless,
    ErrorBudget,
    LatticeLimits,
    Provenance,
    StudyRecord,
)
from study.run.assumptions import assumptions
from study.run.dimensionless import dimensionless
from study.run.ready import Ready, ReadyPoint, ready
from study.run.score_errors import error_rows, rating_rows
from study.run.suiting import suited
from study.run.tables import band_rows, certified_rows, curve_rows, difference_rows, similarity_rows
from study.run.warnings import warnings
from study.scene import Scene
from study.scene.file import write_scene


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


def run_study(scene: Scene, watch: Watch = SILENT) -> Results:
    """Run all that the scene names and gather the results.

    Raises ValueError, before anything is computed, for whatever `study.run.ready` refuses.
    """
    started = time.perf_counter()
    scene = suited(scene, watch.progress)
    given = ready(scene, watch.progress)
    # Files as they are now, not after the run.
    made_by = provenance(write_scene(scene), scene.organ.mesh, scene.fuzzy.rule_base)
    with watch.progress.stage("fuzzy systems"):
        fuzzy = run_fuzzy(scene) if is_tuned(scene) else FuzzySide()
    if isinstance(given, ReadyPoint):
        compared = _on_point(given, watch)
    else:
        compared = _on_organ(scene, given, watch, tuned=bool(fuzzy.estimates))
    with watch.progress.stage("similarity"):
        results = _results(scene, fuzzy, compared, made_by)
    record = replace(results.record, study_wall_s=time.perf_counter() - started)
    return replace(results, record=record)


def _on_point(given: ReadyPoint, watch: Watch) -> Compared:
    problem = given.problem
    runs = {model.name: model.run(problem, watch) for model in given.models}
    point = ControlPoint(mass_kg=problem.mass, rest_length_m=problem.rest_length)
    keeping = watch.keeping
    wanted = keeping is not None and keeping.fields is not None
    notes = ("No fields are kept: a single point has none.",) if wanted else ()
    return Compared(problem.response, runs, notes, control_point=point)


def _on_organ(scene: Scene, given: Ready, watch: Watch, *, tuned: bool) -> Compared:
    from study.run.budget import error_budgets  # imports finite elements, which a point has none of

    problem, notes = given.problem, list(given.problem.geometry.notes)
    runs: dict[str, ModelRun] = {}
    limits = None
    for name, prepared in given.models.items():
        runs[name] = prepared.run(watch)
        if name == "fem" and tuned:
            from study.run.limits import lattice_limits

            try:
                limits = lattice_limits(scene, problem, prepared, watch.progress)
            except ValueError as error:  # of a lattice beside those of the scene
                notes.append(f"What the lattice cannot do at rest is not known: {error}.")
    budgets: tuple[ErrorBudget, ...] = ()
    if any(run.record.lattice is not None for run in runs.values()):
        from study.run.budget import error_budgets

        try:
            budgets = error_budgets(scene, problem, given.models, runs, watch.progress)
        except ValueError as error:  # of a lattice that is mended
            notes.append(f"There is no error budget: {error}.")
    return Compared(
        problem.response,
        runs,
        tuple(notes),
        _fields(problem, runs),
        dimensionless(scene, problem),
        limits,
        budgets=budgets,
    )


def _fields(problem: Problem, runs: dict[str, ModelRun]) -> Arrays:
    """Surface, tool and probes, and the displacement of each model on the surface."""
    return {
        "points": problem.geometry.surface.points,
        "triangles": problem.geometry.surface.triangles,
        "tool": np.stack([problem.tool.centre, problem.tool.direction]),
        "probes": problem.observation.probes,
    } | {name: run.trajectory.surface_field for name, run in runs.items()}


def _results(scene: Scene, fuzzy: FuzzySide, found: Compared, made_by: Provenance) -> Results:
    runs, response = found.runs, found.response
    models = tuple(run.record for run in runs.values())
    # A lattice's mass is checked for each model on it, and is told once.
    checks = tuple(dict.fromkeys(check for run in runs.values() for check in run.checks))
    compared_with = references(scene)
    # One that diverged leaves a note in place of its scores.
    sound = {n: run.trajectory for n, run in runs.items() if not run.record.inverted_cells}
    scores, unscored = similarity_rows(response, sound, compared_with)
    errors, apart = error_rows(response, sound, models, scores)
    record = StudyRecord(
        title=scene.title,
        probes=response.probes,
        fuzzy=fuzzy.record,
        models=models,
        references=tuple(compared_with),
        checks=checks,
        warnings=warnings(scene, models, checks),
        assumptions=assumptions(scene, found.control_point),
        notes=(
            *scene.remarks,
            *fuzzy.notes,
            *found.notes,
            *(note for run in runs.values() for note in run.notes),
            *unscored,
        ),
        strain_limit=STRAIN_LIMIT,
        study_wall_s=None,
        provenance=made_by,
        dimensionless=found.dimensionless,
        lattice_limits=found.lattice_limits,
        control_point=found.control_point,
        budgets=found.budgets,
    )
    has_field = response.volumes.size > 0
    return Results(
        scene,
        record,
        tuple(curve_rows(response, {name: run.trajectory for name, run in runs.items()})),
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
        scores,
        tuple(rating_rows(response, sound, scores)),
        errors,
        apart,
        tuple(difference_rows(response, sound, compared_with)) if has_field else (),
        fuzzy.sensitivity,
        found.fields,
        fuzzy.arrays,
    )
