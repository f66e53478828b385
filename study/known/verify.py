"""The reference's verification at the command line: a table, JSON, and a CSV file."""

from __future__ import annotations

import csv
import json
import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from study.known.verification.finding import Finding, Problem
from study.known.verification.suite import PROBLEMS
from study.progress import Progress

COLUMNS = ("problem", "quantity", "exact", "ours", "error", "order", "limit", "passed")
WIDTHS = (58, 11, 11, 8, 5, 8)


@dataclass(frozen=True)
class Verdict:
    """What one problem found, in so many seconds."""

    problem: Problem
    findings: tuple[Finding, ...]
    seconds: float

    @property
    def passed(self) -> bool:
        """Whether every finding is within its limit."""
        return all(finding.passed for finding in self.findings)


def verify(progress: Progress, *, quick: bool = False) -> list[Verdict]:
    """Solve all problems, or those that take about a second."""
    return [_solved(problem, progress) for problem in PROBLEMS if problem.quick or not quick]


def _solved(problem: Problem, progress: Progress) -> Verdict:
    start = time.perf_counter()
    with progress.stage(problem.name):
        try:
            findings = tuple(problem.findings())
        except ValueError as error:  # the reference's, not of what was asked
            findings = (Finding(f"not solved: {error}", math.inf, 0.0),)
    return Verdict(problem, findings, time.perf_counter() - start)


def table(verdicts: Sequence[Verdict]) -> Iterator[str]:
    """Lines for a terminal, a block per problem."""
    names = ("", *COLUMNS[2:7])
    yield "  ".join(f"{name:<{w}}" for name, w in zip(names, WIDTHS, strict=True)).rstrip()
    for verdict in verdicts:
        yield f"{verdict.problem.name} ({verdict.problem.source}; {verdict.seconds:.1f} s)"
        yield from (_line(finding) for finding in verdict.findings)
    failed = [verdict.problem.name for verdict in verdicts if not verdict.passed]
    counted = sum(len(verdict.findings) for verdict in verdicts)
    yield (
        f"failed: {', '.join(failed)}" if failed else f"all {counted} findings within their limits"
    )


def _line(finding: Finding) -> str:
    numbers = [
        _rounded(getattr(finding, name), digits)
        for name, digits in zip(COLUMNS[2:7], (6, 6, 2, 3, 2), strict=True)
    ]
    cells = (f"  {finding.quantity}", *numbers)
    verdict = "noted" if finding.limit is None else "pass" if finding.passed else "FAIL"
    return "  ".join([*(f"{c:<{w}}" for c, w in zip(cells, WIDTHS, strict=True)), verdict])


def as_json(verdicts: Sequence[Verdict]) -> str:
    """The same as JSON; a number that is not finite is null."""
    problems = [
        {
            "name": verdict.problem.name,
            "source": verdict.problem.source,
            "seconds": round(verdict.seconds, 2),
            "passed": verdict.passed,
            "findings": [_record(finding) for finding in verdict.findings],
        }
        for verdict in verdicts
    ]
    passed = all(verdict.passed for verdict in verdicts)
    return json.dumps({"passed": passed, "problems": problems}, indent=2, allow_nan=False)


def _record(finding: Finding) -> dict[str, Any]:
    values = asdict(finding) | {"passed": _judged(finding)}
    return {
        key: None if isinstance(value, float) and not math.isfinite(value) else value
        for key, value in values.items()
    }


def write_csv(verdicts: Sequence[Verdict], path: Path) -> None:
    """Write one row per finding, `COLUMNS`; what does not apply is empty."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for verdict in verdicts:
            for finding in verdict.findings:
                writer.writerow([verdict.problem.name, *_cells(finding)])


def _cells(finding: Finding) -> list[str]:
    numbers = (finding.exact, finding.ours, finding.error, finding.order, finding.limit)
    rounded = [_rounded(value, d) for value, d in zip(numbers, (8, 8, 3, 3, 3), strict=True)]
    judged = _judged(finding)
    return [finding.quantity, *rounded, "" if judged is None else str(judged)]


def _judged(finding: Finding) -> bool | None:
    """Whether it passed, None where nothing is judged."""
    return None if finding.limit is None else finding.passed


def _rounded(value: float | None, digits: int) -> str:
    return "" if value is None else f"{value:.{digits}g}"
