"""Rows of the result tables: curves, bands, similarity, field errors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from study.problem.response import Response
from study.problem.trajectory import Trajectory
from study.results.folder import Row
from study.similarity.fields import best_factor, norm, relative_l2
from study.similarity.score import scores

Floats = NDArray[np.float64]

REFERENCES = ("fem", "basafa")


def curve_rows(response: Response, runs: Mapping[str, Trajectory]) -> Iterator[Row]:
    """Finite samples of each model at each probe."""
    for model, trajectory in runs.items():
        for i, probe in enumerate(response.probes):
            motion = response.motion(trajectory, i)
            for t, u, v in zip(motion.time, motion.displacement, motion.velocity, strict=True):
                if np.isfinite(u) and np.isfinite(v):
                    yield model, probe, float(t), float(u), float(v)


def band_rows(response: Response, model: str, bounds: Sequence[Trajectory]) -> Iterator[Row]:
    """Samples of the runs at the lower and at the upper bound of the stiffness interval."""
    for i, probe in enumerate(response.probes):
        lower, upper = (response.motion(bound, i) for bound in bounds)
        columns = (lower.displacement, upper.displacement, lower.velocity, upper.velocity)
        for t, *values in zip(response.times, *columns, strict=True):
            if np.isfinite(values).all():
                yield (model, probe, float(t), *map(float, values))


def pairs(models: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Candidate and reference: every model against the finite elements and the benchmark."""
    for reference in REFERENCES:
        for model in models:
            if reference in models and model not in REFERENCES[: REFERENCES.index(reference) + 1]:
                yield model, reference


def similarity_rows(
    response: Response, runs: Mapping[str, Trajectory], notes: list[str]
) -> Iterator[Row]:
    """Scores of all pairs that finished; a pair that cannot be scored leaves a note instead."""
    for model, reference in pairs(list(runs)):
        for i, probe in enumerate(response.probes):
            candidate, truth = response.motion(runs[model], i), response.motion(runs[reference], i)
            try:
                found = scores(candidate, truth)
            except ValueError as error:
                notes.append(f"No score of {model} against {reference} at {probe}: {error}.")
                continue
            for score in found:
                yield model, reference, probe, score.curve, score.measure, score.value


def error_rows(response: Response, runs: Mapping[str, Trajectory]) -> Iterator[Row]:
    """Differences of the displacement field over the organ, at the peak and at the end."""
    for model, reference in pairs(list(runs)):
        field, truth = runs[model].volume_field, runs[reference].volume_field
        if not (np.isfinite(field).all() and np.isfinite(truth).all()):
            continue
        for frame, name in ((0, "peak"), (-1, "final")):
            error = relative_l2(field[frame], truth[frame], response.volumes)
            yield model, reference, f"field-relative-l2-{name}", error
        share = norm(field[-1] - truth[-1], response.volumes) / norm(truth[0], response.volumes)
        yield model, reference, "field-l2-final-over-peak", share
        factor = best_factor(field[0], truth[0], response.volumes)
        left = relative_l2(factor * field[0], truth[0], response.volumes)
        yield model, reference, "field-best-factor-peak", factor
        yield model, reference, "field-relative-l2-peak-at-best-factor", left
