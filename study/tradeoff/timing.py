"""The cost of a step, with all configurations timed in turns in one process.

Every turn starts from rest under the scene's load, and so takes the same steps again: steps of an
implicit integrator cost more while the body moves. Under moved tools it starts at the deepest
indentation, since contact is resolved in each step.

Disturbances of the machine are spread over all configurations alike by taking turns. Each
configuration has taken some steps before the first timed turn, so that compilation and first memory
access are not included.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from study.models.model import Stepper

Floats = NDArray[np.float64]
Clock = Callable[[], float]

REPEATS = 5
QUICK_REPEATS = 3
WARM_UP = 3
SECONDS = 0.3
"""Approximate upper limit of one turn of a configuration."""
FEWEST, MOST = 20, 200
"""Limits of the number of steps in a turn."""


@dataclass(frozen=True)
class Timing:
    """Seconds of single steps (turns, steps), and of a step without the work between steps."""

    walls: Floats
    bare: Floats | None

    @property
    def step(self) -> tuple[float, float, float]:
        """Lower quartile, median and upper quartile over the turns of the mean step [s]."""
        low, middle, high = np.percentile(self.walls.mean(axis=1), [25, 50, 75])
        return float(low), float(middle), float(high)


def in_turns(
    ready: Sequence[Stepper],
    repeats: int,
    clock: Clock = time.perf_counter,
    on_turn: Callable[[float], None] = lambda _: None,
) -> list[Timing]:
    """Timings of all steppers, each with a fixed number of steps per turn."""
    counts = [_count(one, clock) for one in ready]
    walls: list[list[Floats]] = [[] for _ in ready]
    bare: list[list[float]] = [[] for _ in ready]
    for turn in range(repeats):
        for k, (one, count) in enumerate(zip(ready, counts, strict=True)):
            one.restart()
            walls[k].append(_steps(one.take_step, count, clock))
            if one.take_bare_steps is not None:
                one.restart()
                bare[k].append(_bare(one.take_bare_steps, count, clock))
        on_turn((turn + 1) / repeats)
    return [
        Timing(np.array(w), np.array(b) if b else None) for w, b in zip(walls, bare, strict=True)
    ]


def _count(ready: Stepper, clock: Clock) -> int:
    """Number of steps in a turn, after some warm-up steps."""
    if ready.take_bare_steps is not None:
        ready.take_bare_steps(WARM_UP)
    wall = float(np.median(_steps(ready.take_step, WARM_UP, clock)))
    return int(np.clip(SECONDS / max(wall, 1e-9), FEWEST, MOST))


def _steps(take_step: Callable[[], None], count: int, clock: Clock) -> Floats:
    ticks = np.empty(count + 1)
    ticks[0] = clock()
    for n in range(count):
        take_step()
        ticks[n + 1] = clock()
    return np.diff(ticks)


def _bare(take_steps: Callable[[int], None], count: int, clock: Clock) -> float:
    started = clock()
    take_steps(count)
    return (clock() - started) / count
