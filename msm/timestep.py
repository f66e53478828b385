"""How the step of a run is chosen: it follows the limit, or it is given."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]

ROUNDING = 1e-9
"""By how much of itself an interval may miss a whole number of steps."""
LOOK = 50
"""Steps after which the limit is looked at."""
ALLOWED = 0.95
"""How much of the limit a step that follows it may take up before it is repeated shorter."""
SHORTENINGS = 3
"""How often a run that followed the limit and still went beyond all bounds halves its steps."""
SHORTEST = 0.02
"""Of the limit at rest: a body that needs shorter steps is lost."""


class Automatic(NamedTuple):
    """At most `fraction` of the critical step, which is followed as the body deforms.

    Up to 1 excluded, a stretch in which the limit fell below the step is repeated with shorter
    ones. From 1 on the run is left to diverge.
    """

    fraction: float = 0.8


class Fixed(NamedTuple):
    """A step [s] that is never changed; it must divide the sampling interval."""

    seconds: float


class Rate(NamedTuple):
    """Steps per second [Hz], raised to the next rate of which a sample takes whole steps."""

    hertz: float


class Counts(NamedTuple):
    """Steps in each sampling interval (samples - 1,), such as twice those of an earlier run."""

    substeps: Ints


Step = Automatic | Fixed | Rate | Counts


def planned(step: Step, interval: float, intervals: int) -> Ints | None:
    """Steps in each interval of the given length [s], or None if the limit decides.

    ValueError if a step is not positive, does not divide the interval, or if counts are missing.
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
    return np.full(intervals, _dividing(step.seconds, interval))


def whole_steps(interval: float, longest: float) -> int:
    """Fewest equal steps in an interval [s], none longer than `longest` [s]."""
    return max(1, int(np.ceil(interval / longest * (1.0 - ROUNDING))))


def _dividing(seconds: float, interval: float) -> int:
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


class Pace:
    """The steps of one run as it goes.

    `at_rest` [s]: the critical step at rest, `now` [s] where it was last looked at. `substeps`:
    steps taken in each interval; `margin`: smallest ratio of the limit to a step that was kept.
    """

    def __init__(self, step: Step, interval: float, intervals: int, at_rest: float) -> None:
        self.fraction = step.fraction if isinstance(step, Automatic) else 0.0
        self.repeats = 0.0 < self.fraction < 1.0
        self.plan = planned(step, interval, intervals)
        self.interval = interval
        self.substeps = np.zeros(intervals, dtype=np.int64)
        self.now = self.at_rest = at_rest
        self.margin = float("inf")
        self.halvings = 0

    def choose(self, sample: int) -> int:
        """Steps in the interval ahead; a tenth fewer than before are not worth the change."""
        if self.plan is not None:
            count = int(self.plan[sample])
        else:
            count = whole_steps(self.interval, self.fraction * self.now)
            before = int(self.substeps[sample - 1]) if sample else 0
            count = before if 0.9 * before <= count <= before else count
        self.substeps[sample] = count
        self.margin = min(self.margin, self.now * count / self.interval)
        return count

    def is_due(self, sample: int, unseen: int) -> bool:
        """Whether to look: every LOOK steps, also at the end of long intervals and of the run."""
        long = self.substeps[sample] > LOOK or sample == len(self.substeps) - 1
        return bool(long or unseen >= LOOK)

    def keeps_up(self, dt: float, limit: float) -> bool:
        """Take in the limit [s]; False if the steps of dt [s] since the last look were too long."""
        self.now = limit
        longest = max(ALLOWED, self.fraction) * self.now * (1.0 + ROUNDING)
        if self.repeats and (not dt <= longest or self._is_too_short()):
            return False
        self.margin = min(self.margin, self.now / dt)
        return True

    def halve(self) -> None:
        """Take half the steps from now on: with these the body went beyond all bounds."""
        self.halvings += 1
        self.fraction *= 0.5

    def gives_up(self) -> bool:
        """Whether shorter steps would not help, or are not wanted."""
        return not self.repeats or self._is_too_short() or self.halvings > SHORTENINGS

    def _is_too_short(self) -> bool:
        return not self.now >= SHORTEST * self.at_rest
