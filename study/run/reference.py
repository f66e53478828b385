"""The finite-element reference of a scene, and the error bar of its numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from fem_reference import model as fem
from fem_reference.dynamics import ORDER
from fem_reference.elasticity import Body
from fem_reference.elements import ELEMENTS
from fem_reference.error_estimate import ErrorEstimate, discretisation_error
from study.organ.geometry import Level
from study.problem.damping import RayleighDamping
from study.problem.problem import Problem
from study.progress import Progress
from study.results.fields import Mesh
from study.run.keeping import Keeping, recorded
from study.run.large_strain import compare_large_strain
from study.run.lattices import damping_rates
from study.run.outcome import Outcome, model_record
from study.scene import Scene

COARSER = 2
"""Meshes below that of the scene, as many as there are: three show the order of convergence."""
FINER = 12
"""Levels above it that an accuracy may take, if they are not too large."""
LARGEST_JUMP = 0.6
"""Of the element size at once: sizes far apart do not show the order."""
TRUNCATION_LIMIT = 0.01
KINDS = ("displacement", "velocity")
LINEAR_LOCKING = 0.4
"""Poisson ratio above which linear elements are far too stiff on any mesh that is run here."""


@dataclass(frozen=True)
class Solved:
    """The reference on one mesh."""

    level: Level
    body: Body
    found: fem.Solution


@dataclass(frozen=True)
class Errors:
    """Relative errors of the finest mesh: of each control point's curves by kind, of the field."""

    by_probe: dict[str, dict[str, ErrorEstimate]]
    field: ErrorEstimate

    def worst(self, kind: str) -> float:
        """Largest error of a control point's curve."""
        return max(one[kind].error for one in self.by_probe.values())


def run_reference(
    scene: Scene,
    posed: Problem,
    outcome: Outcome,
    progress: Progress,
    keeping: Keeping | None = None,
) -> Solved:
    """Run the reference into the outcome on meshes that show its error; that on the finest."""
    solved = _first(scene, posed, progress)
    errors = mesh_errors(scene, posed, solved)
    while _too_coarse(scene, errors):
        finer = _finer(scene, posed, solved[-1].level, errors)
        if finer is None:
            break
        solved.append(solved_on(scene, posed, finer, progress))
        errors = mesh_errors(scene, posed, solved)
    best = solved[-1]
    outcome.runs["fem"] = best.found.trajectory
    record = _record(scene, best)
    outcome.models.append(record)
    _keep_fields(keeping, posed, best, outcome)
    _add_mesh_errors(scene, solved, errors, outcome, record)
    _add_time_errors(scene, posed, solved[0], outcome, record, progress)
    scenes_own = next(one.body for one in solved if one.level.mesh is posed.geometry.mesh)
    compare_large_strain(scene, posed, scenes_own, outcome, record, progress)
    return best


def _first(scene: Scene, posed: Problem, progress: Progress) -> list[Solved]:
    """On the scene's mesh and those coarser, the coarsest first."""
    levels = [posed.geometry.level(k) for k in range(-COARSER, 1)]
    return [solved_on(scene, posed, level, progress) for level in levels if level is not None]


def _finer(scene: Scene, posed: Problem, last: Level, errors: Errors | None) -> Level | None:
    """The level expected to be accurate enough, or the finest there is, if it is finer."""
    share, found = 1.0, None
    if errors is not None and scene.reference.accuracy is not None:
        excess = errors.worst("displacement") / scene.reference.accuracy
        order = max(one.formal_order for one in ELEMENTS.values())
        share = max(excess ** (-1.0 / order), LARGEST_JUMP)
    for level in filter(None, map(posed.geometry.level, range(1, FINER + 1))):
        if level.size < last.size and (found is None or found.size > share * last.size):
            found = level
    return found


def solved_on(scene: Scene, posed: Problem, level: Level, progress: Progress) -> Solved:
    """The reference of a scene on one of its meshes."""
    name = f"fem: {len(level.mesh.tetrahedra)} tetrahedra"
    with progress.stage(f"{name}, assembly"):
        body = build(scene, posed, level)
    with progress.stage(name) as advance:
        damping, method = RayleighDamping(*damping_rates(scene)), _method(scene)
        arguments = (body, damping, posed.factor, posed.observation, method)
        return Solved(level, body, fem.run(*arguments, on_progress=advance))


def build(scene: Scene, posed: Problem, level: Level) -> Body:
    """The body of a scene on one of its meshes."""
    chosen = scene.reference
    where = (posed.foundation, posed.tool, chosen.element, posed.geometry.project)
    return fem.build(level.mesh, scene.tissue, *where, chosen.method)


def _method(scene: Scene, times: int = 1) -> fem.Method:
    """The scene's method, with so many times its steps."""
    chosen = scene.reference
    return fem.Method(chosen.method, times * chosen.steps_per_sample, chosen.modes)


