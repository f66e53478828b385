"""Rows of the result tables: curves, bands, similarity, field errors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from study.results import Row
from study.similarity.motion import Motion
from study.similarity.score import scores
from study.trajectory import Trajectory

Floats = NDArray[np.float64]

REFERENCES = ("fem", "basafa")


@dataclass(frozen=True)
class Lens:
    """How motion is looked at: times [s], names of the probes, unit vector of the tool's push.

    `volumes` [m^3] (q,) weigh the points of the volume field.
    """

    times: Floats
    probes: tuple[str, ...]
    direction: Floats
    volumes: Floats

    def motion(self, trajectory: Trajectory, probe: int) -> Motion:
        """Displacement and velocity of a probe along the push."""
        return Motion(
            self.times,
            trajectory.displacement[:, probe] @ self.direction,
            trajectory.velocity[:, probe] @ self.direction,
        )


def curve_rows(lens: Lens, runs: Mapping[str, Trajectory]) -> Iterator[Row]:
    """Finite samples of each model at each probe."""
    for model, trajectory in runs.items():
        for i, probe in enumerate(lens.probes):
            motion = lens.motion(trajectory, i)
            for t, u, v in zip(motion.time, motion.displacement, motion.velocity, strict=True):
                if np.isfinite(u) and np.isfinite(v):
                    yield model, probe, float(t), float(u), float(v)


def band_rows(lens: Lens, model: str, bounds: Sequence[Trajectory]) -> Iterator[Row]:
    """Samples of the runs at the lower and at the upper bound of the stiffness interval."""
    for i, probe in enumerate(lens.probes):
        lower, upper = (lens.motion(bound, i) for bound in bounds)
        columns = (lower.displacement, upper.displacement, lower.velocity, upper.velocity)
        for t, *values in zip(lens.times, *columns, strict=True):
            if np.isfinite(values).all():
                yield (model, probe, float(t), *map(float, values))


def pairs(models: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Candidate and reference: every model against the finite elements and the benchmark."""
    for reference in REFERENCES:
        for model in models:
            if reference in models and model not in REFERENCES[: REFERENCES.index(reference) + 1]:
                yield model, reference


def similarity_rows(lens: Lens, runs: Mapping[str, Trajectory], notes: list[str]) -> Iterator[Row]:
    """Scores of all pairs that finished; a pair that cannot be scored leaves a note instead."""
    for model, reference in pairs(list(runs)):
        for i, probe in enumerate(lens.probes):
            candidate, truth = lens.motion(runs[model], i), lens.motion(runs[reference], i)
            try:
                found = scores(candidate, truth)
            except ValueError as error:
                notes.append(f"No score of {model} against {reference} at {probe}: {error}.")
                continue
            for score in found:
                yield model, reference, probe, score.curve, score.measure, score.value


def error_rows(lens: Lens, runs: Mapping[str, Trajectory]) -> Iterator[Row]:
    """Differences of the displacement field over the organ, at the peak and at the end."""
    for model, reference in pairs(list(runs)):
        field, truth = runs[model].volume_field, runs[reference].volume_field
        if not (np.isfinite(field).all() and np.isfinite(truth).all()):
            continue
        for frame, name in ((0, "peak"), (-1, "final")):
            error = relative_l2(field[frame], truth[frame], lens.volumes)
            yield model, reference, f"field-relative-l2-{name}", error
        share = norm(field[-1] - truth[-1], lens.volumes) / norm(truth[0], lens.volumes)
        yield model, reference, "field-l2-final-over-peak", share
        factor = best_factor(field[0], truth[0], lens.volumes)
        left = relative_l2(factor * field[0], truth[0], lens.volumes)
        yield model, reference, "field-best-factor-peak", factor
        yield model, reference, "field-relative-l2-peak-at-best-factor", left


def norm(field: Floats, volumes: Floats) -> float:
    """L2 norm over the organ of a field (q, 3) at points that stand for `volumes` [m^3] (q,)."""
    return float(np.sqrt(volumes @ (field**2).sum(axis=1)))


def relative_l2(field: Floats, reference: Floats, volumes: Floats) -> float:
    """Relative L2 difference of two fields over the organ."""
    return norm(field - reference, volumes) / norm(reference, volumes)


def best_factor(field: Floats, reference: Floats, volumes: Floats) -> float:
    """Factor on a field that brings it nearest to the reference.

    A linear model at rest is softer by this factor if its stiffness is divided by it, so what is
    left at the best factor is what no estimate of one stiffness can remove.
    """
    product = volumes @ (field * reference).sum(axis=1)
    return float(product / norm(field, volumes) ** 2)
