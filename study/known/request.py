"""Requests of the commands `verify` and `stability`: cases run, stored and judged."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from study.known import table
from study.known.case import Case, CaseVerdict
from study.known.finding import Finding
from study.known.suite import PROBLEMS, stability_cases
from study.known.trial import attempted
from study.run.suiting import read_suited
from study.sweep.plan import plan
from study.sweep.runner import Backend, Outcome, run
from study.sweep.status import ReportStatus, silent
from study.sweep.store import Store
from study.system.folders import claimed, naming, refuse_unwritable
from study.system.progress import Progress


def verify(progress: Progress, *, quick: bool = False) -> list[CaseVerdict]:
    """Verdicts on all problems with exact solutions, or with `quick` on those of about a second.

    They are solved in this process, one after another, and nothing is stored.
    """
    return [tried(case, progress) for case in PROBLEMS if case.quick or not quick]


def tried(case: Case, progress: Progress) -> CaseVerdict:
    """The verdict on a case that is run in this process."""
    start = time.perf_counter()
    with progress.stage(case.name):
        found = attempted(case.function, case.arguments, case.seconds)
    return CaseVerdict(case, found, time.perf_counter() - start)


@dataclass(frozen=True, kw_only=True)
class StabilityRequest:
    """A scene by name or file, the folder to write, where to run, and which cases."""

    scene: str = "block"
    out: Path | None = None
    workers: int = 0
    scheduler: str | None = None
    quick: bool = False

    @property
    def folder(self) -> Path:
        """Folder of the table."""
        return self.out or Path("results") / f"{Path(self.scene).stem}-stability"

    @property
    def store(self) -> Store:
        """Store of finished cases, beside the folder."""
        return Store(self.folder.with_name(f"{self.folder.name}-runs"))

    def cases(self) -> list[Case]:
        """The cases that are asked for."""
        return stability_cases(read_suited(self.scene, ()), quick=self.quick)

    def refuse(self) -> None:
        """Raise ValueError, before anything is run, for an unsuitable scene, folder or workers."""
        _ = Backend(self.workers, self.scheduler)
        for folder in (self.folder, self.store.folder):
            refuse_unwritable(folder, lambda _: None, "stability study")
        from study.known.stability.cases import user_scene  # loads compiled kernels

        user_scene.refuse(read_suited(self.scene, ()))


def planned(request: StabilityRequest) -> str:
    """What a request would run, and for how long."""
    request.refuse()
    return str(plan([case.task for case in request.cases()], request.store))


def study(request: StabilityRequest, progress: ReportStatus = silent) -> list[CaseVerdict]:
    """Verdicts on all requested cases, which are also written as a table."""
    request.refuse()
    chosen = request.cases()
    backend = Backend(request.workers, request.scheduler)
    with claimed(request.folder):
        outcomes = run([case.task for case in chosen], request.store, backend, progress)
        verdicts = judged(chosen, outcomes)
        with naming(request.folder):
            request.folder.mkdir(parents=True, exist_ok=True)
        table.write_stability(verdicts, request.folder / table.NAME)
    return verdicts


def judged(chosen: Sequence[Case], outcomes: Sequence[Outcome]) -> list[CaseVerdict]:
    """The verdict on each outcome of a sweep; a run without a value is an error."""
    return [
        CaseVerdict(case, _findings(outcome), outcome.wall)
        for case, outcome in zip(chosen, outcomes, strict=True)
    ]


def _findings(outcome: Outcome) -> tuple[Finding, ...]:
    if outcome.value is None:
        return (Finding("error", message=f"{outcome.status}: {outcome.message}"),)
    return tuple(Finding(**found) for found in outcome.value["findings"])


def all_passed(verdicts: Sequence[CaseVerdict]) -> bool:
    """Whether all cases passed, so that the command succeeds."""
    return all(verdict.passed for verdict in verdicts)
