"""The measures by curve, and the scores of one motion against another.

Correlation and cosine are not among the measures: both are blind to amplitude. A candidate in
millimetres correlates perfectly with a reference in metres, and a damped oscillator that is 20 %
too stiff still reaches 0.994.

To add a measure, write one function of (candidate, reference) with values in [0, 1] and add one
line to `TIME_HISTORY` or `PHASE_PLANE`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from study.problem.response import Motion
from study.similarity.iso18571 import overall_rating
from study.similarity.motion import check_pair
from study.similarity.phase_plane import area_score, frechet_score, pcm_score
from study.similarity.time_history import relative_l2_score

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Measure:
    """`score` maps candidate and reference to [0, 1]; `formula` states it for a reader."""

    name: str
    formula: str
    score: Callable[[Floats, Floats], float]


@dataclass(frozen=True)
class Score:
    """`value` in [0, 1], 1 for equal curves, of one measure on one kind of curve."""

    curve: str
    measure: str
    value: float


TIME_HISTORY = (
    Measure(
        "relative-l2", "max(0, 1 - d); d = ||c - r|| / ||r|| over the samples", relative_l2_score
    ),
    Measure("iso-18571", "0.4 corridor + 0.2 (phase + magnitude + slope)", overall_rating),
)
PHASE_PLANE = (
    # Distances on axes divided by the reference's largest absolute value.
    Measure("frechet", "1 / (1 + d); d = discrete Fréchet distance", frechet_score),
    Measure("area", "1 / (1 + d); d = area between the curves, ends joined", area_score),
    Measure(
        "pcm", "1 / (1 + d); d = mean distance, shorter curve shifted along the longer", pcm_score
    ),
)
MEASURES: dict[str, tuple[Measure, ...]] = {
    "displacement": TIME_HISTORY,
    "velocity": TIME_HISTORY,
    "phase-plane": PHASE_PLANE,
}
FORMULAS: dict[str, str] = {m.name: m.formula for m in TIME_HISTORY + PHASE_PLANE}


def scores(candidate: Motion, reference: Motion) -> tuple[Score, ...]:
    """Scores of every measure on every kind of curve, in the order of `MEASURES`.

    Raises ValueError if the motions cannot be compared: samples that are not finite, different
    times, fewer than 8 samples, or a reference that does not move.
    """
    check_pair(candidate, reference)
    return tuple(
        Score(kind, measure.name, measure.score(curve(candidate, kind), curve(reference, kind)))
        for kind, measures in MEASURES.items()
        for measure in measures
    )


def curve(motion: Motion, kind: str) -> Floats:
    """Samples of one kind of curve: shape (samples,), or (samples, 2) for "phase-plane"."""
    if kind == "phase-plane":
        return np.column_stack([motion.displacement, motion.velocity])
    return motion.displacement if kind == "displacement" else motion.velocity
