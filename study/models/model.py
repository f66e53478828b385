"""What a model is: settings that are prepared for a problem, run, and stepped.

A model is a frozen dataclass of its settings in SI units, made of a scene by a `ModelKind`. To add
one: a file with a model and its kind, and a line in `study.models.table.MODELS`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from study.problem.problem import PointProblem, Problem
from study.problem.trajectory import Trajectory
from study.progress import Progress, Silent
from study.results.records import Check, ModelRecord
from study.scene import Scene
from study.scene.part import without

if TYPE_CHECKING:
    from fuzzy.liver.stiffness import StiffnessEstimate
    from study.models.persistence import Persistence

Floats = NDArray[np.float64]
Estimates = Mapping[str, "StiffnessEstimate"]
"""Of stiffness, by fuzzy system."""


@dataclass(frozen=True)
class Simulation:
    """The motion of a model, and the steps that it took.

    `step` [s]: the shortest; `margin`: smallest ratio of the critical step to one that was taken;
    `inverted_cells`: turned inside out; `largest_strain`: absolute, in the kept frames, None where
    it is not known.
    """

    trajectory: Trajectory
    step: float
    margin: float = float("inf")
    inverted_cells: int = 0
    largest_strain: float | None = None


@dataclass(frozen=True)
class ModelRun:
    """The motion of a model with its record, in which its own numerical errors stand.

    `bounds`: motion at both ends of an interval of stiffness, if the model has one; `halved`: that
    by half as long steps, if it finished; `certified`: bound [m] (samples, probes) of what the
    displacement is off all unknowns, of a subspace that has one.
    """

    trajectory: Trajectory
    record: ModelRecord
    checks: tuple[Check, ...] = ()
    notes: tuple[str, ...] = ()
    bounds: tuple[Trajectory, Trajectory] | None = None
    halved: Trajectory | None = None
    certified: Floats | None = None


@dataclass(frozen=True)
class Stepper:
    """A prepared model at rest, to be stepped one step at a time.

    `take_step()` goes one step on, as a run does it, with all that a run does between steps;
    `take_bare_steps(count)` goes on without what is between them, None where there is nothing;
    `take_many(count)` takes so many at once, as a run does between samples, None where that costs
    what single ones do.
    `restart()` puts it at rest again, where what a step costs depends on the motion, or where tools
    that are moved are deepest.
    `displacement()` [m] (n, 3) of the nodes is the state that is delivered. `step` [s]; `unknowns`:
    components of displacement, or coordinates of a superposition, which every step turns into
    displacements. `bound()` [m] (probes,): of what the displacement delivered at the control points
    is off all unknowns, where that can be proven; it costs nothing unless it is asked for.
    """

    take_step: Callable[[], None]
    displacement: Callable[[], Floats]
    step: float
    unknowns: int
    take_bare_steps: Callable[[int], None] | None = None
    restart: Callable[[], None] = lambda: None
    bound: Callable[[], Floats] | None = None
    take_many: Callable[[int], None] | None = None

    def take_steps(self, count: int) -> None:
        """Go so many steps on, with all that a run does between them."""
        if self.take_many is not None:
            self.take_many(count)
            return
        for _ in range(count):
            self.take_step()


@dataclass(frozen=True)
class Watch:
    """Who is told how far a run is, and what of it is kept on disk meanwhile."""

    progress: Progress
    persistence: Persistence | None = None


SILENT = Watch(Silent())
"""Nobody is told, and nothing is kept."""


class Prepared(Protocol):
    """A model set up for a problem."""

    @property
    def critical_time_step(self) -> float:
        """Longest stable step [s] at rest; infinite for a model without a limit."""

    def describe(self) -> list[str]:
        """Lines on what would be run, for a person."""

    def simulate(self, longest: float | None = None) -> Simulation:
        """The motion by steps as the model chooses them, or by equal ones of at most so long [s].

        Equal steps divide the sampling interval.
        """

    def run(self, watch: Watch) -> ModelRun:
        """The motion with its record, and the error of its steps as far as it can be told."""

    def rest(self) -> Floats:
        """Displacement [m] (q, 3) at rest under the full load, at the points of the volume field.

        Linearised where the model is not linear.
        """

    def stepper(self) -> Stepper:
        """The model at rest, to be timed or stepped by hand."""


class Model(Protocol):
    """A model with its settings; `name` is unique in a study, `label` is printed."""

    @property
    def name(self) -> str:
        """Unique in a study."""

    @property
    def label(self) -> str:
        """In print."""

    def varied(self, **settings: Any) -> Self:
        """With other settings by name, plain values as JSON has them."""

    def prepare(self, problem: Problem) -> Prepared:
        """Set up for a problem. ValueError for settings that do not fit it."""


class PointModel(Protocol):
    """A model of a single control mass point."""

    @property
    def name(self) -> str:
        """Unique in a study."""

    def run(self, problem: PointProblem, watch: Watch) -> ModelRun:
        """The motion with its record."""


@dataclass(frozen=True, kw_only=True)
class ModelKind:
    """What a name in a scene's list of models stands for.

    `models` of a scene and the fuzzy estimates: one, or several as for `msm`; `on_point`: likewise
    for a scene that is a single control mass point, None where the kind needs an organ.
    `assumptions`: sentences on what was read into the paper or left out. `is_reference`: whether
    the others are compared with it; `any_load`: whether it follows a load whose place was not known
    beforehand; `is_tuned`: whether its models are those of the fuzzy estimates; `of_patient`:
    whether their stiffness is a patient's, who has no part in trade-offs and extremes;
    `follows_law`: whether its springs have the law and damping of the scene; `blind_to`: tables and
    keys of the scene that its models are made without, so that a run that differs in these alone
    need not move them again; `able`: names of `study.problem.features.FEATURES` that it follows.
    A model that is a reference has the name of its kind.
    """

    models: Callable[[Scene, Estimates], Iterable[Model]]
    on_point: Callable[[Scene, Estimates], Iterable[PointModel]] | None = None
    assumptions: Callable[[Scene], list[str]] = lambda _: []
    is_reference: bool = False
    is_tuned: bool = False
    of_patient: bool = False
    follows_law: bool = False
    any_load: bool = True
    blind_to: tuple[str, ...] = ()
    able: frozenset[str] = frozenset()

    def seen(self, scene: Scene) -> Scene:
        """What its models see of a scene: only a patient's are made of readings and rules."""
        unread = () if self.of_patient else ("patient", "fuzzy")
        return without(scene, (*unread, *self.blind_to))
