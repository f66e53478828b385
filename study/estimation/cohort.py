"""The cohort study at the command line: its table as CSV, and what it comes to as lines.

cohort.csv has a row per contender and group, with the columns of
`fuzzy.liver.cohort.CohortRow`: stiffness in Pa, shares of one, empty where a column does not apply.
`displacement_rms` is for a tool pressed by a force, whose displacement goes as one over the
stiffness.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Iterator
from pathlib import Path

from fuzzy.liver.bases import KNOWLEDGE
from fuzzy.liver.cohort import NOMINAL, CohortRow, CohortStudy, Comparison, cohort_study
from fuzzy.liver.monotonicity import falls
from fuzzy.liver.settings import LiverSettings
from fuzzy.liver.stiffness import PA_PER_KPA
from fuzzy.systems.kinds import SYSTEMS
from fuzzy.systems.sets import Array

LEGEND = """Errors of the estimated stiffness: bias and rms in kPa over all; rms in % of
the true stiffness of those with one reading, with its 95 % interval, and of those with more (2+).
Then the rms error in % of the displacement that follows, the share of patients within the type-2
interval, and the mean width of that in % of the true stiffness."""
HEAD = (
    "contender",
    "bias kPa",
    "rms kPa",
    "rms 1 %",
    "95 %",
    "2+ %",
    "displ. %",
    "in band %",
    "width %",
)
WIDTHS = (30, 9, 8, 8, 13, 7, 9, 10, 8)
DIGITS = 4


def judged(patients: int, seed: int) -> CohortStudy:
    """The cohort study with a tool's displacement under a force. ValueError for too few patients.

    A negative seed is a ValueError too.
    """
    if seed < 0:
        raise ValueError(f"--seed {seed}: give 0 or more")
    return cohort_study(patients, seed, compliance)


def compliance(stiffness: Array) -> Array:
    """Displacement of a linear body under a given force, up to a factor."""
    return 1.0 / stiffness


def write_cohort(rows: Iterable[CohortRow], path: Path) -> None:
    """Write all rows, the fields of CohortRow as columns. ValueError if it cannot be written."""
    try:
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(CohortRow._fields)
            writer.writerows([_cell(value) for value in row] for row in rows)
    except OSError as error:
        raise ValueError(f"--out {path}: cannot be written ({error.strerror})") from error


def _cell(value: str | float) -> str:
    if isinstance(value, str | int):
        return str(value)
    return f"{value:.{DIGITS}g}" if math.isfinite(value) else ""


def cohort_lines(study: CohortStudy) -> Iterator[str]:
    """A line per contender over all patients, then the comparisons in sentences."""
    by_group = {(row.contender, row.readings): row for row in study.rows if row.aetiology == "all"}
    (every, *_) = study.rows
    yield f"{every.patients} virtual patients. {LEGEND}"
    yield _aligned(HEAD)
    for name in dict.fromkeys(row.contender for row in study.rows):
        whole, one, more = (by_group[name, readings] for readings in ("all", "1", "2 or more"))
        yield _aligned(_cells(whole, one, more))
    yield from map(_sentence, study.comparisons)
    yield from _bands(study.rows)
    yield from _falls(study.rows)
    yield from map(_with_several, (name for name, base in KNOWLEDGE.items() if base.follows))


def _cells(whole: CohortRow, one: CohortRow, more: CohortRow) -> tuple[str, ...]:
    return (
        whole.contender,
        f"{whole.bias / PA_PER_KPA:.2f}",
        f"{whole.rms / PA_PER_KPA:.2f}",
        _percent(one.relative_rms),
        f"{_percent(one.relative_rms_low)}-{_percent(one.relative_rms_high)}",
        _percent(more.relative_rms),
        _percent(whole.displacement_rms),
        _percent(whole.coverage),
        _percent(whole.width),
    )


def _percent(share: float) -> str:
    return f"{100 * share:.1f}" if math.isfinite(share) else ""


def _aligned(cells: Iterable[str]) -> str:
    named, *numbers = zip(cells, WIDTHS, strict=True)
    right = (f"{cell:>{width}}" for cell, width in numbers)
    return "  ".join([f"{named[0]:<{named[1]}}", *right]).rstrip()


def _sentence(found: Comparison) -> str:
    low, change, high = (100 * x for x in (found.low, found.difference, found.high))
    points = f"{change:+.2f} points ({low:+.2f} to {high:+.2f})"
    best = f"{found.fuzzy}, the best fuzzy system,"
    if found.verdict == "undecided":
        said = f"{best} does not differ resolvably from {found.baseline}"
    else:
        said = f"{best} is {found.verdict} than {found.baseline}"
    return f"readings {found.readings}: {said}: difference of the rms errors {points}"


def _bands(rows: Iterable[CohortRow]) -> Iterator[str]:
    following = tuple(f"{name} " for name, base in KNOWLEDGE.items() if base.follows)
    for row in rows:
        whole = (row.aetiology, row.readings) == ("all", "all")
        if whole and row.contender.startswith(following) and math.isfinite(row.coverage):
            yield (
                f"{row.contender}: its interval covers {100 * row.coverage:.1f} % of the patients, "
                f"nominally {100 * NOMINAL:.0f} %"
            )


def _with_several(knowledge: str) -> str:
    """Largest decrease of estimates as one of several readings increases, by their number."""
    settings = LiverSettings(knowledge=knowledge)
    by_number = zip(*(falls(kind, settings) for kind in SYSTEMS), strict=True)
    parts = [
        f"{found[0].readings}: {_fall(one.anywhere for one in found)} "
        f"({_fall(one.of_one_liver for one in found)})"
        for found in by_number
    ]
    return (
        f"{knowledge}: largest decrease of any system as one reading increases, by the number of "
        f"readings, over the whole scale (of one liver): {', '.join(parts)}"
    )


def _fall(shares: Iterable[float]) -> str:
    return f"{100 * max(shares):.2g} %"


def _falls(rows: Iterable[CohortRow]) -> Iterator[str]:
    """Estimators that decrease where they should increase, with a single reading."""
    falling: dict[str, float] = {}
    for row in rows:
        if row.largest_fall > 0:  # false for NaN too
            falling[row.contender] = max(row.largest_fall, falling.get(row.contender, 0.0))
    for name, fall in falling.items():
        yield f"{name}: decreases by up to {100 * fall:.2g} % as its one reading increases"
