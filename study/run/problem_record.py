"""What the results keep of a scene's problem, so that a cached run need not build it again."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from study.problem.problem import Problem
from study.problem.response import Response
from study.results.records import Dimensionless
from study.run.dimensionless import dimensionless
from study.run.visual_output import VisualOutput, visual_output, with_visual_output
from study.scene import Scene
from study.scene.part import without
from study.scene.problem import problem_of
from study.stages.fingerprint import fingerprint
from study.system.progress import Progress

Floats = NDArray[np.float64]

MODEL_KEYS = (
    *("patient", "fuzzy", "lattice", "damping", "basafa", "superposition"),
    *("corrected", "region"),
    *(f"reference.{key}" for key in ("element", "accuracy", "method", "modes")),
    *("reference.steps_per_sample", "reference.large_strain"),
)
"""Tables and keys of a scene that concern its models alone and not the problem."""


@dataclass(frozen=True)
class ProblemRecord:
    """What the results and their figures need of a problem.

    `mesh`: SHA-256 of the tetrahedra; `inclusions` [m] (regions, points, 3): points on the surface
    of each; `travel_paths` [m] (tools, places, 3): of the tools that travel; `visual_output`: where
    the models record fields for figures.
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
    travel_paths: Floats
    visual_output: VisualOutput


@dataclass(frozen=True, eq=False)
class ProblemBuilder:
    """Builds the problem of a scene when it is first needed, from no more than it depends on."""

    scene: Scene
    progress: Progress

    @property
    def part(self) -> Scene:
        """The scene without the tables that concern its models alone."""
        return without(self.scene, MODEL_KEYS)

    @cached_property
    def without_visuals(self) -> Problem:
        """The problem as the scene states it. ValueError naming the key that does not fit."""
        with self.progress.stage("organ"):
            return problem_of(self.part)

    @cached_property
    def visual_output(self) -> VisualOutput:
        """Where the models record fields for figures."""
        return visual_output(self.without_visuals)

    @cached_property
    def problem(self) -> Problem:
        """The problem whose observation also covers the figures."""
        return with_visual_output(self.without_visuals, self.visual_output)

    def problem_record(self) -> ProblemRecord:
        """The part of the problem that the results keep."""
        problem = self.problem
        surface, tool = problem.geometry.surface, problem.tool
        return ProblemRecord(
            problem.response,
            surface.points,
            surface.triangles,
            np.stack([tool.centre, tool.direction]),
            problem.observation.probes,
            problem.notes,
            dimensionless(self.scene, problem),
            self.mesh,
            problem.inclusions,
            problem.travel_paths,
            self.visual_output,
        )

    @property
    def mesh(self) -> str:
        """SHA-256 of the tetrahedra: some meshers produce different ones in every call."""
        return fingerprint(self.problem.geometry.mesh)
