"""Checks of a run against the error that its scene requires, by the run's own error estimates.

These are estimates with their factors of safety, not bounds. A lattice under a single load of given
force has no error estimate of its own; it is checked by its difference from finite elements that
have one. Under moved tools or several loads it has an estimate of its discretisation error, taken
with the factor of a plan and not with that of the stated error bar, which is to cover nearly all
errors; the error of the spring model itself is then not included. Hyperelastic elements are checked
by the errors of their mesh and steps, linear ones not at all.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from study.models.model import ModelRun
from study.models.spacing_error import ESTIMATE
from study.results.records import Check, CurveErrors, ModelRecord, SpacingErrors
from study.scene import Require, Scene
from study.similarity.fields import relative_l2_of_curves


def requirement_checks(
    scene: Scene, probes: tuple[str, ...], runs: Mapping[str, ModelRun]
) -> Iterator[Check]:
    """A check of each model whose error at the control points is known, if one is required."""
    required = scene.require
    if required is None or required.error is None:
        return
    reference = runs.get("fem")
    for name, run in runs.items():
        if run is reference and len(runs) > 1:
            continue
        found = _errors(run, reference, probes)
        chosen = [found[probe] for probe in required.at or probes if probe in found]
        if chosen and set(required.quantities) != {"peak-force"}:
            yield _check(name, max(chosen), required)
        if "peak-force" in required.quantities:
            yield from _force_check(name, run, required)


def _check(name: str, error: float, required: Require) -> Check:
    where = ", ".join(required.at) or "any control point"
    return Check(
        name=f"{name}: require.error",
        value=error,
        limit=float(required.error or 0.0),
        meaning=f"the run's own estimate of its displacement's error at {where}, relative L2",
    )


def _force_check(name: str, run: ModelRun, required: Require) -> Iterator[Check]:
    """A check of the largest force of any tool, where its error is known."""
    lost = run.trajectory.status != "finished"
    errors = _force_errors(run.record)
    if errors or lost:
        yield Check(
            name=f"{name}: require.error of the largest force",
            value=float("inf") if lost else max(errors),
            limit=float(required.error or 0.0),
            meaning="the run's own estimate of the error of a tool's largest force, by the "
            "spacing or mesh and the steps",
        )


def _force_errors(record: ModelRecord) -> list[float]:
    """Sum of the estimated errors of each tool's force; none where one of them is unknown."""
    if record.spacing_errors is not None and record.tool_force_errors:
        by_steps, stated = record.tool_force_errors, record.spacing_errors
        return [_of_force(stated, e) + by_steps[tool] for tool, e in stated.peak_force.items()]
    elements = record.elements
    if elements is None or elements.law is None or elements.contact is None:
        return []
    parts = [(one.by_mesh, one.by_steps) for one in elements.contact.forces.values()]
    known = [a + b for a, b in parts if a is not None and b is not None]
    return known if len(known) == len(parts) else []


def _share_of_bar(stated: SpacingErrors) -> float:
    """The estimated error over a stated error bar, which has a larger factor."""
    return ESTIMATE / stated.safety_factor


def _of_force(stated: SpacingErrors, bar: float) -> float:
    """The estimated relative error of a force with this stated error bar.

    The bar of a force that falls with refinement is 1 - (1 + d)^-3, so its estimate is the same
    with the smaller exponent; other bars, 3 d, are scaled. Below one a bar may be either, and the
    former estimate is the larger.
    """
    share = _share_of_bar(stated)
    return 1.0 - float((1.0 - bar) ** share) if bar < 1.0 else share * bar


def _errors(run: ModelRun, reference: ModelRun | None, probes: tuple[str, ...]) -> dict[str, float]:
    """Sum of the estimated displacement errors by control point; empty where they are unknown."""
    if run.trajectory.status != "finished":
        return dict.fromkeys(probes, float("inf"))
    record = run.record
    if record.elements is not None and record.elements.law is not None:
        return _stated(record, None, probes)
    if record.correction is not None:
        return _stated(record, record.correction.remainder_errors, probes)
    if record.spacing_errors is not None:
        by_spacing, by_steps = record.spacing_errors.displacement, record.time_step_errors
        share = _share_of_bar(record.spacing_errors)
        return {
            p: share * by_spacing[p] + by_steps[p].displacement for p in probes if p in by_steps
        }
    if record.lattice is not None and reference is not None and reference is not run:
        own = _stated(reference.record, None, probes)
        curves, truth = run.trajectory.displacement, reference.trajectory.displacement
        apart = relative_l2_of_curves(curves - truth, truth)
        return {p: own[p] + float(apart[i]) for i, p in enumerate(probes) if p in own}
    return {}  # linear elements have no estimate of the effect of large displacements


def _stated(
    record: ModelRecord, remainder: dict[str, CurveErrors] | None, probes: tuple[str, ...]
) -> dict[str, float]:
    """Errors by mesh, by steps and, of a corrected lattice, by spacing, where all are known."""
    mesh = record.mesh_error
    parts = [None if mesh is None else mesh.by_probe, record.time_step_errors]
    parts += [] if remainder is None else [remainder]
    return {
        probe: sum(part[probe].displacement for part in parts if part is not None)
        for probe in probes
        if all(part is not None and probe in part for part in parts)
    }
