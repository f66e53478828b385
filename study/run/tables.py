"""Rows of the result tables: curves, bands, bounds, similarity, differences of the field."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from study.problem.response import Response
from study.problem.trajectory import Trajectory
from study.results.tables import (
    BandSample,
    CertifiedSample,
    CurveSample,
    FieldDifference,
    SimilarityScore,
    pairs,
)
from study.similarity.fields import best_factor, norm, relative_l2
from study.similarity.score import scores

Floats = NDArray[np.float64]


def curve_rows(response: Response, runs: Mapping[str, Trajectory]) -> Iterator[CurveSample]:
    """The finite samples of each model at each control point."""
    for model, trajectory in runs.items():
        for i, probe in enumerate(response.probes):
            motion = response.motion(trajectory, i)
            for t, u, v in zip(motion.time, motion.displacement, motion.velocity, strict=True):
                if np.isfinite(u) and np.isfinite(v):
                    yield CurveSample(model, probe, float(t), float(u), float(v))


def band_rows(response: Response, model: str, bounds: Sequence[Trajectory]) -> Iterator[BandSample]:
    """Samples of the runs at the lower and the upper bound of the stiffness interval."""
    for i, probe in enumerate(response.probes):
        lower, upper = (response.motion(bound, i) for bound in bounds)
        columns = (lower.displacement, upper.displacement, lower.velocity, upper.velocity)
        for t, *values in zip(response.times, *columns, strict=True):
            if np.isfinite(values).all():
                yield BandSample(model, probe, float(t), *map(float, values))


def certified_rows(response: Response, model: str, bounds: Floats) -> Iterator[CertifiedSample]:
    """Samples of a bound [m] (samples, probes)."""
    for probe, bound in zip(response.probes, bounds.T, strict=True):
        for t, value in zip(response.times, bound, strict=True):
            yield CertifiedSample(model, probe, float(t), float(value))


def similarity_rows(
    response: Response, runs: Mapping[str, Trajectory], references: Sequence[str]
) -> tuple[tuple[SimilarityScore, ...], tuple[str, ...]]:
    """Scores of all pairs that finished, and a note on each pair that cannot be scored."""
    rows: list[SimilarityScore] = []
    notes: list[str] = []
    for model, reference in pairs(list(runs), references):
        for i, probe in enumerate(response.probes):
            candidate, truth = (response.motion(runs[name], i) for name in (model, reference))
            try:
                found = scores(candidate, truth)
            except ValueError as error:
                notes.append(f"No score of {model} against {reference} at {probe}: {error}.")
                continue
            pair = (model, reference, probe)
            rows += [SimilarityScore(*pair, one.curve, one.measure, one.value) for one in found]
    return tuple(rows), tuple(notes)


def difference_rows(
    response: Response, runs: Mapping[str, Trajectory], references: Sequence[str]
) -> Iterator[FieldDifference]:
    """Differences of the displacement field over the organ, at the peak and at the end."""
    for model, reference in pairs(list(runs), references):
        field, truth = runs[model].volume_field, runs[reference].volume_field
        if np.isfinite(field).all() and np.isfinite(truth).all():
            for quantity, value in _differences(field, truth, response.volumes):
                yield FieldDifference(model, reference, quantity, value)


def _differences(field: Floats, truth: Floats, volumes: Floats) -> Iterator[tuple[str, float]]:
    """Quantities of two fields (frames, q, 3), the first frame that of the peak."""
    for frame, name in ((0, "peak"), (-1, "final")):
        yield f"field-relative-l2-{name}", relative_l2(field[frame], truth[frame], volumes)
    share = norm(field[-1] - truth[-1], volumes) / norm(truth[0], volumes)
    yield "field-l2-final-over-peak", share
    factor = best_factor(field[0], truth[0], volumes)
    yield "field-best-factor-peak", factor
    yield (
        "field-relative-l2-peak-at-best-factor",
        relative_l2(factor * field[0], truth[0], volumes),
    )
