"""Conditions under which two motions of a control point can be compared."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from study.problem.response import Motion

Floats = NDArray[np.float64]

SAMPLE_MINIMUM = 8
# SI sizes no organ reaches; between them, squares and products of samples stay in double range.
LARGEST, SMALLEST = 1e30, 1e-30


def check_pair(candidate: Motion, reference: Motion) -> None:
    """Raise ValueError, naming the curve at fault, unless the pair can be scored."""
    for role, motion in (("candidate", candidate), ("reference", reference)):
        _check_samples(role, motion)
    _check_times(candidate.time, reference.time)
    for name in ("displacement", "velocity"):
        _check_not_flat(name, getattr(reference, name))


def _check_samples(role: str, motion: Motion) -> None:
    count = np.size(motion.time)
    for name in ("time", "displacement", "velocity"):
        values = np.asarray(getattr(motion, name))
        if values.shape != (count,):
            raise ValueError(
                f"{role} {name} has shape {values.shape}, its time {np.shape(motion.time)}: "
                "give one value per time"
            )
        bad = np.flatnonzero(~(np.abs(values) <= LARGEST))  # true for NaN as well
        if bad.size:
            raise ValueError(
                f"{role} {name} is {values[bad[0]]} at sample {bad[0]}: a run that diverged or is "
                "not finished has no score; report when it ended instead"
            )


def _check_times(candidate: Floats, reference: Floats) -> None:
    if len(candidate) != len(reference):
        raise ValueError(
            f"candidate has {len(candidate)} samples, reference {len(reference)}: "
            "sample both at the same times"
        )
    if len(reference) < SAMPLE_MINIMUM:
        raise ValueError(
            f"curves have {len(reference)} samples: record at least {SAMPLE_MINIMUM} for a score"
        )
    step = (reference[-1] - reference[0]) / (len(reference) - 1)
    uniform = np.linspace(reference[0], reference[-1], len(reference))
    # A millionth of a step: far above rounding of a time axis, far below any shift that matters.
    if step <= 0 or np.max(np.abs(reference - uniform)) > 1e-6 * step:
        raise ValueError("reference time is not uniform and increasing: sample at equal steps")
    if np.max(np.abs(candidate - reference)) > 1e-6 * step:
        raise ValueError("candidate and reference times differ: sample both at the same times")


def _check_not_flat(name: str, values: Floats) -> None:
    if np.ptp(values) <= max(SMALLEST, 1e-12 * np.max(np.abs(values))):
        raise ValueError(
            f"reference {name} is flat (constant {values[0]:g}), so no measure relative to it is "
            "defined: choose a control point that moves"
        )
