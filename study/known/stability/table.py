"""The verdicts as a table: stability.csv, and lines for a terminal.

Columns: family; case; expected (ending, and the tolerance of the difference or what a refusal
names); outcome (value, bounded, diverged, refused, or error for none of these); predicted and
measured, in SI units, empty where a case has none; difference of the two, relative unless the case
says otherwise; passed; message.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from pathlib import Path

from study.known.stability.case import Verdict

NAME = "stability.csv"
COLUMNS = (
    "family",
    "case",
    "expected",
    "outcome",
    "predicted",
    "measured",
    "difference",
    "passed",
    "message",
)


def write(verdicts: Iterable[Verdict], path: Path) -> None:
    """Write one row per case."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(_row(verdict) for verdict in verdicts)


def _row(verdict: Verdict) -> list[str]:
    case, found = verdict.case, verdict.finding
    numbers = ((found.predicted, 8), (found.measured, 8), (found.difference, 3))
    return [
        case.family,
        case.name,
        case.expectation,
        found.ending,
        *("" if number is None else f"{number:.{digits}g}" for number, digits in numbers),
        str(verdict.passed),
        found.message,
    ]


def lines(verdicts: Sequence[Verdict]) -> Iterator[str]:
    """A line per family, one per case that failed, and a sum."""
    for family, group in groupby(verdicts, key=lambda verdict: verdict.case.family):
        found = list(group)
        passed = sum(verdict.passed for verdict in found)
        yield f"{family:<16} {passed:>4} of {len(found):<4} as expected{_worst(found)}"
    failed = [verdict for verdict in verdicts if not verdict.passed]
    for verdict in failed:
        yield f"NOT AS EXPECTED: {verdict.case.family}: {verdict.case.name}: {_told(verdict)}"
    seconds = sum(verdict.seconds for verdict in verdicts)
    yield f"{len(verdicts) - len(failed)} of {len(verdicts)} cases as expected, {seconds:.0f} s"


def _worst(verdicts: Sequence[Verdict]) -> str:
    """The largest share of its tolerance that a case used up."""
    shares = [
        verdict.finding.difference / verdict.case.tolerance
        for verdict in verdicts
        if verdict.case.tolerance and verdict.finding.difference is not None
    ]
    return f", at most {max(shares):.0%} of a tolerance used" if shares else ""


def _told(verdict: Verdict) -> str:
    found = verdict.finding
    told = f"expected {verdict.case.expectation}; {found.ending}"
    if found.measured is not None:
        told += f", {found.measured:.6g} beside {found.predicted:.6g}"
    return f"{told}. {found.message}"