def _keep_fields(keeping: Keeping | None, posed: Problem, best: Solved, outcome: Outcome) -> None:
    """The motion of the vertices of the finest mesh, if it is wanted."""
    if keeping is None or keeping.fields is None:
        return
    superposed, mesh = best.found.superposed, best.level.mesh
    if superposed is None:
        outcome.notes.append(
            "Fields of fem are kept of a superposition only, not of steps in time."
        )
        return
    afresh = replace(keeping, resume=False)
    shown, times = Mesh(mesh.points, mesh.tetrahedra), posed.observation.times
    with recorded(afresh, "fem", shown, times) as on_sample:
        for sample in range(len(times)):
            u, v = (x.reshape(-1, 3)[: len(mesh.points)] for x in superposed.state(sample))
            on_sample(sample, u, v)


def _record(scene: Scene, solved: Solved) -> dict[str, Any]:
    found, superposed = solved.found, solved.found.superposed
    alpha, beta = damping_rates(scene)
    return model_record("fem", scene, found.trajectory) | {
        "nodes": found.nodes,
        "elements": found.elements,
        "element": found.element,
        "unknowns": solved.body.unknowns,
        "method": scene.reference.method,
        "time_step_s": found.time_step,
        "critical_time_step_s": None,  # unconditionally stable
        "steps": found.steps,
        "subspace_vectors": None if superposed is None else superposed.subspace.load.size,
        "truncation_error": None if superposed is None else superposed.truncation_error,
        "wall_s": found.wall,
        "damping_rate_per_s": alpha,
        "stiffness_damping_s": beta,
        "largest_strain": found.largest_strain,
        "largest_rotation": found.largest_rotation,
    }


def mesh_errors(scene: Scene, posed: Problem, solved: Sequence[Solved]) -> Errors | None:
    """Errors of the finest mesh by those before it; none of one mesh, or of elements that lock.

    Locked elements approach a wrong solution for long, and seem to have converged. A subspace's
    truncation is added in squares.
    """
    if len(solved) < 2 or _locks(scene, solved[-1]):
        return None
    superposed = solved[-1].found.superposed
    truncated = 0.0 if superposed is None else superposed.truncation_error
    sizes = [one.level.size for one in solved]
    formal = ELEMENTS[solved[-1].found.element].formal_order
    runs = [one.found.trajectory for one in solved]
    by_probe = {
        probe: {
            kind: _with(
                truncated,
                discretisation_error([getattr(r, kind)[:, i] for r in runs], sizes, formal),
            )
            for kind in KINDS
        }
        for i, probe in enumerate(posed.probes)
    }
    fields = [run.volume_field[0] for run in runs]
    volumes = posed.volume_rule.weights
    return Errors(by_probe, discretisation_error(fields, sizes, formal, volumes))


def _with(truncated: float, found: ErrorEstimate) -> ErrorEstimate:
    return replace(found, error=math.hypot(found.error, truncated))


def _locks(scene: Scene, solved: Solved) -> bool:
    return solved.found.element == "p1" and scene.tissue.poisson_ratio > LINEAR_LOCKING


def _too_coarse(scene: Scene, errors: Errors | None) -> bool:
    wanted = scene.reference.accuracy
    return wanted is not None and (errors is None or errors.worst("displacement") > wanted)


def _add_mesh_errors(
    scene: Scene,
    solved: Sequence[Solved],
    errors: Errors | None,
    outcome: Outcome,
    record: dict[str, Any],
) -> None:
    record["mesh_levels"] = [
        {
            "size": one.level.size / solved[-1].level.size,
            "elements": one.found.elements,
            "unknowns": one.body.unknowns,
            "wall_s": one.found.wall,
        }
        for one in solved
    ]
    if errors is None:
        why = (
            "linear elements lock at this Poisson ratio and seem to have converged when they have "
            "not; leave reference.element out"
            if _locks(scene, solved[-1])
            else "it has no other mesh of this organ to compare with"
        )
        outcome.notes.append(f"The reference's discretisation error is not estimated: {why}.")
        return
    for key, part in (("mesh_error", "error"), ("mesh_order", "observed")):
        record[f"{key}_by_probe"] = {
            probe: {kind: getattr(one, part) for kind, one in kinds.items()}
            for probe, kinds in errors.by_probe.items()
        }
    record["mesh_error"] = {"field_peak": errors.field.error} | {k: errors.worst(k) for k in KINDS}
    record["mesh_order"] = {"field_peak": errors.field.observed}
    if scene.reference.accuracy is not None and _too_coarse(scene, errors):
        record["accuracy_missed"] = scene.reference.accuracy


def _add_time_errors(
    scene: Scene,
    posed: Problem,
    coarsest: Solved,
    outcome: Outcome,
    record: dict[str, Any],
    progress: Progress,
) -> None:
    """The error of the steps is taken on the coarsest mesh, by halving them there."""
    with progress.stage("fem: halved steps") as advance:
        arguments = (coarsest.body, RayleighDamping(*damping_rates(scene)), posed.factor)
        method = _method(scene, times=2)
        half = fem.run(*arguments, posed.observation, method, advance).trajectory
    whole = coarsest.found.trajectory
    outcome.add_time_step_errors(record, posed.probes, whole, half, ORDER)
    if record["truncation_error"] is not None:
        meaning = "largest relative L2 change of a curve by the last quarter of the subspace"
        outcome.add_check("fem: subspace", record["truncation_error"], TRUNCATION_LIMIT, meaning)
