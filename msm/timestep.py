"""Choice of the time steps of a run: a fraction of the critical step, or prescribed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]

ROUNDING = 1e-9
"""Relative deviation of an interval from a whole number of steps that counts as rounding."""
LOOK = 50
"""Steps between two checks of the critical step."""
ALLOWED = 0.95
"""Fraction of the critical step above which a stretch of automatic steps is repeated shorter."""
SHORTENINGS = 3
"""How often a run with automatic steps that still diverges halves its steps."""
SHORTEST = 0.02
"""Fraction of the critical step at rest below which the run counts as diverged."""


class Automatic(NamedTuple):
    """At most `fraction` of the critical step, which is updated as the body deforms.

    For fractions below 1, a stretch in which the critical step fell below the step is repeated with
    shorter steps. For 1 and above, the run may diverge.
    """

    fraction: float = 0.8


class Fixed(NamedTuple):
    """A constant step [s] that divides the sampling interval."""

    seconds: float


class Rate(NamedTuple):
    """Steps per second [Hz], raised to the next rate with whole steps in a sampling interval."""

    hertz: float


class Counts(NamedTuple):
    """Number of steps in each sampling interval (samples - 1,), such as those of another run."""

    substeps: Ints


Step = Automatic | Fixed | Rate | Counts


def prescribed_steps(step: Step, interval: float, intervals: int) -> Ints | None:
    """Steps in each interval of the given length [s]; None if the critical step decides.

    ValueError if a step is not positive or does not divide the interval, or if counts are missing.
    """
    if isinstance(step, Automatic):
        if not step.fraction > 0.0:
            raise ValueError(f"step.fraction must be positive, not {step.fraction:g}")
        return None
    if isinstance(step, Counts):
        if len(step.substeps) != intervals or not (step.substeps > 0).all():
            raise ValueError(
                f"step.substeps must give at least one step for each of the {intervals} sampling "
                f"intervals, got {len(step.substeps)} counts; take those of a finished run"
            )
        return np.asarray(step.substeps, dtype=np.int64)
    if isinstance(step, Rate):
        if not step.hertz > 0.0:
            raise ValueError(f"step.hertz must be positive, not {step.hertz:g}")
        return np.full(intervals, whole_steps(interval, 1.0 / step.hertz))
    return np.full(intervals, _steps_dividing(step.seconds, interval))


def whole_steps(interval: float, longest: float) -> int:
    """Fewest equal steps in an interval [s], none longer than `longest` [s]."""
    return max(1, int(np.ceil(interval / longest * (1.0 - ROUNDING))))


def _steps_dividing(seconds: float, interval: float) -> int:
    if not seconds > 0.0:
        raise ValueError(f"step.seconds must be positive, not {seconds:g}")
    count = round(interval / seconds)
    if count < 1 or abs(count * seconds / interval - 1.0) > ROUNDING:
        near = interval / whole_steps(interval, seconds)
        raise ValueError(
            f"step.seconds: {seconds:g} s does not divide the sampling interval of {interval:g} s; "
            f"take {near:.9g} s, or give a rate, which is adapted"
        )
    return count


class StepControl:
    """Step-size control of one run.

    `at_rest` [s]: critical step at rest; `current` [s]: critical step at the last check.
    `substeps`: steps taken in each interval; `margin`: smallest ratio of the critical step to an
    accepted step.
    """

    def __init__(self, step: Step, interval: float, intervals: int, at_rest: float) -> None:
        self.fraction = step.fraction if isinstance(step, Automatic) else 0.0
        self.repeats = 0.0 < self.fraction < 1.0
        self.prescribed = prescribed_steps(step, interval, intervals)
        self.interval = interval
        self.substeps = np.zeros(intervals, dtype=np.int64)
        self.current = self.at_rest = at_rest
        self.margin = float("inf")
        self.halvings = 0

    def choose(self, sample: int) -> int:
        """Number of steps in the next interval; kept where it would fall by a tenth at most."""
        if self.prescribed is not None:
            count = int(self.prescribed[sample])
        else:
            count = whole_steps(self.interval, self.fraction * self.current)
            before = int(self.substeps[sample - 1]) if sample else 0
            count = before if 0.9 * before <= count <= before else count
        self.substeps[sample] = count
        self.margin = min(self.margin, self.current * count / self.interval)
        return count

    def is_check_due(self, sample: int, unchecked: int) -> bool:
        """Whether the critical step must be checked: every LOOK steps, and at the end of the run.

        In intervals of more than LOOK steps, also at the end of each.
        """
        long = self.substeps[sample] > LOOK or sample == len(self.substeps) - 1
        return bool(long or unchecked >= LOOK)

    def accepts(self, dt: float, critical: float) -> bool:
        """Update the critical step [s]; False if the steps of dt [s] since then were too long."""
        self.current = critical
        longest = max(ALLOWED, self.fraction) * self.current * (1.0 + ROUNDING)
        if self.repeats and (not dt <= longest or self._is_too_short()):
            return False
        self.margin = min(self.margin, self.current / dt)
        return True

    def halve(self) -> None:
        """Halve the steps from now on, after a divergence."""
        self.halvings += 1
        self.fraction *= 0.5

    def gives_up(self) -> bool:
        """Whether to end the run as diverged, because shorter steps are excluded or do not help."""
        return not self.repeats or self._is_too_short() or self.halvings > SHORTENINGS

    def _is_too_short(self) -> bool:
        return not self.current >= SHORTEST * self.at_rest
