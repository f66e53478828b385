"""Preparation of a scene: everything that `run` and `check` can refuse is refused here.

Errors must be known before anything expensive is computed. The organ, its meshes and the lattices
are built, and nothing is solved.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from study.models.estimates import estimates
from study.models.model import Estimates, Model, PointModel, Prepared
from study.models.table import is_tuned, models_of, point_models_of
from study.problem.problem import PointProblem, Problem
from study.scene import Scene
from study.scene.problem import point_problem_of, problem_of
from study.system.progress import Progress, Silent

QUIET = Silent()
"""Reports no progress."""


@runtime_checkable
class Refuses(Protocol):
    """A prepared model that refuses more than `prepare` does, such as too many steps."""

    def refuse(self) -> None:
        """Raise ValueError for what its run would refuse, without the work of a run."""


@runtime_checkable
class RefusesPoint(Protocol):
    """A model of a single point that refuses some of them."""

    def refuse(self, problem: PointProblem) -> None:
        """Raise ValueError for what its run would refuse, without the work of a run."""


@dataclass(frozen=True)
class PreparedScene:
    """The problem of a scene with an organ, and its prepared models by name."""

    problem: Problem
    models: dict[str, Prepared]


@dataclass(frozen=True)
class PreparedPointScene:
    """The problem of a scene that is a single point, and its models."""

    problem: PointProblem
    models: tuple[PointModel, ...]


def prepare_scene(scene: Scene, progress: Progress = QUIET) -> PreparedScene | PreparedPointScene:
    """Prepare everything that a scene names. ValueError for whatever a run would refuse."""
    found = estimates(scene) if is_tuned(scene) else {}
    return _point(scene, found) if scene.is_point else _organ(scene, found, progress)


def _organ(scene: Scene, found: Estimates, progress: Progress) -> PreparedScene:
    with progress.stage("organ"):
        problem = problem_of(scene)
    return PreparedScene(problem, prepare_models(models_of(scene, found), problem, progress))


def prepare_models(
    models: Iterable[Model], problem: Problem, progress: Progress = QUIET
) -> dict[str, Prepared]:
    """Prepare models by name, all before any of them runs. ValueError for one that cannot run."""
    found: dict[str, Prepared] = {}
    for model in models:
        with progress.stage(f"{model.name}: set up"):
            found[model.name] = prepared = model.prepare(problem)
            if isinstance(prepared, Refuses):
                prepared.refuse()
    return found


def _point(scene: Scene, found: Estimates) -> PreparedPointScene:
    problem = point_problem_of(scene)
    models = tuple(point_models_of(scene, found))
    for model in models:
        if isinstance(model, RefusesPoint):
            model.refuse(problem)
    return PreparedPointScene(problem, models)
