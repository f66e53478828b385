"""Rows of what scores are made of, how well they are known and which ranks they leave."""

from __future__ import annotations

from collections.abc import Iterator

from reports.appearance import labels
from reports.digits import DASH, Table, fixed
from reports.ranking import columns, rank_table, references, times_first, tool_probe
from reports.tables import CURVE_NAMES, MEASURE_NAMES, tiny_too
from study.results import Results
from study.results.tables import ScoreError


def rank_rows(results: Results) -> Table:
    """Ranks at the tool: reference, model, a cell by measure, how often first alone and shared."""
    probe, named, heads = tool_probe(results), labels(results), columns(results)
    return [
        [
            named[reference],
            named[model],
            *(_rank(ranks.get(head)) for head in heads),
            *map(str, times_first(ranks)),
        ]
        for reference in references(results)
        for model, ranks in rank_table(results, reference, probe).items()
    ]


def _rank(both: tuple[int, int] | None) -> str:
    if both is None:
        return DASH
    first, last = both
    return str(first) if first == last else f"{first}–{last}"


def rating_rows(results: Results) -> Table:
    """Parts of the scores by ISO/TS 18571 at the tool: reference, model, four of each curve."""
    probe, named = tool_probe(results), labels(results)
    found: dict[tuple[str, str], list[str]] = {}
    for row in results.ratings:
        if row.probe == probe:
            cells = [fixed(part, 3) for part in row[4:]]
            found.setdefault((row.reference, row.model), []).extend(cells)
    return [[named[reference], named[model], *row] for (reference, model), row in found.items()]


def score_error_rows(results: Results) -> Table:
    """The largest of any model and control point: reference, curve, measure and parts."""
    named = labels(results)
    groups: dict[tuple[str, str, str], list[ScoreError]] = {}
    for row in results.score_errors:
        groups.setdefault((row.reference, row.curve, row.measure), []).append(row)
    return [
        [
            named[reference],
            CURVE_NAMES.get(curve, curve),
            MEASURE_NAMES.get(measure, measure),
            *_largest_parts(rows),
        ]
        for (reference, curve, measure), rows in groups.items()
    ]


def _largest_parts(rows: list[ScoreError]) -> Iterator[str]:
    """Width of the interval, then each part; a dash where any numerical error is not known."""
    yield tiny_too(max(row.high - row.low for row in rows))
    for name in ("resampled", "window", "normalised"):
        yield tiny_too(max(getattr(row, name) for row in rows))
    known = [row.numerical for row in rows if row.numerical is not None]
    yield tiny_too(max(known)) if len(known) == len(rows) else DASH
