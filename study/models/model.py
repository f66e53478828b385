"""What a model is: settings that are prepared for a problem, run, and stepped.

A model is a frozen dataclass of its settings in SI units, made from a scene by a `ModelKind`. To
add one, write a file with a model and its kind, and a line in `study.models.table.MODELS`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from study.problem.problem import PointProblem, Problem
from study.problem.trajectory import Trajectory
from study.results.records import Check, ModelRecord
from study.scene import Scene
from study.scene.part import without
from study.system.progress import Progress, Silent

if TYPE_CHECKING:
    from fuzzy.liver.stiffness import StiffnessEstimate
    from study.models.persistence import Persistence

Floats = NDArray[np.float64]
Estimates = Mapping[str, "StiffnessEstimate"]
"""Stiffness estimates by fuzzy system."""


@dataclass(frozen=True)
class Simulation:
    """The motion of a model, and the time steps that it took.

    `step` [s]: the shortest; `margin`: smallest ratio of the critical step to a step taken, None
    without a critical step; `inverted_cells`: number of cells turned inside out; `largest_strain`:
    absolute, over the recorded frames, None where it is unknown.
    """

    trajectory: Trajectory
    step: float
    margin: float = float("inf")
    inverted_cells: int = 0
    largest_strain: float | None = None


@dataclass(frozen=True)
class ModelRun:
    """The motion of a model with its record, which states the model's own numerical errors.

    `bounds`: the motion at both ends of a stiffness interval, if the model has one; `halved`: the
    motion with half the time step, if it finished; `certified` [m] (samples, probes): bound on the
    error of a reduced model's displacement against the unreduced one, if there is one.
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
    """A prepared model at rest, to be advanced one time step at a time.

    `take_step()` advances by one step exactly as a run does, including the work between steps.
    `take_bare_steps(count)` advances without that work; None if there is none. `take_many(count)`
    advances by several steps as a run does between samples; None if that costs as much as single
    steps. `restart()` returns to the state from which steps are timed: rest, or under moved tools
    the deepest indentation. `displacement()` [m] (n, 3): the nodal displacement that is delivered.
    `step` [s]; `unknowns`: displacement components, or reduced coordinates that each step expands
    to displacements. `bound()` [m] (probes,): certified bound on the error of the displacement at
    the control points against the unreduced model; evaluated only when called.
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
        """Advance by `count` steps, including the work that a run does between them."""
        if self.take_many is not None:
            self.take_many(count)
            return
        for _ in range(count):
            self.take_step()


@dataclass(frozen=True)
class Watch:
    """Observers of a run: its progress reporting, and what it writes to disk meanwhile."""

    progress: Progress
    persistence: Persistence | None = None


SILENT = Watch(Silent())
"""Reports no progress and writes nothing."""


class Prepared(Protocol):
    """A model set up for a problem."""

    @property
    def critical_time_step(self) -> float:
        """Longest stable time step [s] at rest; infinite for a model without a limit."""

    def describe(self) -> list[str]:
        """Lines for a reader on what would be run."""

    def simulate(self, longest: float | None = None) -> Simulation:
        """The motion by the model's own steps, or by equal steps of at most `longest` [s].

        Equal steps divide the sampling interval.
        """

    def run(self, watch: Watch) -> ModelRun:
        """The motion with its record, and an estimate of its time-step error where there is one."""

    def rest(self) -> Floats:
        """Displacement [m] (q, 3) at rest under the full load, at the points of the volume field.

        Linearised about the unloaded state where the model is nonlinear.
        """

    def stepper(self) -> Stepper:
        """The model at rest, for timing or for stepping by hand."""


class Model(Protocol):
    """A model with its settings."""

    @property
    def name(self) -> str:
        """Name of the model, unique in a study."""

    @property
    def label(self) -> str:
        """Name of the model in reports."""

    def varied(self, **settings: Any) -> Self:
        """The model with other settings by name, given as plain JSON values."""

    def prepare(self, problem: Problem) -> Prepared:
        """Set up for a problem. ValueError for settings that do not fit it."""


class PointModel(Protocol):
    """A model of a single control mass point."""

    @property
    def name(self) -> str:
        """Name of the model, unique in a study."""

    def run(self, problem: PointProblem, watch: Watch) -> ModelRun:
        """The motion with its record."""


@dataclass(frozen=True, kw_only=True)
class ModelKind:
    """A kind of model, named in a scene's list of models.

    `models` makes one model, or several as for `msm`, from a scene and the fuzzy estimates.
    `on_point` does so for a scene that is a single control mass point; None if the kind needs an
    organ. `assumptions` gives sentences on how the paper was interpreted and what is neglected.

        is_reference        the others are compared with it; its model has the name of the kind
        is_tuned            its stiffness is that of the fuzzy estimates
        patient_specific    its stiffness is a patient's; it has no part in trade-off and stability
        follows_law         its springs have the law and damping of the scene
        any_load            it can follow a load whose place was unknown when it was prepared
        ignored_keys        tables and keys of a scene that do not affect its models; a run that
                            differs only in these reuses their results
        supported_features  names of `study.problem.features.FEATURES` that its models support
    """

    models: Callable[[Scene, Estimates], Iterable[Model]]
    on_point: Callable[[Scene, Estimates], Iterable[PointModel]] | None = None
    assumptions: Callable[[Scene], list[str]] = lambda _: []
    is_reference: bool = False
    is_tuned: bool = False
    patient_specific: bool = False
    follows_law: bool = False
    any_load: bool = True
    ignored_keys: tuple[str, ...] = ()
    supported_features: frozenset[str] = frozenset()

    def relevant_part(self, scene: Scene) -> Scene:
        """The part of a scene that its models depend on.

        Only patient-specific models depend on readings and fuzzy rules.
        """
        unread = () if self.patient_specific else ("patient", "fuzzy")
        return without(scene, (*unread, *self.ignored_keys))
