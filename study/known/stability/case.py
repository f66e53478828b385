"""What a case is, and the verdict on what it found.

The verdict is given here and not by the case: the ending has to be the one expected, a refusal has
to name what is wrong, and every other ending has to come with a difference within its tolerance. A
number without anything to hold it to cannot pass.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from typing import Any

from study.known.stability.finding import Ending, Finding
from study.sweep.task import Task

SECONDS = 30.0


@dataclass(frozen=True, kw_only=True)
class Case:
    """One case: a function of plain arguments, and how it is expected to end.

    `function`: module:name, gives a `Finding` or raises ValueError, which is a refusal.
    `tolerance` of the difference; a refusal has instead a pattern that its message `says`.
    `seconds`: after which the case counts as hanging. `note`: why the expectation is what it is,
    where that is not obvious. `quick`: whether it belongs to the subset of half a minute.
    """

    family: str
    name: str
    function: str
    arguments: dict[str, Any] = field(default_factory=dict)
    expected: Ending = "value"
    tolerance: float | None = None
    says: str = ""
    seconds: float = SECONDS
    note: str = ""
    quick: bool = False

    def __post_init__(self) -> None:
        refusal = self.expected == "refused"
        if refusal != bool(self.says) or refusal == (self.tolerance is not None):
            raise ValueError(
                f"{self.family}: {self.name}: give a refusal what it says, every other ending a "
                "tolerance"
            )

    @property
    def task(self) -> Task:
        """The case as a task of the sweep."""
        asked = {"function": self.function, "arguments": self.arguments, "seconds": self.seconds}
        return Task("study.known.stability.trial:trial", asked)

    @property
    def expectation(self) -> str:
        """The expected ending in words."""
        if self.expected == "refused":
            return f"refused, naming {self.says}"
        return f"{self.expected}, within {self.tolerance:g}"


@dataclass(frozen=True)
class Verdict:
    """A case, what it found, and whether that is what was expected."""

    case: Case
    finding: Finding
    passed: bool
    seconds: float


def judge(case: Case, finding: Finding, seconds: float = 0.0) -> Verdict:
    """The verdict on a finding."""
    return Verdict(case, finding, _is_as_expected(case, finding), seconds)


def _is_as_expected(case: Case, finding: Finding) -> bool:
    if finding.ending != case.expected:
        return False
    if case.tolerance is None:
        return re.search(case.says, finding.message) is not None
    difference = finding.difference
    return difference is not None and math.isfinite(difference) and difference <= case.tolerance
