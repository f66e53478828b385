"""Tasks on the workers of a Dask cluster, at most one at a time on each.

Each task is bound to its worker. The task that was running when a worker died is therefore known,
whatever the scheduler would retry, and no other task is blamed.
"""

from __future__ import annotations

import logging
import os
import time
import uuid
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from typing import NamedTuple

import dask.config
import distributed
from distributed import Client, Future, KilledWorker
from distributed.system import MEMORY_LIMIT
from distributed.utils import silence_logging_cmgr

from study.sweep.attempt import Attempt, attempt
from study.sweep.canonical import canonical
from study.sweep.program import program
from study.sweep.task import Task

THREADS = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
"""Environment of a local worker: it has one core, and sums must not depend on idle cores."""
SETTINGS = {
    "distributed.scheduler.allowed-failures": 0,
    "distributed.scheduler.worker-ttl": None,  # compiled code may hold the interpreter for minutes
    "distributed.worker.memory.target": False,  # results are small: nothing to move to the disk,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,  # and nothing to wait for
    "distributed.worker.memory.terminate": 0.95,
    "distributed.worker.profile.enabled": False,
}
CONNECT_TIMEOUT = 10.0
"""Seconds that a scheduler has to answer."""
POLL = 0.5
"""Seconds between two checks of which workers are alive."""
RESULT_TIMEOUT = 10.0
"""Seconds to wait for the result of a finished task."""
NO_WORKER_TIMEOUT = 60.0
"""Seconds without any worker after which a sweep gives up."""
DIED = (
    "its worker died: killed, out of memory, or crashed in compiled code; run the case alone to see"
)


class Running(NamedTuple):
    """A running task: on which worker, since when."""

    task: Task
    worker: str
    start: float


@contextmanager
def local(count: int) -> Iterator[Client]:
    """A cluster of `count` processes on this machine, gone when the block ends.

    Each has its share of the memory; a process that exceeds it is killed.
    """
    with (
        _environment(THREADS),
        dask.config.set(SETTINGS),
        distributed.LocalCluster(
            n_workers=count,
            threads_per_worker=1,
            processes=True,
            memory_limit=MEMORY_LIMIT // count,
            dashboard_address=None,
            silence_logs=logging.CRITICAL,
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


@contextmanager
def distant(address: str) -> Iterator[Client]:
    """The cluster of a running scheduler. ValueError if it does not answer."""
    try:
        client = distributed.Client(address, timeout=CONNECT_TIMEOUT)
    except (OSError, ValueError) as error:
        raise ValueError(
            f"scheduler {address}: no answer ({error}); start one with `dask scheduler`, and "
            f"workers with `dask worker {address} --nthreads 1` in this environment"
        ) from None
    with client, silence_logging_cmgr(logging.CRITICAL):
        yield client


@contextmanager
def _environment(wanted: dict[str, str]) -> Iterator[None]:
    """Environment variables that processes started in the block inherit."""
    before = dict(os.environ)
    os.environ.update(wanted)
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


def one_each(client: Client, tasks: Sequence[Task]) -> Iterator[tuple[Task, Attempt]]:
    """Each task with its outcome, as they end. ValueError if the cluster cannot run them."""
    waiting = deque(tasks)
    running: dict[Future[Attempt], Running] = {}
    while waiting or running:
        alive = _live_workers(client, patience=None if running else NO_WORKER_TIMEOUT)
        for worker in alive - {at.worker for at in running.values()}:
            if waiting:
                running |= _started(client, waiting.popleft(), worker)
        if running:
            _wait(running)
        for future, at in list(running.items()):
            found = _found(future, at, alive)
            if found is not None:
                del running[future]
                yield at.task, found


def _live_workers(client: Client, *, patience: float | None) -> set[str]:
    """Addresses of the workers. ValueError if there is none for `patience` [s], unless None."""
    try:
        if patience is not None:
            client.wait_for_workers(1, timeout=patience)
        return set(client.nthreads())
    except (OSError, TimeoutError) as error:
        raise ValueError(
            f"no workers ({error}); start some, then the sweep again: what is kept is not computed "
            "twice"
        ) from None


def _started(client: Client, task: Task, worker: str) -> dict[Future[Attempt], Running]:
    """A task sent to a worker."""
    future = client.submit(
        attempt,
        task.function,
        canonical(task.arguments),
        program(task.module),
        key=f"{task.function}-{uuid.uuid4().hex}",  # of this sweep alone, on a shared scheduler
        workers=[worker],
    )
    return {future: Running(task, worker, time.perf_counter())}


def _wait(running: dict[Future[Attempt], Running]) -> None:
    """Wait until a task has ended, or until the next check of the workers."""
    with suppress(TimeoutError, CancelledError):  # a cancelled one is told by its result
        distributed.wait(list(running), timeout=POLL, return_when="FIRST_COMPLETED")


def _found(future: Future[Attempt], at: Running, alive: set[str]) -> Attempt | None:
    """How a task ended, None if it has not.

    A worker that died on a remote cluster is gone, while the scheduler, which may be set to retry,
    waits for it to come back.
    """
    crashed = Attempt("crashed", None, DIED, time.perf_counter() - at.start)
    try:
        if future.done():
            return Attempt(*future.result(timeout=RESULT_TIMEOUT))
    except KilledWorker:
        return crashed
    except TimeoutError:  # done, but the worker died with the result
        pass
    except Exception as error:  # it could not even begin
        raise ValueError(
            f"worker {at.worker} cannot run {at.task.function}: {error}; start the workers from "
            "this checkout, in this environment"
        ) from None
    return None if at.worker in alive else crashed
