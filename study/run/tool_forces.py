"""Forces of rigid tools on each model: rows, scores and the largest force."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from study.models.model import ModelRun
from study.problem.response import Response, ToolCurve
from study.problem.trajectory import Trajectory
from study.results.records import ModelRecord, ToolForce
from study.results.tables import ToolForceSample, ToolForceScore, pairs
from study.similarity.score import TIME_HISTORY

FORCE = "force"
"""Name of the scored curve."""


def force_rows(response: Response, runs: Mapping[str, Trajectory]) -> Iterator[ToolForceSample]:
    """The finite samples of each model and tool."""
    for model, trajectory in runs.items():
        for number, tool in enumerate(response.tools):
            curve = response.tool_curve(trajectory, number)
            columns = (curve.time, curve.travel, curve.force, curve.tangential)
            for values in zip(*columns, strict=True):
                if np.isfinite(values).all():
                    yield ToolForceSample(model, tool.name, *map(float, values))


def force_scores(
    response: Response, runs: Mapping[str, Trajectory], references: Sequence[str]
) -> tuple[tuple[ToolForceScore, ...], tuple[str, ...]]:
    """Scores of the force over time for all pairs that finished, and a note on the others."""
    rows, notes = list[ToolForceScore](), list[str]()
    for model, reference in pairs(list(runs), references):
        for number, tool in enumerate(response.tools):
            one, other = (response.tool_curve(runs[n], number).force for n in (model, reference))
            why = _why_unscored(one, other)
            if why:
                notes.append(
                    f"No score of the force of {tool.name} in {model} against {reference}: {why}."
                )
                continue
            for measure in TIME_HISTORY:
                score = measure.score(one, other)
                rows.append(ToolForceScore(model, reference, tool.name, FORCE, measure.name, score))
    return tuple(rows), tuple(notes)


def _why_unscored(one: np.ndarray, other: np.ndarray) -> str:
    if not (np.isfinite(one).all() and np.isfinite(other).all()):
        return "one of the two has no force up to the end"
    return "" if other.any() else "the reference feels none"


def largest_forces(response: Response, runs: Mapping[str, ModelRun]) -> Iterator[ToolForce]:
    """The largest force of each tool in each model, over the part of the motion that exists."""
    for model, run in runs.items():
        for number, tool in enumerate(response.tools):
            curve = response.tool_curve(run.trajectory, number)
            if np.isnan(curve.force).all():  # the run ended before the first sample
                continue
            peak = int(np.nanargmax(np.abs(curve.force)))
            yield ToolForce(
                model=model,
                tool=tool.name,
                peak_n=float(curve.force[peak]),
                peak_at_s=float(curve.time[peak]),
                peak_travel_m=float(curve.travel[peak]),
                work_j=_work(curve),
                relative_error=_relative_error(run.record, tool.name),
                spacing_error=_spacing_error(run.record, tool.name),
            )


def _relative_error(record: ModelRecord, tool: str) -> float | None:
    """Relative error of a force over time: by steps of a lattice, by all parts of elements."""
    contact = None if record.elements is None else record.elements.contact
    if contact is None or tool not in contact.forces:
        return record.tool_force_errors.get(tool)
    found = contact.forces[tool]
    if found.by_mesh is None or found.by_steps is None:
        return None
    return found.by_mesh + found.by_steps + (found.by_subspace or 0.0)


def _spacing_error(record: ModelRecord, tool: str) -> float | None:
    errors = record.spacing_errors
    return None if errors is None else errors.tool_force[tool]


def _work(curve: ToolCurve) -> float:
    """Work along the axis up to the last finite sample, by the trapezoidal rule."""
    force, travel = curve.force, curve.travel
    kept = np.isfinite(force)
    return float(np.trapezoid(force[kept], travel[kept]))
