"""What a contender is asked for, and what it gives back."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from study.problem.problem import Problem
from study.problem.trajectory import Trajectory
from study.scene import Scene

Settings = dict[str, Any]
"""Plain values by name, as JSON has them."""


@dataclass(frozen=True)
class Observed:
    """The whole motion of one configuration.

    `step` [s]: the shortest that it took; `margin`: smallest ratio of the critical step to one that
    it took; `inverted_cells`: of a lattice, turned inside out.
    """

    trajectory: Trajectory
    step: float
    margin: float = float("inf")
    inverted_cells: int = 0


@dataclass(frozen=True)
class Ready:
    """A configuration that is set up and at rest.

    `take_step()` goes one step on, as a run does it, with all that a run does between steps;
    `take_bare_steps(count)` goes on without what is between them, None where there is nothing.
    `restart()` puts it at rest again, where what a step costs depends on the motion.
    `displacement()` [m] (n, 3) of the nodes is the state that is delivered. `step` [s]; `unknowns`:
    components of displacement, or coordinates of a superposition, which every step turns into
    displacements.
    """

    take_step: Callable[[], None]
    displacement: Callable[[], NDArray[np.float64]]
    step: float
    unknowns: int
    take_bare_steps: Callable[[int], None] | None = None
    restart: Callable[[], None] = lambda: None


class Contender(Protocol):
    """A module of `study.tradeoff.contenders`.

    `ANY_LOAD`: whether it follows a load whose place was not known beforehand.
    """

    @property
    def ANY_LOAD(self) -> bool:  # noqa: N802 - a constant of the module
        """See above."""

    def configurations(self, scene: Scene) -> Iterator[Settings]:
        """Settings that are worth a place in the table, the cheapest first."""

    def run(self, scene: Scene, posed: Problem, settings: Settings) -> Observed:
        """The whole motion."""

    def prepare(self, scene: Scene, posed: Problem, settings: Settings) -> Ready:
        """Set up to take steps."""
