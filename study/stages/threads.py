"""Parts of a product side by side, in as many threads as a run lets a process have.

A process has one thread unless it is told otherwise, so that a sweep that fills all processors with
runs does not share each of them among threads. Who waits for a part sleeps: a part whose processor
is busy with something else is late, and takes no time from it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar

from study.stages.job_pool import available

_ALLOWED: ContextVar[int | None] = ContextVar("allowed", default=None)
_HELPERS: dict[int, ThreadPoolExecutor] = {}
"""The second thread of a process by its number: a fork has none of the threads before it."""


@contextmanager
def threads(count: int) -> Iterator[None]:
    """Let what is done in the block use so many processors, or as many as there are."""
    token = _ALLOWED.set(max(1, min(count, available())))
    try:
        yield
    finally:
        _ALLOWED.reset(token)


def allowed(otherwise: int = 1) -> int:
    """Processors that what is done now may use, `otherwise` if it was not said."""
    return _ALLOWED.get() or otherwise


def side_by_side(*parts: Callable[[], None]) -> None:
    """Compute parts that do not touch each other: all here, or the second in another thread.

    They are to release the interpreter's lock. Whatever a part raises is raised here.
    """
    if len(parts) != 2 or allowed() < 2:
        for part in parts:
            part()
        return
    waiting = _helper().submit(parts[1])
    try:
        parts[0]()
    finally:
        waiting.result()


def _helper() -> ThreadPoolExecutor:
    number = os.getpid()
    if number not in _HELPERS:
        _HELPERS.clear()
        _HELPERS[number] = ThreadPoolExecutor(1, "second")
    return _HELPERS[number]
