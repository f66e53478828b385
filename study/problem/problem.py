"""The boundary-value problem that every model of an organ solves, in SI units."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from study.mesh.quadrature import SurfaceRule, VolumeRule
from study.organ.geometry import Geometry
from study.problem.contact import Load, ToolPatch, Weight
from study.problem.heterogeneous import OUTLINE, HeterogeneousTissue, notes_of
from study.problem.response import Response, ToolPath
from study.problem.rigid import RigidTool
from study.problem.supports import Support
from study.problem.tissue import Tissue
from study.problem.tool_travel import full_share, travel_paths
from study.problem.trajectory import Observation

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Problem:
    """An organ with supports, tools, load histories, tissue, and what is observed of it.

    `foundation`: all supports, fixed surfaces included. `tool` and `factor`: the first tool as a
    load, and the share of its force at times [s]; a moved tool has no force there and is one of the
    `rigid_tools`. `loads`: those of further tools; a blunt tool that travels is one load per
    station of its path, the first tool at the first station. `gravity` [m/s^2] (3,) acts on the
    tissue and on `weights`; with `given_loaded` the geometry is the shape at rest under gravity,
    and displacements are relative to it. `probes`: names of the control points; `of_tools`: notes
    on the rigid tools. Problems compare by identity, so that assemblies can be cached per problem.
    """

    geometry: Geometry
    foundation: Support
    tool: ToolPatch
    factor: Callable[[Floats], Floats]
    tissue: Tissue
    surface_rule: SurfaceRule
    volume_rule: VolumeRule
    observation: Observation
    probes: tuple[str, ...]
    rigid_tools: tuple[RigidTool, ...] = ()
    loads: tuple[Load, ...] = ()
    gravity: Floats = field(default_factory=lambda: np.zeros(3))
    weights: tuple[Weight, ...] = ()
    given_loaded: bool = False
    of_tools: tuple[str, ...] = ()

    @property
    def has_further_loads(self) -> bool:
        """Whether more acts on the organ than its first tool as a load."""
        return bool(self.rigid_tools or self.loads or self.weights or self.gravity.any())

    @property
    def response(self) -> Response:
        """The quantities of a motion that are compared: curves, fields and forces on tools."""
        times, volumes = self.observation.times, self.volume_rule.weights
        tools = tuple(ToolPath(one.name, one.axis, one.travel(times)) for one in self.rigid_tools)
        return Response(times, self.probes, self.tool.direction, volumes, tools)

    @property
    def factors(self) -> Callable[[Floats], Floats]:
        """Share of each load at times [s] (t,): (t, loads), of a single one (t,)."""
        if not self.loads:
            return self.factor
        histories = (self.factor, *(load.factor for load in self.loads))
        return lambda times: np.column_stack([one(times) for one in histories])

    @property
    def full(self) -> Floats:
        """Share (loads,) of each load in the full load at rest.

        A travelling tool is placed where it is at the first recorded frame, the peak.
        """
        times, frames = self.observation.times, self.observation.frames
        peak = float(times[frames[0] if frames else -1])
        histories = (self.factor, *(load.factor for load in self.loads))
        return np.array([full_share(one, peak) for one in histories])

    @property
    def travel_paths(self) -> Floats:
        """Places [m] (tools, places, 3), equally spaced in time, of each tool that travels."""
        first = (self.tool, self.factor)
        loads = [first, *((load.tool, load.factor) for load in self.loads)]
        return travel_paths([(tool.name, tool.centre, factor) for tool, factor in loads])

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on the organ, on the share of heterogeneous tissue, and on tools."""
        of_tissue = notes_of(self.geometry.mesh, self.tissue)
        return (*self.geometry.notes, *of_tissue, *self.of_tools)

    @property
    def inclusions(self) -> Floats:
        """Points [m] (regions, OUTLINE, 3) on the surface of each region of other tissue."""
        regions = self.tissue.regions if isinstance(self.tissue, HeterogeneousTissue) else ()
        outlines = [one.outline for one in regions if len(one.outline)]
        return np.stack(outlines) if outlines else np.zeros((0, OUTLINE, 3))

    @property
    def tool_probe(self) -> int:
        """Number of the control point nearest to the tool."""
        away = self.observation.probes - self.tool.centre
        return int(np.linalg.norm(away, axis=1).argmin())


@dataclass(frozen=True, eq=False)
class PointProblem:
    """A single control mass point of a `mass` [kg] on a spring of a `rest_length` [m].

    `force` [N] along the spring at times [s], up to the last of `times` [s] (samples,).
    """

    times: Floats
    force: Callable[[Floats], Floats]
    mass: float
    rest_length: float
    probes: tuple[str, ...] = ("control-point",)

    @property
    def response(self) -> Response:
        """The quantities of a motion that are compared: the curves along the spring."""
        return Response(self.times, self.probes, np.array([1.0, 0.0, 0.0]), np.zeros(0))
