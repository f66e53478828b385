"""Steps of a lattice from the state of deepest indentation, where a step costs most."""

from __future__ import annotations

from collections.abc import Callable

from msm.stepper import LatticeStepper, State
from msm.timestep import LOOK


class IndentedStepper:
    """Steps of a lattice from rest until `restart`, then from its deepest indentation.

    `at` [s]: time of the deepest indentation; `step`: maps a critical step [s] to the step [s]
    taken. Contact is resolved in every step, a cost that steps from rest would omit. The motion up
    to the indentation is computed once.
    """

    def __init__(self, motion: LatticeStepper, at: float, step: Callable[[float], float]) -> None:
        self.motion, self.at, self.step = motion, at, step
        self.dt = step(motion.limit_at_rest)
        self.deepest: State | None = None

    def take_step(self) -> None:
        """Take one step, including the work that a run does between steps."""
        self.motion.take_step(self.dt)

    def advance(self, count: int) -> None:
        """Take `count` steps without the work between them."""
        self.motion.advance(count, self.dt)

    def restart(self) -> None:
        """Return the lattice to the state of deepest indentation."""
        motion = self.motion
        if self.deepest is None:
            motion.restart()
            while motion.t < self.at:
                self.dt = self.step(motion.limit())
                motion.advance(LOOK, self.dt)
            self.dt, self.deepest = self.step(motion.limit()), motion.state()
        motion.put_back(self.deepest)
        motion.t, motion.unchecked = self.at, 0
