"""The boundary-value problem that every model of an organ solves, in SI units."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from study.mesh.quadrature import SurfaceRule, VolumeRule
from study.organ.geometry import Geometry
from study.problem.contact import Foundation, ToolPatch
from study.problem.response import Response
from study.problem.tissue import Tissue
from study.problem.trajectory import Observation

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Problem:
    """An organ with support, tool, load history, tissue, and what is observed of it.

    `factor`: share of the tool's force at times [s]; `probes`: names of the control points. Two
    problems are the same only if they are one object, so that what is assembled for one is kept by
    it.
    """

    geometry: Geometry
    foundation: Foundation
    tool: ToolPatch
    factor: Callable[[Floats], Floats]
    tissue: Tissue
    surface_rule: SurfaceRule
    volume_rule: VolumeRule
    observation: Observation
    probes: tuple[str, ...]

    @property
    def response(self) -> Response:
        """How its motion is looked at."""
        times, volumes = self.observation.times, self.volume_rule.weights
        return Response(times, self.probes, self.tool.direction, volumes)

    @property
    def tool_probe(self) -> int:
        """The control point nearest to the tool."""
        away = self.observation.probes - self.tool.centre
        return int(np.linalg.norm(away, axis=1).argmin())


@dataclass(frozen=True, eq=False)
class PointProblem:
    """A single control mass point of a `mass` [kg] on a spring of a `rest_length` [m].

    `force` [N] along the spring at times [s] up to the last of `times` [s] (samples,).
    """

    times: Floats
    force: Callable[[Floats], Floats]
    mass: float
    rest_length: float
    probes: tuple[str, ...] = ("control-point",)

    @property
    def response(self) -> Response:
        """How its motion is looked at: along the spring."""
        return Response(self.times, self.probes, np.array([1.0, 0.0, 0.0]), np.zeros(0))
