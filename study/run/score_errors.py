"""Rows on the parts of scores, their uncertainty, and the ranks that these leave."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from study.problem.response import Motion, Response
from study.problem.trajectory import Trajectory
from study.results.numerical import numerical_errors, whole_error
from study.results.records import ModelRecord
from study.results.tables import (
    Iso18571Rating,
    Key,
    ScoreDifference,
    ScoreError,
    SimilarityScore,
    paired,
)
from study.similarity import batch
from study.similarity.ranks import rank_ranges
from study.similarity.uncertainty import Variants, spread, variants

Place = tuple[str, str, str, str]
"""Reference, control point, curve and measure: scores are ranked within one place."""
Ranks = dict[tuple[str, Place], tuple[int, int]]
ISO = "iso-18571"


def rating_rows(
    response: Response, runs: Mapping[str, Trajectory], scores: Sequence[SimilarityScore]
) -> Iterator[Iso18571Rating]:
    """The parts of each ISO/TS 18571 score."""
    for row in scores:
        if row.measure == ISO:
            found = (_motion(response, runs, name, row.probe) for name in row[:2])
            parts = batch.iso_18571_parts(*(getattr(motion, row.curve) for motion in found))
            yield Iso18571Rating(*row[:4], *parts)


def error_rows(
    response: Response,
    runs: Mapping[str, Trajectory],
    records: Sequence[ModelRecord],
    scores: Sequence[SimilarityScore],
) -> tuple[tuple[ScoreError, ...], tuple[ScoreDifference, ...]]:
    """The uncertainty and ranks of each score, and each difference between two models."""
    named, rows = {record.name: record for record in records}, dict[Key, list[SimilarityScore]]()
    for row in scores:
        rows.setdefault(row[:3], []).append(row)
    found = {
        (model, reference, probe): variants(
            _motion(response, runs, model, probe), _motion(response, runs, reference, probe)
        )
        for model, reference, probe in rows
    }
    differences = tuple(
        row
        for one, other in paired(list(rows))
        for row in _differences(rows[one], rows[other], found[one] - found[other], named)
    )
    ranks = _ranks(scores, differences)
    errors = (row for key in rows for row in _errors(rows[key], found[key], named, ranks))
    return tuple(errors), differences


def _motion(response: Response, runs: Mapping[str, Trajectory], name: str, probe: str) -> Motion:
    return response.motion(runs[name], response.probes.index(probe))


def _differences(
    one: Sequence[SimilarityScore],
    other: Sequence[SimilarityScore],
    found: Variants,
    records: Mapping[str, ModelRecord],
) -> Iterator[ScoreDifference]:
    for a, b, *parts in zip(one, other, *spread(found), strict=True):
        apart = a.score - b.score
        half, resampled, window, normalised = map(float, parts)
        yield ScoreDifference(
            model=a.model,
            other=b.model,
            reference=a.reference,
            probe=a.probe,
            curve=a.curve,
            measure=a.measure,
            difference=apart,
            low=max(apart - half, -1.0),
            high=min(apart + half, 1.0),
            resampled=resampled,
            window=window,
            normalised=normalised,
            numerical=_numerical(records, a, b),
        )


def _errors(
    rows: Sequence[SimilarityScore],
    found: Variants,
    records: Mapping[str, ModelRecord],
    ranks: Ranks,
) -> Iterator[ScoreError]:
    for row, *parts in zip(rows, *spread(found), strict=True):
        half, resampled, window, normalised = map(float, parts)
        first, last = ranks[row.model, row[1:5]]
        yield ScoreError(
            model=row.model,
            reference=row.reference,
            probe=row.probe,
            curve=row.curve,
            measure=row.measure,
            low=max(row.score - half, 0.0),
            high=min(row.score + half, 1.0),
            resampled=resampled,
            window=window,
            normalised=normalised,
            numerical=_numerical(records, row),
            first_rank=first,
            last_rank=last,
        )


def _numerical(records: Mapping[str, ModelRecord], *rows: SimilarityScore) -> float | None:
    """Sum of the relative errors of the curves that these scores compare."""
    reference, models = records[rows[0].reference], [records[row.model] for row in rows]
    return whole_error(numerical_errors(reference, models, rows[0].probe, rows[0].curve))


def _ranks(scores: Sequence[SimilarityScore], differences: Sequence[ScoreDifference]) -> Ranks:
    """First and last possible rank of each score within its place."""
    better = {
        (row.model, row.other, row[2:6])
        if row.difference > 0.0
        else (row.other, row.model, row[2:6])
        for row in differences
        if row.is_resolved
    }
    ranks: Ranks = {}
    for place in dict.fromkeys(row[1:5] for row in scores):
        models = [row.model for row in scores if row[1:5] == place]
        table = np.array([[(a, b, place) in better for b in models] for a in models])
        ranks |= {
            (model, place): both for model, both in zip(models, rank_ranges(table), strict=True)
        }
    return ranks
