"""Times as multiples of a calibration loop, so that machines can be compared."""

from __future__ import annotations

import resource
import time
from collections.abc import Callable

import numpy as np

LEAST, TURNS, FEW, LONG = 0.02, 5, 2, 1.0
LOOP = np.random.default_rng(0).standard_normal((160, 160))


def calibration() -> float:
    """Some milliseconds of what programs do: interpreted steps, products, a sort, a long sum."""
    count = sum(i & 7 for i in range(60_000))
    product = LOOP @ LOOP @ LOOP
    return count + float(np.sort(product, axis=None).sum()) + float(np.sqrt(np.abs(product)).sum())


def processor() -> float:
    """Time [s] that this process and those that it has waited for had processors."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def times_calibration(task: Callable[[], object]) -> float:
    """Least processor time of a task over that of the loop, in turns after one that compiles.

    A short task is repeated until its turn lasts LEAST seconds; one of LONG seconds has FEW turns.
    """
    task()
    once = _taken(task, 1)
    count = max(1, round(LEAST / once))
    turns = [
        (_taken(task, count), _taken(calibration, 3)) for _ in range(FEW if once > LONG else TURNS)
    ]
    ours, loops = (min(column) for column in zip(*turns, strict=True))
    return (ours / count) / (loops / 3)


def _taken(task: Callable[[], object], count: int) -> float:
    started = processor()
    for _ in range(count):
        task()
    return processor() - started
