"""The problem of a scene as far as its results tell it, so that it need not be built again."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from study.problem.problem import Problem
from study.problem.response import Response
from study.progress import Progress
from study.results.records import Dimensionless
from study.run.dimensionless import dimensionless
from study.run.watched import Watched, to_watch, watched
from study.scene import Scene
from study.scene.part import without
from study.scene.problem import problem_of
from study.stages.fingerprint import text

Floats = NDArray[np.float64]

BLIND_TO = (
    *("patient", "fuzzy", "lattice", "damping", "basafa", "superposition"),
    *("corrected", "region"),
    *(f"reference.{key}" for key in ("element", "accuracy", "method", "modes")),
    *("reference.steps_per_sample", "reference.large_strain"),
)
"""Tables and keys of a scene that the problem is posed without: those of its models."""


@dataclass(frozen=True)
class Posed:
    """What is seen of a problem: where, on which surface, and of which mesh (by its SHA-256).

    `inclusions` [m] (regions, points, 3): points of the surface of each; `ways` [m] (tools, places,
    3): of tools that travel; `watched`: for pictures.
    """

    response: Response
    points: Floats
    triangles: NDArray[np.int64]
    tool: Floats
    probes: Floats
    notes: tuple[str, ...]
    dimensionless: Dimensionless
    mesh: str
    inclusions: Floats
    ways: Floats
    watched: Watched


@dataclass(frozen=True, eq=False)
class Posing:
    """A scene whose problem is built when it is asked for, once, of no more than it depends on."""

    scene: Scene
    progress: Progress

    @property
    def part(self) -> Scene:
        """What the problem is made of."""
        return without(self.scene, BLIND_TO)

    @cached_property
    def stated(self) -> Problem:
        """The organ with support, tool and probes. ValueError naming the key that does not fit."""
        with self.progress.stage("organ"):
            return problem_of(self.part)

    @cached_property
    def watched(self) -> Watched:
        """What its pictures show."""
        return watched(self.stated)

    @cached_property
    def problem(self) -> Problem:
        """The same, looked at for its pictures too."""
        return to_watch(self.stated, self.watched)

    def posed(self) -> Posed:
        """What is seen of it."""
        problem = self.problem
        surface, tool = problem.geometry.surface, problem.tool
        return Posed(
            problem.response,
            surface.points,
            surface.triangles,
            np.stack([tool.centre, tool.direction]),
            problem.observation.probes,
            problem.notes,
            dimensionless(self.scene, problem),
            self.mesh,
            problem.inclusions,
            problem.ways,
            self.watched,
        )

    @property
    def mesh(self) -> str:
        """SHA-256 of the mesh that all integrals are over: some meshers make another each time."""
        return text(self.problem.geometry.mesh)
