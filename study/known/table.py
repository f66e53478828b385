"""Verdicts as tables: CSV files, JSON, and lines for a terminal.

verification.csv has a row per finding: problem and quantity; exact and ours, empty where a whole
field is compared; error, relative, of an order the difference; order, observed; limit of the error,
empty where nothing is judged; passed.

stability.csv has a row per case: family; case; expected (ending, and the tolerance of the
difference or what a refusal names); outcome (value, bounded, diverged, refused, or error for none
of these); predicted and measured, in SI units, empty where a case has none; difference of the two,
relative unless the case says otherwise; passed; message.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from pathlib import Path

from study.known.case import CaseVerdict
from study.known.finding import Finding
from study.system.folders import write_text

NAME = "stability.csv"
STABILITY = (
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
VERIFICATION = ("problem", "quantity", "exact", "ours", "error", "order", "limit", "passed")
WIDTHS = (58, 11, 11, 8, 5, 8)
OUTCOMES = {True: "pass", False: "FAIL", None: "noted"}


def write_stability(verdicts: Iterable[CaseVerdict], path: Path) -> None:
    """Write one row per case, with the columns `STABILITY`."""
    _write(path, STABILITY, (_case_row(verdict) for verdict in verdicts))


def write_verification(verdicts: Iterable[CaseVerdict], path: Path) -> None:
    """Write one row per finding, with the columns `VERIFICATION`; what does not apply is empty."""
    rows = (
        [
            verdict.case.name,
            _quantity(finding),
            *_rounded(_numbers(finding), (8, 8, 3, 3, 3)),
            "" if passed is None else str(passed),
        ]
        for verdict in verdicts
        for finding, passed in verdict.judged
    )
    _write(path, VERIFICATION, rows)


def _write(path: Path, columns: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([columns, *rows])
    write_text(path, text.getvalue())


def _case_row(verdict: CaseVerdict) -> list[str]:
    case, found = verdict.case, verdict.finding
    numbers = (found.predicted, found.measured, found.difference)
    return [
        case.family,
        case.name,
        case.expectation,
        found.ending,
        *_rounded(numbers, (8, 8, 3)),
        str(verdict.passed),
        found.message,
    ]


def verification_lines(verdicts: Sequence[CaseVerdict]) -> Iterator[str]:
    """A block of lines per problem, one per finding, and a total."""
    yield _aligned(("", *VERIFICATION[2:7])).rstrip()
    for verdict in verdicts:
        yield f"{verdict.case.name} ({verdict.case.source}; {verdict.seconds:.1f} s)"
        for finding, passed in verdict.judged:
            cells = _rounded(_numbers(finding), (6, 6, 2, 3, 2))
            yield f"{_aligned((f'  {_quantity(finding)}', *cells))}  {OUTCOMES[passed]}"
    failed = [verdict.case.name for verdict in verdicts if not verdict.passed]
    counted = sum(len(verdict.findings) for verdict in verdicts)
    yield (
        f"failed: {', '.join(failed)}" if failed else f"all {counted} findings within their limits"
    )


def verification_json(verdicts: Sequence[CaseVerdict]) -> str:
    """Problems with their findings as JSON; a number that is not finite is null."""
    problems = [
        {
            "name": verdict.case.name,
            "source": verdict.case.source,
            "seconds": round(verdict.seconds, 2),
            "passed": verdict.passed,
            "findings": [_record(*judged) for judged in verdict.judged],
        }
        for verdict in verdicts
    ]
    passed = all(verdict.passed for verdict in verdicts)
    return json.dumps({"passed": passed, "problems": problems}, indent=2, allow_nan=False)


def stability_lines(verdicts: Sequence[CaseVerdict]) -> Iterator[str]:
    """A line per family, one per case that failed, and a total."""
    for family, group in groupby(verdicts, key=lambda verdict: verdict.case.family):
        found = list(group)
        passed = sum(verdict.passed for verdict in found)
        yield f"{family:<16} {passed:>4} of {len(found):<4} as expected{_worst(found)}"
    failed = [verdict for verdict in verdicts if not verdict.passed]
    for verdict in failed:
        yield f"NOT AS EXPECTED: {verdict.case.family}: {verdict.case.name}: {_outcome(verdict)}"
    seconds = sum(verdict.seconds for verdict in verdicts)
    yield f"{len(verdicts) - len(failed)} of {len(verdicts)} cases as expected, {seconds:.0f} s"


def _worst(verdicts: Sequence[CaseVerdict]) -> str:
    """The largest share of its tolerance that a case used."""
    shares = [
        verdict.finding.difference / verdict.case.tolerance
        for verdict in verdicts
        if verdict.case.tolerance and verdict.finding.difference is not None
    ]
    return f", at most {max(shares):.0%} of a tolerance used" if shares else ""


def _outcome(verdict: CaseVerdict) -> str:
    found = verdict.finding
    outcome = f"expected {verdict.case.expectation}; {found.ending}"
    if found.measured is not None:
        outcome += f", {found.measured:.6g} beside {found.predicted:.6g}"
    return f"{outcome}. {found.message}"


def _record(finding: Finding, passed: bool | None) -> dict[str, str | float | None]:
    named = zip(VERIFICATION[2:7], _numbers(finding), strict=True)
    numbers = {name: x if x is None or math.isfinite(x) else None for name, x in named}
    return {"quantity": _quantity(finding), **numbers, "passed": passed}


def _quantity(finding: Finding) -> str:
    """The compared quantity, or the reason why a problem was not solved."""
    return finding.quantity or f"not solved: {finding.message}"


def _numbers(finding: Finding) -> tuple[float | None, ...]:
    """Numbers in the order of `VERIFICATION`; an unsolved problem has an infinite error."""
    error, limit = finding.difference, finding.limit
    if not finding.quantity:
        error, limit = math.inf, 0.0
    return finding.predicted, finding.measured, error, finding.order, limit


def _rounded(numbers: Iterable[float | None], digits: Iterable[int]) -> list[str]:
    """Numbers rounded to the given digits, an empty text for none."""
    pairs = zip(numbers, digits, strict=True)
    return ["" if number is None else f"{number:.{count}g}" for number, count in pairs]


def _aligned(cells: Iterable[str]) -> str:
    return "  ".join(f"{cell:<{width}}" for cell, width in zip(cells, WIDTHS, strict=True))
