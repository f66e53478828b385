"""The parts of a corrected lattice stepped together, one step of the coarse lattice at a time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fem_reference.subspace import SubspaceMotion
from study.models.deformed import Deformed
from study.models.finite_elements import FRAME_RATE
from study.models.model import Stepper
from study.models.remainder import PreparedRemainder
from study.problem.damping import RayleighDamping

Floats = NDArray[np.float64]


class Together:
    """A nonlinear lattice, itself linear, and linear elements, at rest and then by the same steps.

    `lattice` is the first, with its `step` [s]. The displacement of the mesh's vertices is made
    when it is asked for, and at the end of every frame. Until then the linear parts wait: many
    steps at once cost them little more than one.
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
        self.elements = SubspaceMotion(shape.subspace, damping, factor, self.step)
        self.every, self.waiting = max(1, round(1.0 / (FRAME_RATE * self.step))), 0

    @property
    def unknowns(self) -> int:
        """Components of the lattice's displacement, and coordinates of either linear part."""
        among = self.reduced.squares.size + self.shape.subspace.load.size
        return int(self.lattice.unknowns + among)

    def take_step(self) -> None:
        """Take one step with all that a run does between steps."""
        self.lattice.take_step()
        self.waiting += 1
        if self.waiting >= self.every:
            self.displacement()

    def _catch_up(self) -> None:
        """Bring the linear parts to where the lattice is."""
        if self.waiting:
            self.linear.advance(self.waiting, self.step)
            self.elements.go_on(self.waiting)
            self.waiting = 0

    def displacement(self) -> Floats:
        """Of the vertices of the elements' mesh [m] (v, 3), as they are now."""
        self._catch_up()
        below = self.reduced.displacement(self.linear.coordinates)
        beyond = self.shape.weights @ (self.lattice.displacement() - below)
        return np.asarray(self.elements.deliver().reshape(-1, 3) + beyond)

    def restart(self) -> None:
        """Put all parts at rest again."""
        self.lattice.restart()
        self.linear.restart()
        self.elements.restart()
        self.waiting = 0

    def stepper(self) -> Stepper:
        """As a model gives it."""
        return Stepper(
            self.take_step, self.displacement, self.step, self.unknowns, restart=self.restart
        )
