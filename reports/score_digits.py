"""Digits of a score that its error leaves: what is known to a tenth has no thousandths."""

from __future__ import annotations

from collections.abc import Mapping
from math import floor, log10

from reports.digits import fixed
from study.results import Results

MOST = 4
"""Decimals of a score that is known to more."""
UNKNOWN = 2
"""Decimals at most where a part of the error is not known."""
NOT_RESOLVED = "n. r."
LARGEST = 0.5
"""Error from which on a score, between 0 and 1, says nothing."""
Key = tuple[str, str, str, str, str]
"""Model, reference, control point, curve and measure."""


def decimals(error: float | None, least: float = 0.0) -> int:
    """Decimals down to the first digit of an error; of `least` where it is not known."""
    shown = max(least, error or 0.0)
    found = MOST if shown < 0.5 * 10.0**-MOST else min(MOST, max(0, -floor(log10(shown))))
    return min(found, UNKNOWN) if error is None else found


def score_decimals(results: Results) -> dict[Key, int | None]:
    """Decimals of each score by what it is of, None where its error leaves none.

    The error is the sum of the relative errors of both curves, or the change with every second
    sample if that is larger: exact for the relative L2 score, a yardstick for other measures.
    """
    found: dict[Key, int | None] = {}
    for row in results.score_errors:
        key = (row.model, row.reference, row.probe, row.curve, row.measure)
        is_known = max(row.resampled, row.numerical or 0.0) < LARGEST
        found[key] = decimals(row.numerical, row.resampled) if is_known else None
    return found


def printed_score(score: float, found: Mapping[Key, int | None], key: Key) -> str:
    """A score to the digits that its error leaves, or that it leaves none."""
    places = found.get(key, UNKNOWN)
    return NOT_RESOLVED if places is None else fixed(score, places)
