"""Errors of a configuration against its reference, where they exceed the reference's own error."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from study.models.spacing_error import force_differences
from study.run.scene_problem import SceneProblem
from study.similarity.fields import relative_l2, relative_l2_of_curves
from study.sweep.canonical import restored
from study.sweep.runner import Outcome
from study.tradeoff.observation import Observed
from study.tradeoff.reference import ReferenceSolution

Floats = NDArray[np.float64]
Status = Literal[
    "resolved", "not resolved", "diverged", "unstable", "inverted", "failed", "crashed"
]


@dataclass(frozen=True)
class Errors:
    """Relative L2 errors, None where there is none or it is not resolved.

    Of the displacement: `field` over the organ at the peak; `tool` of the curve of the control
    point at the tool and `worst` of any control point. Of the force on moved tools, the largest of
    any: `force` over time and `peak_force`, and `discretisation` of it over time against the finest
    lattice of the same springs. `of_force`: whether the force is the criterion of the
    configuration. `status` refers to the criterion; `message` states what went wrong.
    """

    status: Status
    field: float | None = None
    tool: float | None = None
    worst: float | None = None
    message: str = ""
    force: float | None = None
    peak_force: float | None = None
    discretisation: float | None = None
    of_force: bool = False

    @property
    def judged(self) -> float | None:
        """The error that is the criterion."""
        return self.force if self.of_force else self.field


def errors(outcome: Outcome, reference: ReferenceSolution, given: SceneProblem) -> Errors:
    """Errors of one run of `study.tradeoff.observation`."""
    if outcome.status != "done" or outcome.value is None:
        status: Status = "crashed" if outcome.status == "crashed" else "failed"
        return Errors(status, message=outcome.message)
    found = restored(Observed, outcome.value)
    if found.field is None or found.curves is None:
        return Errors("diverged", message=f"at {found.ended_at_s:.3g} s")
    if found.margin is not None and found.margin < 1.0:
        return Errors("unstable", message=f"step {1.0 / found.margin:.3g} times the critical one")
    if found.inverted_cells:
        return Errors("inverted", message=f"{found.inverted_cells} cells")
    measured = _measured(np.reshape(found.field, (-1, 3)), np.array(found.curves), reference, given)
    if not given.problem.rigid_tools:
        return measured
    return _of_force(
        measured, np.reshape(found.force or [], reference.force.shape), reference, given
    )


def _of_force(
    measured: Errors, found: Floats, reference: ReferenceSolution, given: SceneProblem
) -> Errors:
    """Add the errors of the force, which is then the criterion."""
    over_time, peak = force_differences(given.problem, found, reference.force).max(axis=1)
    kept = resolved(over_time, float(reference.force_errors.max()))
    return replace(
        measured,
        status="not resolved" if kept is None else "resolved",
        force=kept,
        peak_force=resolved(peak, float(reference.peak_errors.max())),
        of_force=True,
    )


def _measured(
    found: Floats, moved: Floats, reference: ReferenceSolution, given: SceneProblem
) -> Errors:
    volumes = given.problem.volume_rule.weights
    field = relative_l2(found, reference.field, volumes)
    moved = moved.reshape(reference.curves.shape)
    curves = relative_l2_of_curves(moved - reference.curves, reference.curves)
    known = [resolved(c, bar) for c, bar in zip(curves, reference.curve_errors, strict=True)]
    kept = resolved(field, reference.field_error)
    return Errors(
        "not resolved" if kept is None else "resolved",
        kept,
        known[given.problem.tool_probe],
        max((c for c in known if c is not None), default=None),
    )


def resolved(error: float, bar: float) -> float | None:
    """The error, or None where it is below that of the reference."""
    return float(error) if error >= bar and error > 0.0 else None
