"""`stability` as the command line asks for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from study.known.stability import table
from study.known.stability.case import Case, Verdict, judge
from study.known.stability.finding import Finding
from study.known.stability.suite import cases
from study.scene.file import read_scene
from study.sweep.plan import plan
from study.sweep.runner import How, Outcome, run
from study.sweep.store import Store
from study.sweep.tally import Tell, silent


@dataclass(frozen=True, kw_only=True)
class Request:
    """A scene by name or file, the folder to write, where to run, and whether only quick cases."""

    scene: str = "block"
    out: Path | None = None
    workers: int = 0
    scheduler: str | None = None
    quick: bool = False

    @property
    def folder(self) -> Path:
        """Of the table."""
        return self.out or Path("results") / f"{Path(self.scene).stem}-stability"

    @property
    def store(self) -> Store:
        """Of finished cases, beside the folder."""
        return Store(self.folder.with_name(f"{self.folder.name}-runs"))

    def cases(self) -> list[Case]:
        """What is asked for."""
        return cases(read_scene(self.scene), quick=self.quick)


def planned(request: Request) -> str:
    """What would be run."""
    return str(plan([case.task for case in request.cases()], request.store))


def study(request: Request, progress: Tell = silent) -> list[Verdict]:
    """Verdicts on all cases asked for, which are also written as a table."""
    chosen = request.cases()
    how = How(request.workers, request.scheduler)
    outcomes = run([case.task for case in chosen], request.store, how, progress)
    verdicts = judged(chosen, outcomes)
    request.folder.mkdir(parents=True, exist_ok=True)
    table.write(verdicts, request.folder / table.NAME)
    return verdicts


def judged(chosen: Sequence[Case], outcomes: Sequence[Outcome]) -> list[Verdict]:
    """The verdict on each outcome of a sweep; a run without a value is an error."""
    return [
        judge(case, _finding(outcome), outcome.wall)
        for case, outcome in zip(chosen, outcomes, strict=True)
    ]


def _finding(outcome: Outcome) -> Finding:
    if outcome.value is None:
        return Finding("error", message=f"{outcome.status}: {outcome.message}")
    return Finding(**outcome.value)
