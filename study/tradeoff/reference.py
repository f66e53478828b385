"""The converged reference of a scene and its own error, as a task of a sweep."""

from __future__ import annotations

import dataclasses
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from study.models.finite_elements import reference_of
from study.models.model import SILENT, ModelRun
from study.results.records import ElementsRecord, MeshLevel
from study.run.scene_problem import SceneProblem, scene_problem
from study.run.tool_forces import largest_forces
from study.sweep.canonical import Plain, restored
from study.tradeoff.problem import plain

Floats = NDArray[np.float64]

FUNCTION = f"{__name__}:solve"


@dataclass(frozen=True)
class SolvedReference:
    """A reference as plain values: field at the peak and displacement curves, flattened.

    Each error is the sum of those due to the mesh, the subspace and the steps of the load; None
    where the organ has no other mesh to estimate it. `force` [N] on the moved tools (samples,
    tools, 3), with the error of each. Unless `finished`, there is nothing to compare with.
    """

    field: list[float]
    curves: list[float]
    field_error: float | None
    curve_errors: list[float] | None
    unknowns: int
    element: str
    levels: tuple[MeshLevel, ...]
    force: list[float] = dataclasses.field(default_factory=list)
    force_errors: list[float] | None = None
    finished: bool = True


@dataclass(frozen=True)
class ReferenceSolution:
    """What contenders are compared with.

    `field` [m] (q, 3) at the peak; `curves` [m] (samples, probes, 3); relative errors of both,
    `field_error` and `curve_errors` (probes,). `force` [N] (samples, tools, 3) on the moved tools,
    and relative errors (tools,) of the force over time and of the largest force.
    """

    field: Floats
    curves: Floats
    field_error: float
    curve_errors: Floats
    force: Floats = dataclasses.field(default_factory=lambda: np.zeros((0, 0, 3)))
    force_errors: Floats = dataclasses.field(default_factory=lambda: np.zeros(0))
    peak_errors: Floats = dataclasses.field(default_factory=lambda: np.zeros(0))

    @property
    def force_bar(self) -> float | None:
        """The largest error of a force over time; None without moved tools."""
        return float(self.force_errors.max()) if len(self.force_errors) else None


def solve(scene: Plain, mesh_sha256: str | None) -> Plain:
    """The reference of a scene, as plain values of `SolvedReference`."""
    given = scene_problem(scene, mesh_sha256)
    reference = reference_of(given.scene).varied(large_strain="none")
    run = reference.prepare(given.problem).run(SILENT)
    elements, steps = run.record.elements, run.record.time_step_errors
    assert isinstance(elements, ElementsRecord)  # noqa: S101 - finite elements have one
    rest = (elements.truncation_error or 0.0) + max(one.displacement for one in steps.values())
    mesh = elements.mesh_error
    probes, finished = given.problem.probes, run.trajectory.status == "finished"
    return asdict(
        SolvedReference(
            field=plain(run.trajectory.volume_field[0]) if finished else [],
            curves=plain(run.trajectory.displacement) if finished else [],
            field_error=None if mesh is None else mesh.field_peak + rest,
            curve_errors=(
                None if mesh is None else [mesh.by_probe[p].displacement + rest for p in probes]
            ),
            unknowns=elements.unknowns,
            element=elements.element,
            levels=elements.levels,
            force=plain(run.trajectory.tool_force) if finished else [],
            force_errors=_force_errors(given, run),
            finished=finished,
        )
    )


def _force_errors(given: SceneProblem, run: ModelRun) -> list[float] | None:
    """Error of each tool's force over time, None where a part of it is not estimated."""
    found = [one.relative_error for one in largest_forces(given.problem.response, {"fem": run})]
    known = [error for error in found if error is not None]
    return known if len(known) == len(given.problem.rigid_tools) else None


def truth(value: Plain, given: SceneProblem) -> ReferenceSolution:
    """The reference from a stored value. ValueError if it or its error is unknown."""
    found = restored(SolvedReference, value)
    if not found.finished:
        raise ValueError("the reference's motion was lost before its end")
    if found.field_error is None or found.curve_errors is None:
        raise ValueError(
            "the organ has one mesh only, so the error of its reference is unknown and that of a "
            "model cannot be separated from it; refine organ.mesh or give a surface"
        )
    seen, tools = given.problem.observation, len(given.problem.rigid_tools)
    if tools and found.force_errors is None:
        raise ValueError("the error of the reference's force on the tools is unknown")
    of_force = np.array(found.force_errors or [])
    return ReferenceSolution(
        np.reshape(found.field, (-1, 3)),
        np.reshape(found.curves, (len(seen.times), len(seen.probes), 3)),
        found.field_error,
        np.array(found.curve_errors),
        np.reshape(found.force, (len(seen.times), tools, 3)),
        of_force,
        of_force,
    )
