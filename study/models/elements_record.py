"""The record of a run of finite elements: its meshes, steps and time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from study.models.errors import place
from study.models.mesh_error import MeshSolution
from study.problem.damping import RayleighDamping
from study.problem.problem import Problem
from study.results.records import CurveErrors, ElementsRecord, MeshLevel, ModelRecord


def model_record(
    name: str,
    label: str,
    problem: Problem,
    damping: RayleighDamping,
    best: MeshSolution,
    errors: Mapping[str, CurveErrors],
    elements: ElementsRecord,
) -> ModelRecord:
    """The record of the motion on the finest mesh, with the errors of its curves by time steps."""
    found = best.found
    return ModelRecord(
        name=name,
        label=label,
        simulated_s=float(problem.observation.times[-1]),
        status=found.trajectory.status,
        ended_at_s=found.trajectory.ended_at,
        ended_near_m=place(found.trajectory),
        nodes=found.nodes,
        time_step_s=found.time_step,
        steps=found.steps,
        wall_s=found.wall,
        small_strain_modulus_pa=problem.tissue.youngs_modulus,
        damping_rate_per_s=damping.mass,
        stiffness_damping_s=damping.stiffness,
        largest_strain=found.largest_strain,
        time_step_errors=dict(errors),
        elements=elements,
    )


def mesh_levels(solved: Sequence[MeshSolution]) -> tuple[MeshLevel, ...]:
    """Sizes of all meshes, as shares of the element size of the last one, and their costs."""
    return tuple(
        MeshLevel(
            size=one.level.size / solved[-1].level.size,
            elements=one.found.elements,
            unknowns=one.body.unknowns,
            wall_s=one.found.wall,
        )
        for one in solved
    )
