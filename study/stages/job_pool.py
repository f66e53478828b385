"""Jobs that do not depend on each other, one after another or in processes side by side.

A process is forked, so that it shares what was built before with the one that runs them all, and
takes one job after another. It ends when the jobs do, whatever ends these: it is told to, and if
nobody is left to tell it, it sees that.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import sys
import time
import traceback
import warnings
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from threading import Thread
from typing import Any, NamedTuple, NoReturn, Protocol

from study import signals
from study.progress import Advance, Lines, Progress, Silent

PATIENCE = 5.0
"""Seconds that a process has to end before it is killed."""
PAUSE = 0.1
"""Seconds between two shares that a process tells of a stage."""


class Job(NamedTuple):
    """Work by a name that is unique; it tells its progress, and its result goes through a pipe."""

    name: str
    work: Callable[[Progress], Any]


class JobPool(Protocol):
    """Takes jobs as they come, and gives their results once all are there."""

    def start(self, job: Job) -> None:
        """Take a job; whether it runs at once is not said."""

    def results(self) -> dict[str, Any]:
        """Results of all jobs by name. Whatever a job raises is raised here."""


def available() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def can_fork() -> bool:
    """Whether processes can share what was built; macOS has libraries that do not bear it."""
    return "fork" in multiprocessing.get_all_start_methods() and sys.platform != "darwin"


@contextmanager
def job_pool(count: int, progress: Progress) -> Iterator[JobPool]:
    """So many jobs side by side, or one after another; no process is left when the block ends."""
    if count < 2 or not can_fork():
        yield _SerialPool(progress)
        return
    found = _ProcessPool(count, progress)
    try:
        yield found
    finally:
        found.stop()


class _SerialPool:
    """Jobs in this process, in their order, when results are asked for."""

    def __init__(self, progress: Progress) -> None:
        self.progress = progress
        self.jobs: list[Job] = []
        self.found: dict[str, Any] = {}

    def start(self, job: Job) -> None:
        self.jobs.append(job)

    def results(self) -> dict[str, Any]:
        for job in self.jobs[len(self.found) :]:
            self.found[job.name] = job.work(self.progress)
        return self.found


class _Worker:
    """A process with the jobs that there were when it was forked, and the one it is at."""

    def __init__(self, jobs: list[Job], progress: Progress) -> None:
        context = multiprocessing.get_context("fork")
        self.known, self.at = len(jobs), -1
        self.stages: dict[int, tuple[AbstractContextManager[Advance], Advance]] = {}
        self.pipe, theirs = context.Pipe()
        self.process: BaseProcess = context.Process(
            target=_serve, args=(theirs, list(jobs), progress), daemon=True
        )
        with _undisturbed():
            self.process.start()
        theirs.close()

    def give(self, number: int) -> None:
        self.at = number
        self.pipe.send(number)


class _ProcessPool:
    """Jobs in processes of their own; this one only waits."""

    def __init__(self, count: int, progress: Progress) -> None:
        self.count, self.progress = count, progress
        self.jobs: list[Job] = []
        self.waiting: deque[int] = deque()
        self.workers: list[_Worker] = []
        self.found: dict[str, Any] = {}

    def start(self, job: Job) -> None:
        self.jobs.append(job)
        self.waiting.append(len(self.jobs) - 1)
        self._feed()

    def results(self) -> dict[str, Any]:
        while len(self.found) < len(self.jobs):
            self._feed()
            busy = {worker.pipe: worker for worker in self.workers if worker.at >= 0}
            for pipe in wait(list(busy)):
                self._hear(busy[pipe])  # type: ignore[index] # one of those that were given
        return {job.name: self.found[job.name] for job in self.jobs}

    def _feed(self) -> None:
        """Give jobs to idle processes, and fork such as know them."""
        while self.waiting:
            idle = [worker for worker in self.workers if worker.at < 0]
            fit = next((worker for worker in idle if worker.known > self.waiting[0]), None)
            if fit is None and len(self.workers) == self.count:
                if not idle:
                    return
                self.workers.remove(idle[0])
                _end(idle[0])
            if fit is None:
                fit = _Worker(self.jobs, self.progress)
                self.workers.append(fit)
            fit.give(self.waiting.popleft())

    def _hear(self, worker: _Worker) -> None:
        try:
            kind, *content = worker.pipe.recv()
        except (EOFError, ConnectionError):
            raise _death(self.jobs[worker.at].name, worker.process) from None
        match kind:
            case "done":
                self.found[self.jobs[worker.at].name] = content[0]
                worker.at = -1
            case "failed":
                raise content[0] from _RemoteTraceback(content[1])
            case "begin":
                stage = self.progress.stage(content[1])
                worker.stages[content[0]] = stage, stage.__enter__()
            case "share":
                worker.stages[content[0]][1](content[1])
            case "end":
                worker.stages.pop(content[0])[0].__exit__(None, None, None)

    def stop(self) -> None:
        """End all processes, at once those that are amid a job."""
        for worker in self.workers:
            if worker.at >= 0:
                worker.process.terminate()
        for worker in self.workers:
            _end(worker)
        self.workers.clear()


class _RemoteTraceback(Exception):  # noqa: N818 - the cause of one, and only shown
    """Where something was raised in another process."""

    def __str__(self) -> str:
        return f"\n{self.args[0]}"


def _end(worker: _Worker) -> None:
    """Let an idle process leave, or end it."""
    with suppress(OSError):  # it may have ended
        worker.pipe.send(
            None
        )  # others that were forked later have the pipe, so closing says nothing
    worker.pipe.close()
    worker.process.join(PATIENCE)
    if worker.process.is_alive():
        worker.process.kill()
        worker.process.join()


def _death(job: str, process: BaseProcess) -> Exception:
    """What ended a process that did not say it itself."""
    process.join(PATIENCE)
    code = process.exitcode or 0
    if code == -signal.SIGKILL:
        return MemoryError(f"the process of {job} was killed")
    how = f"ended by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"
    return OSError(f"the process of {job} {how}; run with --workers 1 to see why")


@contextmanager
def _undisturbed() -> Iterator[None]:
    """Signals wait while a process is forked, which else might answer them in this one's name."""
    with warnings.catch_warnings():
        # Threads that others have started are not in the fork, which needs none of their locks: it
        # computes, and tells of it through its pipe.
        warnings.simplefilter("ignore", DeprecationWarning)
        before = signal.pthread_sigmask(signal.SIG_BLOCK, signals.numbers())
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


