"""The parts of a corrected lattice stepped together, one step of the coarse lattice at a time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fem_reference.subspace import SubspaceMotion, transitions
from study.models.deformed import Deformed
from study.models.finite_elements import FRAME_RATE
from study.models.model import Stepper
from study.models.remainder import PreparedRemainder
from study.problem.damping import RayleighDamping

Floats = NDArray[np.float64]


class Frame:
    """Several steps of a motion in a subspace as one, with the same result but for rounding.

    A step takes a modal coordinate from y to A y + b f + c f', with the loads f and f' at its ends.
    A frame of n steps therefore takes it to A^n y plus a weighted sum of the loads at the ends of
    all steps.
    """

    def __init__(self, motion: SubspaceMotion, damping: RayleighDamping, count: int) -> None:
        self.motion, self.count = motion, count
        moved = transitions(motion.squares, damping, motion.step)
        over, slope = moved[:, :2, :2], moved[:, :2, 3] / motion.step
        self.loads = motion.modes.T @ motion.subspace.loads
        self.kept = np.broadcast_to(np.eye(2), over.shape)
        self.weights = np.zeros((len(over), 2, count + 1))
        for n in reversed(range(count)):
            self.weights[:, :, n + 1] += np.einsum("mij,mj->mi", self.kept, slope)
            self.weights[:, :, n] += np.einsum("mij,mj->mi", self.kept, moved[:, :2, 2] - slope)
            self.kept = self.kept @ over

    def go_on(self) -> None:
        """Take all steps of the frame."""
        motion, state = self.motion, self.motion.state[:, :2]
        times = np.asarray(motion.time + motion.step * np.arange(self.count + 1))
        factors = np.asarray(motion.factor(times)).reshape(self.count + 1, -1)
        pushed = np.einsum("mik,mk->mi", self.weights, self.loads @ factors.T)
        state[:] = np.einsum("mij,mj->mi", self.kept, state) + pushed
        motion.time += motion.step * self.count


class CoupledStepper:
    """A nonlinear lattice, its linearisation, and linear elements, advanced by the same steps.

    `lattice`: the nonlinear lattice with its `step` [s]. The displacement of the mesh's vertices is
    computed on request, and at the end of every frame. The linear parts are advanced only then,
    since many of their steps at once cost little more than one.
    """

    def __init__(
        self,
        remainder: PreparedRemainder,
        shape: Deformed,
        factor: Callable[[Floats], Floats],
        damping: RayleighDamping,
    ) -> None:
        self.lattice, self.shape = remainder.lattice.stepper(), shape
        self.step = self.lattice.step
        self.reduced = remainder.linear()
        self.linear = remainder.linear_motion(self.reduced)
        self.every, self.waiting = max(1, round(1.0 / (FRAME_RATE * self.step))), 0
        self.delivered: Floats | None = None
        self.elements = SubspaceMotion(shape.subspace, damping, factor, self.step)
        self.frame = Frame(self.elements, damping, self.every)
        self.start = shape.start - shape.weights @ remainder.start
        below = np.asarray(shape.weights @ self.reduced.shapes.reshape(shape.weights.shape[1], -1))
        own = shape.subspace.vectors @ self.elements.modes
        shapes = np.hstack([own, -below.reshape(len(own), -1)])
        # Single precision: read once a frame, they would evict everything else from the cache.
        self.shapes = np.asfortranarray(shapes, dtype=np.float32)

    @property
    def unknowns(self) -> int:
        """Displacement components of the lattice, plus the coordinates of both linear parts."""
        among = self.reduced.squares.size + self.shape.subspace.load.size
        return int(self.lattice.unknowns + among)

    def take_step(self) -> None:
        """Take one step, including the work that a run does between steps."""
        self.take_steps(1)

    def take_steps(self, count: int) -> None:
        """Take `count` steps, including the work that a run does between steps."""
        while count > 0:
            taken = min(count, self.every - self.waiting)
            self.lattice.take_steps(taken)
            self.delivered = None
            self.waiting += taken
            count -= taken
            if self.waiting >= self.every:
                self.displacement()

    def _catch_up(self) -> None:
        """Advance the linear parts to the time of the lattice."""
        if self.waiting:
            self.linear.advance(self.waiting, self.step)
            if self.waiting == self.every:
                self.frame.go_on()
            else:
                self.elements.go_on(self.waiting)
            self.waiting = 0

    def displacement(self) -> Floats:
        """Displacement [m] (v, 3) of the vertices of the elements' mesh, at the current time."""
        if self.delivered is None:  # a frame that has just ended has delivered it
            self._catch_up()
            coordinates = np.concatenate([self.elements.state[:, 0], self.linear.coordinates])
            linear = (self.shapes @ coordinates.astype(np.float32)).reshape(-1, 3)
            nonlinear = self.shape.weights @ self.lattice.displacement()
            self.delivered = self.start + linear + nonlinear
        return self.delivered

    def restart(self) -> None:
        """Return all parts to rest."""
        self.lattice.restart()
        self.linear.restart()
        self.elements.restart()
        self.waiting, self.delivered = 0, None

    def stepper(self) -> Stepper:
        """The stepper of the model."""
        return Stepper(
            self.take_step,
            self.displacement,
            self.step,
            self.unknowns,
            restart=self.restart,
            take_many=self.take_steps,
        )
