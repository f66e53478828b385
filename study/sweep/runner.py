"""Run the tasks that have no stored result, here or on workers, and store each as it arrives."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from study.sweep.attempt import Attempt, Status, attempt
from study.sweep.canonical import Plain, canonical
from study.sweep.program import program
from study.sweep.status import ReportStatus, SweepStatus, silent
from study.sweep.store import Store
from study.sweep.task import Task


@dataclass(frozen=True)
class Backend:
    """Where a sweep runs: in this process, on `workers` local processes, or on a `scheduler`.

    `scheduler`: address of a running Dask scheduler, such as "tcp://host:8786".
    """

    workers: int = 0
    scheduler: str | None = None

    def __post_init__(self) -> None:
        """Refuse contradictory settings."""
        if self.workers < 0:
            raise ValueError(f"workers: {self.workers} is negative; give 0 to run in this process")
        if self.workers and self.scheduler is not None:
            raise ValueError("workers and scheduler: give one; a scheduler has its own workers")


@dataclass(frozen=True)
class Outcome:
    """How a task ended, after `wall` seconds.

    "done" with its `value`; "failed" if it raised, "crashed" if its worker died, with a `message`.
    """

    task: Task
    status: Status
    value: Plain | None
    message: str
    wall: float


def run(
    tasks: Sequence[Task],
    store: Store,
    backend: Backend | None = None,
    progress: ReportStatus = silent,
) -> list[Outcome]:
    """Outcomes of all tasks, in their order; only those without a stored result are run.

    A result is stored when it arrives, so that an interruption loses only the runs in progress.
    Failures and crashes are not stored, since their cause may lie outside the task (memory, a
    signal, a full disk); a new sweep tries each of them again. Within a sweep every task has one
    attempt. A task that crashes in this process ends the sweep; stored results remain. ValueError
    if the store cannot be created or workers are unavailable. If the machine or a signal ends the
    sweep, the exception has a note on how to continue.
    """
    store.prepare()
    try:
        return _run(tasks, store, backend or Backend(), progress)
    except (KeyboardInterrupt, MemoryError, OSError) as error:
        error.add_note(store.advice())
        raise
    finally:
        store.tidy()


def _run(
    tasks: Sequence[Task], store: Store, backend: Backend, progress: ReportStatus
) -> list[Outcome]:
    by_key = {task.key: task for task in tasks}
    ended = {name: kept for name, task in by_key.items() if (kept := _kept(task, store))}
    left = {name: task for name, task in by_key.items() if name not in ended}
    status, start = SweepStatus(len(by_key), stored=len(ended)), time.perf_counter()
    progress(status)
    with _attempts(tuple(left.values()), backend) as attempts:
        for task, found in attempts:
            if found.value is not None:
                store.put(task, found.value, found.wall)
            ended[task.key] = found
            status = status.counting(time.perf_counter() - start, done=found.status == "done")
            progress(status)
    return [Outcome(task, *ended[task.key]) for task in tasks]


def _kept(task: Task, store: Store) -> Attempt | None:
    """The stored result of a task as its outcome."""
    stored = store.get(task)
    return None if stored is None else Attempt("done", stored.value, "", stored.wall)


@contextmanager
def _attempts(tasks: Sequence[Task], backend: Backend) -> Iterator[Iterator[tuple[Task, Attempt]]]:
    """Each task with its outcome, in the order they end; workers are gone when the block ends."""
    if not tasks or not (backend.workers or backend.scheduler):
        yield _here(tasks)
        return
    try:
        from study.sweep.workers import distant, local, one_each
    except ModuleNotFoundError as missing:
        raise ValueError(
            f"workers need the package {missing.name}: pip install -e "
            '".[workers]"'
            ", or leave them out to run in this process"
        ) from None
    place = (
        distant(backend.scheduler) if backend.scheduler else local(min(backend.workers, len(tasks)))
    )
    with place as client:
        yield one_each(client, tasks)


def _here(tasks: Sequence[Task]) -> Iterator[tuple[Task, Attempt]]:
    """Run tasks in this process, one after another."""
    for task in tasks:
        arguments = canonical(task.arguments)
        yield task, attempt(task.function, arguments, program(task.module))
