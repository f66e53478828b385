"""The whole study of a scene."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from study.problem.response import Response
from study.progress import Progress
from study.results.folder import SCHEMA_VERSION, Results
from study.results.provenance import provenance
from study.run import estimates as fuzzy_side
from study.run.assumptions import assumptions
from study.run.outcome import ROTATION_LIMIT, STRAIN_LIMIT, Outcome
from study.run.tables import band_rows, curve_rows, error_rows, similarity_rows
from study.scene import Scene
from study.scene.file import resolved, write_scene

if TYPE_CHECKING:
    from study.run.keeping import Keeping


def run_study(scene: Scene, progress: Progress, keeping: Keeping | None = None) -> Results:
    """Run all that the scene names and gather the results.

    `keeping`: what the lattice runs keep on disk meanwhile.

    Raises ValueError for an organ, support or tool that cannot be used.
    """
    started = time.perf_counter()
    with progress.stage("fuzzy systems"):
        fuzzy = fuzzy_side.run_fuzzy(scene) if "msm" in scene.models else fuzzy_side.NONE
    found = fuzzy.estimates
    arrays: dict[str, dict[str, NDArray[Any]]] = {"fuzzy": fuzzy.arrays} if found else {}
    if scene.is_point:
        from study.run import point
        from study.scene.problem import point_problem_of

        given = point_problem_of(scene)
        response, outcome = given.response, point.run_point(scene, given, found, progress)
    else:
        from study.run.organ import run_organ
        from study.scene.problem import problem_of

        with progress.stage("organ"):
            posed = problem_of(scene)
        response, outcome = posed.response, run_organ(scene, posed, found, progress, keeping)
        arrays["fields"] = {
            "points": posed.geometry.surface.points,
            "triangles": posed.geometry.surface.triangles,
            "tool": np.stack([posed.tool.centre, posed.tool.direction]),
            "probes": posed.observation.probes,
        } | {name: run.surface_field for name, run in outcome.runs.items()}
    with progress.stage("similarity"):
        tables = _tables(response, outcome) | {"sensitivity": fuzzy.sensitivity}
    text = write_scene(scene)
    numbers: dict[str, Any] = {
        "schema_version": SCHEMA_VERSION,
        "title": scene.title,
        "scene": resolved(scene),
        **fuzzy.numbers,
        "probes": list(response.probes),
        "models": outcome.models,
        "checks": outcome.checks,
        "strain_limit": STRAIN_LIMIT,
        "warnings": _warnings(scene, outcome),
        "assumptions": assumptions(scene, outcome),
        "notes": [*fuzzy.notes, *outcome.notes],
        "study_wall_s": time.perf_counter() - started,
        "provenance": provenance(text, scene.organ.mesh),
    }
    return Results(text, numbers | outcome.extra, tables, arrays)


def _tables(response: Response, outcome: Outcome) -> dict[str, Any]:
    bands = [
        row for name, ends in outcome.bounds.items() for row in band_rows(response, name, ends)
    ]
    has_field = response.volumes.size > 0
    collapsed = {record["name"] for record in outcome.models if record.get("inverted_cells")}
    sound = {name: run for name, run in outcome.runs.items() if name not in collapsed}
    return {
        "curves": list(curve_rows(response, outcome.runs)),
        "bands": bands,
        "similarity": list(similarity_rows(response, sound, outcome.notes)),
        "errors": list(error_rows(response, sound)) if has_field else [],
    }


def _at_large_strain(record: dict[str, Any]) -> str:
    found = record.get("hyperelastic")
    if found is None:
        return ""
    share = 100 * found["field_difference"]
    return f", and at rest it differs by {share:.1f} % from a {found['law']} solid"


def _remedy(scene: Scene) -> str:
    """What keeps a run from diverging."""
    lattice = scene.lattice
    for key, value in (("time_step", lattice.time_step), ("step_rate", lattice.step_rate)):
        if value is not None:
            verb = "Shorten" if key == "time_step" else "Raise"
            return f"{verb} lattice.{key}, or leave it out so that steps follow the limit."
    return "Reduce lattice.step_fraction or the load."


def _warnings(scene: Scene, outcome: Outcome) -> list[str]:
    warnings = []
    for record in outcome.models:
        strain = record.get("largest_strain")
        if strain is not None and strain > STRAIN_LIMIT:
            warnings.append(
                f"The largest strain of the linear reference is {100 * strain:.1f} %; above "
                f"{100 * STRAIN_LIMIT:.0f} % it should not be trusted{_at_large_strain(record)}. "
                "Reduce tool.force or enlarge tool.radius."
            )
        rotation = record.get("largest_rotation")
        if rotation is not None and rotation > ROTATION_LIMIT:
            warnings.append(
                f"The linear reference turns by up to {rotation:.2f} rad; above {ROTATION_LIMIT:g} "
                "it should not be trusted. Reduce tool.force or hold the organ better."
            )
        if record.get("accuracy_missed"):
            warnings.append(
                f"reference.accuracy asks for {100 * record['accuracy_missed']:.2g} %; the finest "
                f"mesh of {record['elements']} tetrahedra, the last within the limit, reaches "
                f"{100 * record['mesh_error']['displacement']:.2g} %. Ask for less, or simplify "
                "the organ or its load."
            )
        if record["status"] == "diverged":
            warnings.append(
                f"{record['name']} diverged at {record['diverged_at_s']:g} s: it has no scores. "
                f"{_remedy(scene)}"
            )
        if record.get("inverted_cells"):
            warnings.append(
                f"{record['inverted_cells']} cells of {record['name']} turned inside out: springs "
                "do not resist that, so it has no scores. Reduce tool.force."
            )
    failed = [c for c in outcome.checks if not c["passed"]]
    warnings += [
        f"Check failed: {c['name']} is {c['value']:.2g}, its limit {c['limit']:g}." for c in failed
    ]
    return warnings
