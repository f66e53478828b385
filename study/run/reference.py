"""The finite-element reference of a scene, and the error bar of its numbers."""

from __future__ import annotations

from typing import Any

from fem_reference import model as fem
from fem_reference.dynamics import ORDER
from fem_reference.elasticity import Body
from study.progress import Progress
from study.run.comparison import relative_l2
from study.run.outcome import Outcome, curve_errors, model_record
from study.run.posed import Posed
from study.scene import Scene
from study.trajectory import Trajectory

MESH_ORDER = 2
"""Assumed in the mesh error: that of flat facets on a curved organ.

Quadratic elements are of a higher order inside and of a lower one at edges of the support: the
estimate is an indication, good to a factor of a few on coarse meshes, and no bound.
"""


def run_reference(
    scene: Scene, posed: Posed, damping_rate: float, outcome: Outcome, progress: Progress
) -> Body:
    """Run the reference into the outcome; `damping_rate` [1/s] is its mass-proportional damping."""
    with progress.stage("fem: assembly"):
        body = fem.build(posed.geometry.mesh, scene.tissue, posed.foundation, posed.tool)
    with progress.stage("fem") as advance:
        steps = scene.reference.steps_per_sample
        arguments = (body, damping_rate, posed.factor, posed.observation)
        found = fem.run(*arguments, steps, on_progress=advance)
    outcome.runs["fem"] = found.trajectory
    record = model_record("fem", scene, found.trajectory) | {
        "nodes": found.nodes,
        "elements": found.elements,
        "time_step_s": found.time_step,
        "critical_time_step_s": None,  # unconditionally stable
        "steps": found.steps,
        "wall_s": found.wall,
        "damping_rate_per_s": damping_rate,
        "largest_strain": found.largest_strain,
    }
    outcome.models.append(record)
    _add_errors(scene, posed, body, damping_rate, outcome, record, progress)
    return body


def _add_errors(
    scene: Scene,
    posed: Posed,
    body: Body,
    damping_rate: float,
    outcome: Outcome,
    record: dict[str, Any],
    progress: Progress,
) -> None:
    """Errors by Richardson's estimate, from a coarser mesh and from halved steps on it."""
    geometry = posed.geometry
    if geometry.coarser is None:
        outcome.notes.append(
            "The finite-element reference has no coarser mesh of this organ to compare with: its "
            "discretisation error is not estimated."
        )
    whole, steps = outcome.runs["fem"], scene.reference.steps_per_sample
    if geometry.coarser is not None:
        with progress.stage("fem: coarser mesh") as advance:
            body = fem.build(geometry.coarser, scene.tissue, posed.foundation, posed.tool)
            arguments = (body, damping_rate, posed.factor, posed.observation)
            whole = fem.run(*arguments, steps, on_progress=advance).trajectory
    arguments = (body, damping_rate, posed.factor, posed.observation)
    with progress.stage("fem: halved steps") as advance:
        half = fem.run(*arguments, 2 * steps, on_progress=advance).trajectory
    outcome.add_time_step_errors(record, posed.probes, whole, half, ORDER)
    if geometry.coarser is not None:
        _add_mesh_error(posed, record, outcome.runs["fem"], whole)


def _add_mesh_error(
    posed: Posed, record: dict[str, Any], fine: Trajectory, coarse: Trajectory
) -> None:
    """Relative error of the fine run: its difference to the coarse one over r^2 - 1."""
    share = 1.0 / (posed.geometry.coarsening**MESH_ORDER - 1.0)
    volumes = posed.volume_rule.weights
    by_probe = curve_errors(share, posed.probes, coarse, fine)
    record["mesh_error_by_probe"] = by_probe
    record["mesh_error"] = {
        "field_peak": share * relative_l2(coarse.volume_field[0], fine.volume_field[0], volumes),
        "displacement": max(errors["displacement"] for errors in by_probe.values()),
        "velocity": max(errors["velocity"] for errors in by_probe.values()),
    }
