"""Where the models break: the cases of the stability study, counted and put into sentences."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.resources.abc import Traversable

from reports.benchmarks import Line, read
from reports.digits import count, percent, words

NAME = "stability"
FAILED = "not as expected"
OUTCOMES = {
    "value": "value right",
    "bounded": "bounded",
    "diverged": "diverged as predicted",
    "refused": "refused with reason",
}
"""How a case ends, and what that is where it ends as expected."""
CRITICAL_STEP = "critical step"
NUMBERED = re.compile(r"(?P<number>\d[\d.]*(?:e[-+]?\d+)?) (?P<what>.+?)(?:: (?P<which>[^:]+))?")
"""A case's name that begins with a number and may end with an integrator or model."""
MOST_NAMED = 3


@dataclass(frozen=True)
class StabilityCase:
    """A case of the stability study; numbers that there are not are None.

    `tolerance`: of the difference; None for a refusal.
    """

    family: str
    name: str
    outcome: str
    predicted: float | None
    measured: float | None
    difference: float | None
    tolerance: float | None
    passed: bool
    message: str

    @property
    def judged(self) -> str:
        """Column of the matrix that the case is counted in."""
        return OUTCOMES[self.outcome] if self.passed else FAILED

    @property
    def departure(self) -> float | None:
        """Measured over predicted value, less one; None without a prediction."""
        if not self.predicted or self.measured is None:
            return None
        return self.measured / self.predicted - 1.0


def cases(folder: Traversable | None = None) -> list[StabilityCase]:
    """Stability cases of a folder's table, or of that of the program; none if it is missing."""
    return [_case(line) for line in read(NAME, folder)]


def _case(line: Line) -> StabilityCase:
    within = re.search(r"within ([-+.\de]+)", line["expected"])
    return StabilityCase(
        family=line["family"],
        name=line["case"],
        outcome=line["outcome"],
        predicted=_number(line["predicted"]),
        measured=_number(line["measured"]),
        difference=_number(line["difference"]),
        tolerance=float(within[1]) if within else None,
        passed=line["passed"] == "True",
        message=line["message"],
    )


def _number(text: str) -> float | None:
    return float(text) if text else None


def matrix(found: Iterable[StabilityCase]) -> dict[str, Counter[str]]:
    """Counts of stability cases by family and by how they ended."""
    counts: dict[str, Counter[str]] = {}
    for case in found:
        counts.setdefault(case.family, Counter())[case.judged] += 1
    return counts


@dataclass(frozen=True)
class Boundary:
    """Where a series of stability cases, which differ by the number in their names, breaks.

    `held`: the largest that did not diverge, None where all did; `broke`: the smallest that did;
    `those`: which of the integrators or models the two are of.
    """

    family: str
    what: str
    held: float | None
    broke: float
    those: tuple[str, ...]


def boundaries(found: Iterable[StabilityCase]) -> list[Boundary]:
    """Boundaries of every series in which a case diverges; those at one place together."""
    series: dict[tuple[str, str, str], list[tuple[float, bool]]] = {}
    for case in found:
        split = NUMBERED.fullmatch(case.name)
        if split and case.outcome in OUTCOMES and case.outcome != "refused":
            key = (case.family, split["what"], split["which"] or "")
            series.setdefault(key, []).append((float(split["number"]), case.outcome == "diverged"))
    shared: dict[tuple[str, str, float | None, float], list[str]] = {}
    for (family, what, which), ends in series.items():
        broke = min((number for number, diverged in ends if diverged), default=None)
        if broke is not None:
            held = max((n for n, diverged in ends if not diverged and n < broke), default=None)
            shared.setdefault((family, what, held, broke), []).append(which)
    return [Boundary(*key, tuple(which)) for key, which in shared.items()]


def sentences(found: Sequence[StabilityCase]) -> list[str]:
    """Sentences on how the cases ended, how well steps were predicted, where models break."""
    told = [_ended(found)]
    steps = [case for case in found if case.family == CRITICAL_STEP and case.departure is not None]
    if steps:
        told.append(_predicted(steps))
    where = [_broken(boundary) for boundary in boundaries(found)]
    if where:
        told.append(f"Limits found in series of cases: {'; '.join(where)}.")
    return told


def _ended(found: Sequence[StabilityCase]) -> str:
    failed = [case for case in found if not case.passed]
    families = len(matrix(found))
    start = f"Of {count(len(found))} cases in {families} families "
    if not failed:
        return f"{start}all end as expected."
    named = "; ".join(f"{case.family}, {words(case.name)}" for case in failed[:MOST_NAMED])
    more = f" and {len(failed) - MOST_NAMED} more" if len(failed) > MOST_NAMED else ""
    verb = "does" if len(failed) == 1 else "do"
    return f"{start}{len(failed)} {verb} not end as expected: {named}{more}."


def _predicted(steps: Sequence[StabilityCase]) -> str:
    worst = max(steps, key=lambda case: abs(case.departure or 0.0))
    return (
        f"The critical step was measured in {len(steps)} cases; it differs from the predicted one "
        f"by at most {percent(abs(worst.departure or 0.0))} ({words(worst.name)})."
    )


def _broken(boundary: Boundary) -> str:
    those = ", ".join(which for which in boundary.those if which)
    end = f" ({those})" if those else ""
    if boundary.held is None:
        return f"{boundary.family}: {boundary.broke:g} {boundary.what} is not completed{end}"
    held = f"{boundary.held:g} {boundary.what} is completed"
    return f"{boundary.family}: {held}, {boundary.broke:g} is not{end}"
