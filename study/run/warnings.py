"""Warnings that a reader of the results needs before the numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from study.models.errors import VELOCITY_LIMIT
from study.models.linear_limits import ROTATION_LIMIT, STRAIN_LIMIT
from study.results.records import Check, ElementsRecord, ModelRecord, largest
from study.scene import Scene
from study.scene.schema import Tool

OVERLAP = 0.01
"""Overlap of a body and a tool, relative to the tool's travel, above which it is reported."""
UNKNOWN = 0.25
"""Stated discretisation error of the finite elements above which a warning is given."""
FINE = 2.0
"""Tool radius over lattice spacing below which contact is reported as coarse."""


def warnings(
    scene: Scene, models: Sequence[ModelRecord], checks: Sequence[Check]
) -> tuple[str, ...]:
    """Sentences on models outside their range of validity, and on checks that failed."""
    of_models = (text for record in models for text in _model_warnings(scene, record))
    failed = (
        f"Check failed: {check.name} is {check.value:.2g}, its limit {check.limit:g}."
        for check in checks
        if not check.passed
    )
    return tuple(dict.fromkeys((*of_models, *failed)))  # models on one mesh share warnings


def _model_warnings(scene: Scene, record: ModelRecord) -> Iterator[str]:
    if record.elements is not None:
        if record.lattice is None:  # a corrected lattice adds the nonlinear part
            yield from _linear_limit_warnings(scene, record, record.elements)
        yield from _mesh_warnings(scene, record.elements)
    if record.status == "diverged":
        yield (
            f"{record.name} diverged at {record.ended_at_s:g} s: it has no scores. "
            f"{_remedy(scene, record)}"
        )
    if record.status == "not finished":
        yield (
            f"{record.name} is not finished: {record.reason}. It has no scores. To have it run, "
            f"{record.remedy}."
        )
    if record.inverted_cells:
        yield (
            f"{record.inverted_cells} cells of {record.name} turned inside out: springs "
            f"do not resist that, so it has no scores. {_smaller_load(scene)}"
        )
    yield from _tool_warnings(scene, record)


def _smaller_load(scene: Scene) -> str:
    """The remedy that deforms a lattice less."""
    return "Move the tools less far." if _moved_tools(scene) else "Reduce tool.force."


def _moved_tools(scene: Scene) -> list[Tool]:
    return [tool for tool in scene.tools if tool.is_moved]


def _travel(tool: Tool) -> float:
    """Largest displacement of a tool [m]."""
    if tool.displacement is not None:
        return abs(tool.displacement)
    ways = ((point.travel,) if point.offset is None else point.offset for point in tool.path)
    return max(math.hypot(*(part or 0.0 for part in way)) for way in ways)


def _tool_warnings(scene: Scene, record: ModelRecord) -> Iterator[str]:
    """On overlaps with tools, a lattice too coarse for them, and velocities that they make jump."""
    for tool in _moved_tools(scene):
        travel, overlap = _travel(tool) or tool.radius, record.tool_overlap_m or 0.0
        if overlap > OVERLAP * travel:
            yield (
                f"The body of {record.name} overlaps its tools by up to {1e3 * overlap:.2g} mm, "
                f"{100 * overlap / travel:.1f} % of the travel. Shorten the steps "
                "(lattice.step_fraction), or give the tool more time."
            )
        if record.lattice is not None and scene.lattice.springs == "lattice":
            yield from _coarse_contact_warnings(scene, tool)
    error = largest(record.time_step_errors).velocity if record.time_step_errors else 0.0
    if _moved_tools(scene) and error > VELOCITY_LIMIT:
        yield (
            f"The velocity of {record.name} at the samples is in error by {100 * error:.2g} % by "
            "the time step: it jumps where a tool reaches or leaves a point, and a sample beside a "
            "jump may miss all of it. Take this error into account in scores of velocity; only "
            "means between samples are checked."
        )


def _coarse_contact_warnings(scene: Scene, tool: Tool) -> Iterator[str]:
    cells = tool.radius / scene.lattice.spacing
    if tool.shape != "plate" and cells < FINE:
        yield (
            f"The radius of a tool, {1e3 * tool.radius:.3g} mm, is {cells:.2g} times the spacing "
            f"of the lattice; below {FINE:g} its force is that of the lattice's own facets. Reduce "
            "lattice.spacing."
        )


def _linear_limit_warnings(
    scene: Scene, record: ModelRecord, elements: ElementsRecord
) -> Iterator[str]:
    if elements.law is not None:
        return
    strain, rotation = record.largest_strain, elements.largest_rotation_rad
    if strain is not None and strain > STRAIN_LIMIT:
        yield (
            f"The largest strain of {_name(record)} is {100 * strain:.1f} %; above "
            f"{100 * STRAIN_LIMIT:.0f} % it should not be trusted{_at_large_strain(elements)}. "
            f"{_smaller_load(scene)[:-1]} or enlarge tool.radius."
        )
    if rotation is not None and rotation > ROTATION_LIMIT:
        yield (
            f"The linear reference turns by up to {rotation:.2f} rad; above {ROTATION_LIMIT:g} "
            f"it should not be trusted. {_smaller_load(scene)[:-1]} or hold the organ better."
        )


def _mesh_warnings(scene: Scene, elements: ElementsRecord) -> Iterator[str]:
    if elements.accuracy_missed and elements.mesh_error:
        yield (
            f"reference.accuracy asks for {100 * elements.accuracy_missed:.2g} %; the finest "
            f"mesh of {elements.elements} tetrahedra, the last within the limit, reaches "
            f"{100 * elements.mesh_error.worst.displacement:.2g} %. {_more_accurate(scene)}"
        )
    elif elements.mesh_error and elements.mesh_error.worst.displacement > UNKNOWN:
        yield (
            "The finite elements state an error of "
            f"{100 * elements.mesh_error.worst.displacement:.2g} %, as their meshes are too coarse "
            "to resolve a smaller one. Set reference.accuracy, or reduce reference.element_size."
        )


def _more_accurate(scene: Scene) -> str:
    """The remedies that bring the reference closer to the requested accuracy."""
    graded = "" if scene.is_graded else 'set reference.refinement to "graded", '
    return f"Ask for less, {graded}enlarge tool.radius, or give the run more free memory."


def _name(record: ModelRecord) -> str:
    return "the linear reference" if record.name == "fem" else f"{record.name}, which is linear,"


def _at_large_strain(elements: ElementsRecord) -> str:
    found = elements.large_strain
    if found is None:
        return ""
    share = 100 * found.field_difference
    return f", and at rest it differs by {share:.1f} % from a {found.law} solid"


def _remedy(scene: Scene, record: ModelRecord) -> str:
    """The remedy for a run that diverged."""
    if record.lattice is None and _moved_tools(
        scene
    ):  # finite elements whose contact iteration failed
        return "Move the tools less far, or reduce reference.element_size."
    lattice = scene.lattice
    for key, value in (("time_step", lattice.time_step), ("step_rate", lattice.step_rate)):
        if value is not None:
            verb = "Shorten" if key == "time_step" else "Raise"
            return f"{verb} lattice.{key}, or leave it out so that steps follow the limit."
    return (
        f"Reduce lattice.step_fraction. {_smaller_load(scene)}"
        if _moved_tools(scene)
        else "Reduce lattice.step_fraction or the load."
    )
