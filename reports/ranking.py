"""Which fuzzy system scored highest, by how much, and whether the numerics resolve it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from study.results import Results
from study.results.numerical import numerical_errors
from study.results.tables import ScoreDifference

Column = tuple[str, str]


Ranks = dict[str, dict[Column, tuple[int, int]]]
"""First and last rank of each model by column."""


@dataclass(frozen=True)
class Lead:
    """Lead of the best fuzzy-tuned model over the next, for one reference, probe and measure.

    `margin`: difference of their scores; `low` and `high`: its 95 % block interval, the same blocks
    left out of both; `resampled`: its change with every second sample; `observed`: the larger of
    its range over windows and its change with other axes of the phase plane. `error` is the sum of
    the relative numerical errors of the three curves compared, at the probe; `is_whole` says
    whether all of them are known.
    """

    reference: str
    column: Column
    best: str
    runner_up: str
    margin: float
    low: float
    high: float
    resampled: float
    observed: float
    error: float | None
    is_whole: bool

    @property
    def hangs_on_view(self) -> bool:
        """Whether another window or other axes may take the lead away."""
        return self.margin <= self.observed

    @property
    def is_resolved(self) -> bool | None:
        """Whether the margin exceeds each error; None if the numerical one is not fully known."""
        if self.low <= 0.0 or self.margin <= self.resampled:
            return False
        if self.error is not None and self.margin <= self.error:
            return False
        return True if self.is_whole and self.error is not None else None


def references(results: Results) -> list[str]:
    """References that something was scored against, in order of appearance."""
    return list(dict.fromkeys(row.reference for row in results.scores))


def columns(results: Results) -> list[Column]:
    """Columns of the scores, curve and measure, in order of appearance."""
    return list(dict.fromkeys((row.curve, row.measure) for row in results.scores))


def score_table(results: Results, reference: str, probe: str) -> dict[str, dict[Column, float]]:
    """Scores against a reference at a probe, by model and column."""
    table: dict[str, dict[Column, float]] = {}
    for row in results.scores:
        if row.reference == reference and row.probe == probe:
            table.setdefault(row.model, {})[row.curve, row.measure] = row.score
    return table


def rank_table(results: Results, reference: str, probe: str) -> Ranks:
    """Ranks against a reference at a probe, of all models scored there."""
    table: Ranks = {}
    for row in results.score_errors:
        if row.reference == reference and row.probe == probe:
            both = (int(row.first_rank), int(row.last_rank))
            table.setdefault(row.model, {})[row.curve, row.measure] = both
    return table


def times_first(ranks: dict[Column, tuple[int, int]]) -> tuple[int, int]:
    """By how many columns a model is alone at the first rank, and by how many it shares that."""
    alone = sum(both == (1, 1) for both in ranks.values())
    return alone, sum(first == 1 for first, _ in ranks.values()) - alone


def tool_probe(results: Results) -> str:
    """Control point nearest to where the tool touches, or the first one."""
    probes, fields = results.record.probes, results.fields
    if len(fields.get("probes", ())) != len(probes):
        return probes[0]
    distances = np.linalg.norm(fields["probes"] - fields["tool"][0], axis=1)
    return probes[int(np.argmin(distances))]


def leads(results: Results, reference: str, probe: str) -> Iterator[Lead]:
    """One lead per measure that scored at least two fuzzy-tuned models."""
    table = score_table(results, reference, probe)
    records = {model.name: model for model in results.record.models}
    tuned = {name: row for name, row in table.items() if records[name].system is not None}
    apart = _differences(results, reference, probe)
    for column in columns(results):
        scored = [(row[column], model) for model, row in tuned.items() if column in row]
        if len(scored) < 2:
            continue
        (score, best), (second, runner_up) = sorted(scored, reverse=True)[:2]
        compared = [records[model] for model in (best, runner_up)]
        parts = numerical_errors(records[reference], compared, probe, column[0])
        known = [part for part in parts if part is not None]
        paired = apart[best, runner_up, column]
        yield Lead(
            reference=reference,
            column=column,
            best=best,
            runner_up=runner_up,
            margin=score - second,
            low=paired.low,
            high=paired.high,
            resampled=paired.resampled,
            observed=max(paired.window, paired.normalised),
            error=sum(known) if known else None,
            is_whole=len(known) == len(parts),
        )


def _differences(
    results: Results, reference: str, probe: str
) -> dict[tuple[str, str, Column], ScoreDifference]:
    """Differences by model, other and column, each both ways."""
    found: dict[tuple[str, str, Column], ScoreDifference] = {}
    for row in results.score_differences:
        if (row.reference, row.probe) == (reference, probe):
            column = (row.curve, row.measure)
            found[row.model, row.other, column] = row
            turned = row._replace(difference=-row.difference, low=-row.high, high=-row.low)
            found[row.other, row.model, column] = turned
    return found
