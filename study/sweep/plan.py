"""What a sweep still has to run, and for how long."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean
from typing import NamedTuple

from study.sweep.status import duration
from study.sweep.store import Store, Stored
from study.sweep.task import Task


class Plan(NamedTuple):
    """Numbers of tasks, and the sequential time [s] of those that remain, None if unknown."""

    total: int
    stored: int
    left: int
    seconds: float | None

    def __str__(self) -> str:
        """One line for the terminal."""
        time = "an unknown time" if self.seconds is None else f"about {duration(self.seconds)}"
        return f"{self.total} runs, {self.stored} stored, {self.left} left: {time} of work"


def plan(tasks: Sequence[Task], store: Store) -> Plan:
    """What `run` would do with the same tasks; nothing is computed or written."""
    unique = list({task.key: task for task in tasks}.values())
    left = [task for task in unique if store.get(task) is None]
    walls = _walls(left, list(store))
    seconds = None if None in walls else sum(wall for wall in walls if wall is not None)
    return Plan(len(unique), len(unique) - len(left), len(left), seconds)


def _walls(tasks: Sequence[Task], stored: Sequence[Stored]) -> list[float | None]:
    """Expected time [s] of each task, from the most similar stored runs of its function."""
    return [_wall(task, [run for run in stored if run.function == task.function]) for task in tasks]


def _wall(task: Task, runs: Sequence[Stored]) -> float | None:
    """Mean over the runs with most arguments in common; exact if only the program has changed."""
    alike = [_common(task, run) for run in runs]
    return (
        fmean(run.wall for run, common in zip(runs, alike, strict=True) if common == max(alike))
        if runs
        else None
    )


def _common(task: Task, run: Stored) -> int:
    missing = object()
    return sum(run.arguments.get(name, missing) == given for name, given in task.arguments.items())
