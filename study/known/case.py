"""A case with a known answer, and the verdict on its findings.

The verdict is given here and not by the case: the ending has to be the expected one, a refusal has
to name what is wrong, and every other ending needs a difference within its tolerance. A number
without a criterion cannot pass.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from study.known.finding import Ending, Finding
from study.sweep.task import Task

SECONDS = 90.0
"""Default time limit; compiling a kernel at its first use takes half a minute on a busy machine."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """A function of plain arguments, and its expected ending.

    `function`: "module:name"; it returns a `Finding` or several, or raises ValueError, which is a
    refusal. It has one criterion: the `tolerance` of a difference; a pattern `says` that the
    message of a refusal must match; or the `source` of exact solutions, whose findings each state a
    limit. `seconds`: time limit after which the case counts as hanging. `quick`: whether it belongs
    to the subset that is run in half a minute.
    """

    family: str
    name: str
    function: str
    arguments: Mapping[str, Any] = field(default_factory=dict)
    expected: Ending = "value"
    tolerance: float | None = None
    says: str = ""
    source: str = ""
    seconds: float = SECONDS
    quick: bool = False

    def __post_init__(self) -> None:
        """Refuse a case that could not fail."""
        criteria = (self.tolerance is not None) + bool(self.says) + bool(self.source)
        if criteria != 1 or (self.expected == "refused") != bool(self.says):
            raise ValueError(
                f"{self.family}: {self.name}: give a refusal what it says, every other ending a "
                "tolerance or the source of the exact solution"
            )

    @property
    def task(self) -> Task:
        """The case as a task of the sweep."""
        asked = {
            "function": self.function,
            "arguments": dict(self.arguments),
            "seconds": self.seconds,
        }
        return Task("study.known.trial:trial", asked)

    @property
    def expectation(self) -> str:
        """The expected ending in words."""
        if self.says:
            return f"refused, naming {self.says}"
        return self.source or f"{self.expected}, within {self.tolerance:g}"

    def judge(self, finding: Finding) -> bool | None:
        """Whether a finding is as expected; None where there is no criterion."""
        if finding.ending != self.expected:
            return False
        if self.says:
            return re.search(self.says, finding.message) is not None
        limit, off = finding.limit if self.source else self.tolerance, finding.difference
        if limit is None:
            return None
        return off is not None and math.isfinite(off) and off <= limit


@dataclass(frozen=True)
class Family:
    """The cases of one module, which contains their functions; `quick` if all of them are."""

    name: str
    module: str
    quick: bool = False

    def case(
        self,
        name: str,
        function: str,
        arguments: Mapping[str, Any],
        criterion: float | str,
        *,
        expected: Ending = "value",
        quick: bool = False,
    ) -> Case:
        """A case with a tolerance, or with a pattern if it is to be refused.

        `function`: its name in the module.
        """
        make = partial(
            Case,
            family=self.name,
            name=name,
            function=f"{self.module}:{function}",
            arguments=arguments,
        )
        if isinstance(criterion, str):
            return make(expected="refused", says=criterion, quick=True)
        return make(expected=expected, tolerance=criterion, quick=quick or self.quick)


@dataclass(frozen=True)
class CaseVerdict:
    """A case with its findings, each beside whether it is as expected, and its time [s]."""

    case: Case
    findings: tuple[Finding, ...]
    seconds: float = 0.0

    @property
    def judged(self) -> list[tuple[Finding, bool | None]]:
        """Each finding, and whether it is as expected; None where there is no criterion."""
        return [(finding, self.case.judge(finding)) for finding in self.findings]

    @property
    def finding(self) -> Finding:
        """The finding of a case that has one."""
        return self.findings[0]

    @property
    def passed(self) -> bool:
        """Whether there are findings, and all of them are as expected."""
        return bool(self.findings) and all(passed is not False for _, passed in self.judged)
