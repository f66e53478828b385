"""Scenes with a `[require]` table: planned, and solved at rest where no motion is required."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from study.plan.plan import FIELD, Plan, lines, plan
from study.results import rest as results
from study.results.rest import RestRow
from study.run.rest import rest_of
from study.run.suiting import suited
from study.scene import Scene
from study.scene.file import write_scene
from study.system.progress import Progress


def planned(scene: Scene, progress: Progress) -> Plan:
    """The plan of a scene; its sentences become remarks of the results.

    ValueError if no model is expected to meet the requirement.
    """
    with progress.stage("plan"):
        found = plan(suited(scene, progress))
    said = (f"Planned: {line}." for line in lines(found, costs=False))
    return replace(found, scene=replace(found.scene, remarks=(*found.scene.remarks, *said)))


def at_rest(found: Plan, folder: Path, progress: Progress) -> list[str]:
    """Solve a plan at rest, write its results folder, and return lines for a terminal."""
    required = found.scene.require
    with results.replacing(folder) as partial:
        solved = rest_of(found.scene, progress, large=found.large)
        results.write(solved.rows, write_scene(found.scene), partial)
        if required is not None and FIELD in required.quantities:
            results.write_field(solved.mesh, solved.displacement, partial)
    return [*_rest_lines(solved.rows), f"results in {folder}"]


def _rest_lines(rows: tuple[RestRow, ...]) -> Iterator[str]:
    for row in rows:
        errors = (row.mesh_error, row.large_displacement_error)
        known = " and ".join("unknown" if e is None else f"{100.0 * e:.2g} %" for e in errors)
        yield (
            f"{row.probe}: {1e3 * row.along_push_m:.4g} mm along the push, estimated error {known} "
            "by mesh and large displacements"
        )
