"""Independent jobs, run one after another or in a pool of forked processes.

A forked process shares what the parent has built so far, and runs one job after another. It ends
with the pool in every case: the parent asks it to, and if the parent dies, it notices.
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

from study.system import signals
from study.system.progress import Advance, Lines, Progress, Silent

EXIT_TIMEOUT = 5.0
"""Seconds that a process has to exit before it is killed."""
PROGRESS_INTERVAL = 0.1
"""Least time [s] between two progress messages of a stage."""


class Job(NamedTuple):
    """A function with a unique name; it reports its progress, and its result must be picklable."""

    name: str
    work: Callable[[Progress], Any]


class JobPool(Protocol):
    """Accepts jobs at any time, and returns their results once all have ended."""

    def start(self, job: Job) -> None:
        """Submit a job; it may run at once or later."""

    def results(self) -> dict[str, Any]:
        """Results of all jobs by name. An exception of a job is raised here."""


def available() -> int:
    """Number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def can_fork() -> bool:
    """Whether processes can be forked; some libraries on macOS do not survive it."""
    return "fork" in multiprocessing.get_all_start_methods() and sys.platform != "darwin"


@contextmanager
def job_pool(count: int, progress: Progress) -> Iterator[JobPool]:
    """A pool of `count` processes, or of this one alone; no process is left when the block ends."""
    if count < 2 or not can_fork():
        yield _SerialPool(progress)
        return
    found = _ProcessPool(count, progress)
    try:
        yield found
    finally:
        found.stop()


class _SerialPool:
    """Runs jobs in this process, in order, when the results are requested."""

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
    """A process with the jobs that existed when it was forked, and its current job's number."""

    def __init__(self, jobs: list[Job], progress: Progress) -> None:
        context = multiprocessing.get_context("fork")
        self.known, self.at = len(jobs), -1
        self.stages: dict[int, tuple[AbstractContextManager[Advance], Advance]] = {}
        self.pipe, theirs = context.Pipe()
        self.process: BaseProcess = context.Process(
            target=_serve, args=(theirs, list(jobs), progress), daemon=True
        )
        with _signals_blocked():
            self.process.start()
        theirs.close()

    def give(self, number: int) -> None:
        self.at = number
        self.pipe.send(number)


class _ProcessPool:
    """Runs jobs in child processes, while this one waits."""

    def __init__(self, count: int, progress: Progress) -> None:
        self.count, self.progress = count, progress
        self.jobs: list[Job] = []
        self.waiting: deque[int] = deque()
        self.workers: list[_Worker] = []
        self.found: dict[str, Any] = {}

    def start(self, job: Job) -> None:
        self.jobs.append(job)
        self.waiting.append(len(self.jobs) - 1)
        self._dispatch()

    def results(self) -> dict[str, Any]:
        while len(self.found) < len(self.jobs):
            self._dispatch()
            busy = {worker.pipe: worker for worker in self.workers if worker.at >= 0}
            for pipe in wait(list(busy)):
                self._receive(busy[pipe])  # type: ignore[index] # one of the pipes given
        return {job.name: self.found[job.name] for job in self.jobs}

    def _dispatch(self) -> None:
        """Give jobs to idle processes; fork a new process for a job that none of them knows."""
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

    def _receive(self, worker: _Worker) -> None:
        try:
            kind, *content = worker.pipe.recv()
        except (EOFError, ConnectionError):
            raise _death_of(self.jobs[worker.at].name, worker.process) from None
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
        """End all processes, those in the middle of a job at once."""
        for worker in self.workers:
            if worker.at >= 0:
                worker.process.terminate()
        for worker in self.workers:
            _end(worker)
        self.workers.clear()


class _RemoteTraceback(Exception):  # noqa: N818 - the cause of one, and only shown
    """The traceback of an exception that was raised in another process."""

    def __str__(self) -> str:
        return f"\n{self.args[0]}"


def _end(worker: _Worker) -> None:
    """Ask an idle process to exit, and kill it if it does not."""
    with suppress(OSError):  # the process may have ended
        # Processes forked later inherit the pipe, so closing it would not be noticed.
        worker.pipe.send(None)
    worker.pipe.close()
    worker.process.join(EXIT_TIMEOUT)
    if worker.process.is_alive():
        worker.process.kill()
        worker.process.join()


def _death_of(job: str, process: BaseProcess) -> Exception:
    """The exception for a process that ended without reporting anything."""
    process.join(EXIT_TIMEOUT)
    code = process.exitcode or 0
    if code == -signal.SIGKILL:
        return MemoryError(f"the process of {job} was killed")
    how = f"ended by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"
    return OSError(f"the process of {job} {how}; run with --workers 1 to see why")


@contextmanager
def _signals_blocked() -> Iterator[None]:
    """Block signals while forking, so that the child does not handle them for the parent."""
    with warnings.catch_warnings():
        # Python warns that a fork of a process with threads may deadlock on their locks. The child
        # needs none of them: it computes, and communicates through its pipe.
        warnings.simplefilter("ignore", DeprecationWarning)
        before = signal.pthread_sigmask(signal.SIG_BLOCK, signals.numbers())
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


# --- in the process ------------------------------------------------------------------------------


def _serve(pipe: Connection, jobs: list[Job], progress: Progress) -> NoReturn:
    """Run jobs by their numbers until the pipe is closed, without unwinding the parent's stack."""
    try:
        _follow_parent()
        with ExitStack() as stack:
            stack.callback(pipe.close)
            while (number := pipe.recv()) is not None:
                pipe.send(_done(jobs[number], _child_progress(progress, pipe)))
    finally:  # on any exception the parent is gone or out of reach
        os._exit(0)


def _follow_parent() -> None:
    """Ignore keyboard signals, which the parent handles, and exit when the parent does."""
    for number in signals.numbers():
        # A pending SIGTERM would be lost if it were ignored, even for a moment.
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
    """The last message on a job to the parent."""
    try:
        return "done", job.work(progress)
    except BaseException as error:  # the parent raises it
        return "failed", _picklable(error), traceback.format_exc()


def _picklable(error: BaseException) -> BaseException:
    """The exception in a form that can be sent; its cause where that is the actual reason."""
    below = None if error.__suppress_context__ else error.__context__
    if isinstance(error, ValueError) and isinstance(below, OSError):
        return below
    try:
        pickle.loads(pickle.dumps(error))  # noqa: S301 - one's own
    except Exception:  # a class that does not support pickling
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


def _child_progress(progress: Progress, pipe: Connection) -> Progress:
    """Lines are printed by the child, where the time is taken; bars are drawn by the parent."""
    return progress if isinstance(progress, Lines | Silent) else _SentProgress(pipe)


class _SentProgress:
    """Sends the progress of a process to its parent."""

    def __init__(self, pipe: Connection) -> None:
        self.pipe, self.count = pipe, 0

    @contextmanager
    def stage(self, name: str) -> Iterator[Advance]:
        number, told = self.count, time.monotonic()
        self.count += 1

        def advance(share: float) -> None:
            nonlocal told
            if time.monotonic() - told > PROGRESS_INTERVAL:
                told = time.monotonic()
                self.pipe.send(("share", number, share))

        self.pipe.send(("begin", number, name))
        yield advance
        self.pipe.send(("end", number))
