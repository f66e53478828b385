"""Workers of a sweep: what two bring over one, and what the runner costs on runs of a second.

    python -m tests.benchmarks.bench_sweep

takes two minutes. One and two workers are measured in turns, and each figure is printed for every
turn with the load of the machine: what others take of its cores is missing from the throughput.
A run counts processor time, so its wall time tells which share of a core it had, and the throughput
is also given for equal shares. Overhead is the time of a worker outside its runs, over that within
them, storing included; starting the workers is timed apart.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from study.sweep.store import Store
from study.sweep.task import Task
from study.sweep.workers import local, one_each

TURNS = 3
RUNS = 12
SECONDS = 1.0


class Sweep(NamedTuple):
    """Seconds to start the workers, seconds of the sweep, and those spent within runs."""

    starting: float
    elapsed: float
    within: float


def main() -> None:
    """Measure and print."""
    for turn in range(TURNS):
        one, two = (sweep(workers) for workers in (1, 2))
        gain = one.elapsed / two.elapsed
        sys.stdout.write(
            f"turn {turn + 1}: two workers do {gain:.2f} times the runs of one,"
            f" {gain * share(one) / share(two):.2f} times for equal shares of a core"
            f" (had {share(one):.2f} and {share(two):.2f}); overhead {overhead(one, 1):.1%} with"
            f" one, {overhead(two, 2):.1%} with two; start {one.starting:.1f} s and"
            f" {two.starting:.1f} s; load {os.getloadavg()[0]:.1f}\n"
        )


def sweep(workers: int) -> Sweep:
    """Run and store RUNS runs of SECONDS of processor time."""
    tasks = [Task("tests.sweep_tasks:spin", {"x": x, "seconds": SECONDS}) for x in range(RUNS)]
    warm = [Task("tests.sweep_tasks:spin", {"x": x, "seconds": 0.01}) for x in range(2 * workers)]
    begin = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder, local(workers) as client:
        list(one_each(client, warm))
        start = time.perf_counter()
        within = 0.0
        for task, found in one_each(client, tasks):
            assert found.value is not None, found.message
            Store(Path(folder)).put(task, found.value, found.wall)
            within += found.wall
        return Sweep(start - begin, time.perf_counter() - start, within)


def share(found: Sweep) -> float:
    """Of a core that a run had."""
    return RUNS * SECONDS / found.within


def overhead(found: Sweep, workers: int) -> float:
    """Time of the workers outside runs, over that within."""
    return found.elapsed * workers / found.within - 1.0


if __name__ == "__main__":
    main()
