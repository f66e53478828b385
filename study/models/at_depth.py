"""A lattice stepped from where its tools are deepest, where a step costs most."""

from __future__ import annotations

from collections.abc import Callable

from msm.stepper import LatticeStepper, State
from msm.timestep import LOOK


class AtDepth:
    """Steps of a lattice from rest until `restart`, which puts it where its tools are deepest.

    `at` [s]: when they are; `step`: the step [s] for a critical one [s]. What is touched is stopped
    in every step, and a step from rest would leave that out. The way there is gone once.
    """

    def __init__(self, motion: LatticeStepper, at: float, step: Callable[[float], float]) -> None:
        self.motion, self.at, self.step = motion, at, step
        self.dt = step(motion.limit_at_rest)
        self.deepest: State | None = None

    def take_step(self) -> None:
        """Take one step, with what a run does between steps."""
        self.motion.take_step(self.dt)

    def advance(self, count: int) -> None:
        """Take so many steps and nothing else."""
        self.motion.advance(count, self.dt)

    def restart(self) -> None:
        """Put the lattice where the tools are deepest."""
        motion = self.motion
        if self.deepest is None:
            motion.restart()
            while motion.t < self.at:
                self.dt = self.step(motion.limit())
                motion.advance(LOOK, self.dt)
            self.dt, self.deepest = self.step(motion.limit()), motion.state()
        motion.put_back(self.deepest)
        motion.t, motion.unchecked = self.at, 0
