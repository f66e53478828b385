"""Parts of a product in as many threads as a run grants to a process.

A process has one thread unless a run grants more, so that a sweep that occupies all processors does
not oversubscribe them. Waiting for a part sleeps: a part on a busy processor delays its caller
without taking processor time from it.
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
"""The second thread by process id: a forked child does not inherit the parent's threads."""


@contextmanager
def threads(count: int) -> Iterator[None]:
    """Grant `count` processors to the code in the block, at most as many as there are."""
    token = _ALLOWED.set(max(1, min(count, available())))
    try:
        yield
    finally:
        _ALLOWED.reset(token)


def allowed(otherwise: int = 1) -> int:
    """Number of processors granted to the calling code, `otherwise` if nothing was set."""
    return _ALLOWED.get() or otherwise


def side_by_side(*parts: Callable[[], None]) -> None:
    """Compute independent parts, the second of two in another thread where one is granted.

    Parts should release the interpreter lock. An exception of a part is raised here.
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
