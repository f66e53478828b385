"""What a reader of the results must be told before the numbers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from study.models.linear_limits import ROTATION_LIMIT, STRAIN_LIMIT
from study.results.records import Check, ElementsRecord, ModelRecord
from study.scene import Scene


def warnings(
    scene: Scene, models: Sequence[ModelRecord], checks: Sequence[Check]
) -> tuple[str, ...]:
    """Sentences on models outside what they are good for, and on checks that failed."""
    of_models = (text for record in models for text in _of_model(scene, record))
    failed = (
        f"Check failed: {check.name} is {check.value:.2g}, its limit {check.limit:g}."
        for check in checks
        if not check.passed
    )
    return tuple(dict.fromkeys((*of_models, *failed)))  # two may stand on one mesh


def _of_model(scene: Scene, record: ModelRecord) -> Iterator[str]:
    if record.elements is not None:
        if record.lattice is None:  # which adds what is not linear
            yield from _of_linear(record, record.elements)
        yield from _of_mesh(scene, record.elements)
    if record.status == "diverged":
        yield (
            f"{record.name} diverged at {record.diverged_at_s:g} s: it has no scores. "
            f"{_remedy(scene)}"
        )
    if record.inverted_cells:
        yield (
            f"{record.inverted_cells} cells of {record.name} turned inside out: springs "
            "do not resist that, so it has no scores. Reduce tool.force."
        )


def _of_linear(record: ModelRecord, elements: ElementsRecord) -> Iterator[str]:
    strain, rotation = record.largest_strain, elements.largest_rotation_rad
    if strain is not None and strain > STRAIN_LIMIT:
        yield (
            f"The largest strain of {_name(record)} is {100 * strain:.1f} %; above "
            f"{100 * STRAIN_LIMIT:.0f} % it should not be trusted{_at_large_strain(elements)}. "
            "Reduce tool.force or enlarge tool.radius."
        )
    if rotation is not None and rotation > ROTATION_LIMIT:
        yield (
            f"The linear reference turns by up to {rotation:.2f} rad; above {ROTATION_LIMIT:g} "
            "it should not be trusted. Reduce tool.force or hold the organ better."
        )


def _of_mesh(scene: Scene, elements: ElementsRecord) -> Iterator[str]:
    if elements.accuracy_missed and elements.mesh_error:
        yield (
            f"reference.accuracy asks for {100 * elements.accuracy_missed:.2g} %; the finest "
            f"mesh of {elements.elements} tetrahedra, the last within the limit, reaches "
            f"{100 * elements.mesh_error.worst.displacement:.2g} %. {_more_accurate(scene)}"
        )


def _more_accurate(scene: Scene) -> str:
    """What brings the reference nearer to the accuracy that is asked for."""
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


def _remedy(scene: Scene) -> str:
    """What keeps a run from diverging."""
    lattice = scene.lattice
    for key, value in (("time_step", lattice.time_step), ("step_rate", lattice.step_rate)):
        if value is not None:
            verb = "Shorten" if key == "time_step" else "Raise"
            return f"{verb} lattice.{key}, or leave it out so that steps follow the limit."
    return "Reduce lattice.step_fraction or the load."
