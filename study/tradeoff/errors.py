"""How far a configuration is from the reference, where the reference can tell."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from study.run.stated import Stated
from study.similarity.fields import relative_l2, relative_l2_of_curves
from study.sweep.canonical import restored
from study.sweep.runner import Outcome
from study.tradeoff.observation import Observed
from study.tradeoff.reference import Truth

Floats = NDArray[np.float64]
Status = Literal[
    "resolved", "not resolved", "diverged", "unstable", "inverted", "failed", "crashed"
]


@dataclass(frozen=True)
class Errors:
    """Relative L2 errors of the displacement, None where there is none or it is not resolved.

    `field` over the organ at the peak; `tool` of the curve of the control point at the tool and
    `worst` of any control point. `status` is that of the field; `message` says what went wrong.
    """

    status: Status
    field: float | None = None
    tool: float | None = None
    worst: float | None = None
    message: str = ""


def errors(outcome: Outcome, reference: Truth, given: Stated) -> Errors:
    """Errors of one run of `study.tradeoff.observation`."""
    if outcome.status != "done" or outcome.value is None:
        status: Status = "crashed" if outcome.status == "crashed" else "failed"
        return Errors(status, message=outcome.message)
    found = restored(Observed, outcome.value)
    if found.field is None or found.curves is None:
        return Errors("diverged", message=f"at {found.diverged_at_s:.3g} s")
    if found.margin is not None and found.margin < 1.0:
        return Errors("unstable", message=f"step {1.0 / found.margin:.3g} times the critical one")
    if found.inverted_cells:
        return Errors("inverted", message=f"{found.inverted_cells} cells")
    return _measured(np.reshape(found.field, (-1, 3)), np.array(found.curves), reference, given)


def _measured(found: Floats, moved: Floats, reference: Truth, given: Stated) -> Errors:
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
    """The error, or None where it does not exceed that of the reference."""
    return float(error) if error > bar else None