# --- in the process ------------------------------------------------------------------------------


def _serve(pipe: Connection, jobs: list[Job], progress: Progress) -> NoReturn:
    """Do jobs as their numbers come, until the pipe is closed. Nothing of the parent is unwound."""
    try:
        _follow_parent()
        with ExitStack() as stack:
            stack.callback(pipe.close)
            while (number := pipe.recv()) is not None:
                pipe.send(_done(jobs[number], _own(progress, pipe)))
    finally:  # whatever it was: the parent has left, or cannot be told
        os._exit(0)


def _follow_parent() -> None:
    """Leave what is typed at the terminal to the parent, and end with it."""
    for number in signals.numbers():
        # One that waits to be answered would be lost if it were ignored, be it for a moment.
        ends = number == signal.SIGTERM
        signal.signal(number, signal.SIG_DFL if ends else signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, signals.numbers())
    Thread(target=_exit_with_parent, daemon=True).start()


def _exit_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
    os._exit(signals.EXIT_MACHINE)


def _done(job: Job, progress: Progress) -> tuple[Any, ...]:
    """What the parent is told of a job in the end."""
    try:
        return "done", job.work(progress)
    except BaseException as error:  # the parent raises it
        return "failed", _portable(error), traceback.format_exc()


def _portable(error: BaseException) -> BaseException:
    """An exception as it can be sent, the one below it where that is the reason."""
    below = None if error.__suppress_context__ else error.__context__
    if isinstance(error, ValueError) and isinstance(below, OSError):
        return below
    try:
        pickle.loads(pickle.dumps(error))  # noqa: S301 - one's own
    except Exception:  # whatever its class forgot
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


def _own(progress: Progress, pipe: Connection) -> Progress:
    """Lines are told here, where their time is taken; bars are drawn by the parent."""
    return progress if isinstance(progress, Lines | Silent) else _Sent(pipe)


class _Sent:
    """Tells the stages of a process to its parent."""

    def __init__(self, pipe: Connection) -> None:
        self.pipe, self.count = pipe, 0

    @contextmanager
    def stage(self, name: str) -> Iterator[Advance]:
        number, told = self.count, time.monotonic()
        self.count += 1

        def advance(share: float) -> None:
            nonlocal told
            if time.monotonic() - told > PAUSE:
                told = time.monotonic()
                self.pipe.send(("share", number, share))

        self.pipe.send(("begin", number, name))
        yield advance
        self.pipe.send(("end", number))
