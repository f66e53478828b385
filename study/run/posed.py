"""A scene posed on its organ: what every model with a mesh is given."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from study.contact import Foundation, ToolPatch
from study.history import load_factor, peak_sample
from study.mesh.kinds import SurfaceMesh, TetrahedralMesh
from study.mesh.locate import locate
from study.mesh.quadrature import SurfaceRule, VolumeRule, over_surface, over_volume
from study.organ.geometry import Geometry, build
from study.organ.place import OUTWARD, resolve
from study.run.comparison import Lens
from study.scene import Scene
from study.trajectory import Observation

Floats = NDArray[np.float64]

SURFACE_POINTS = 6
"""Integration points per direction on each facet: the tool covers only a few facets."""
VOLUME_POINTS = 2
OUTSIDE = -0.1
"""Barycentric coordinate below which a point is not merely off by rounding or a flat facet."""


@dataclass(frozen=True)
class Posed:
    """The organ with support, tool, load history and what is observed of it."""

    geometry: Geometry
    foundation: Foundation
    tool: ToolPatch
    factor: Callable[[Floats], Floats]
    surface_rule: SurfaceRule
    volume_rule: VolumeRule
    observation: Observation
    probes: tuple[str, ...]

    @property
    def lens(self) -> Lens:
        """How its motion is looked at."""
        times, volumes = self.observation.times, self.volume_rule.weights
        return Lens(times, self.probes, self.tool.direction, volumes)


def pose(scene: Scene) -> Posed:
    """Build the organ and place support, tool and probes on it.

    Raises ValueError naming the key whose support or tool misses the organ.
    """
    geometry = build(scene.organ, scene.reference.element_size)
    surface = geometry.surface
    foundation = _foundation(scene, surface)
    tool = _tool(scene, surface)
    surface_rule = over_surface(surface, SURFACE_POINTS)
    volume_rule = over_volume(geometry.mesh, VOLUME_POINTS)
    _check_touch(foundation, tool, surface_rule)

    def factor(times: Floats) -> Floats:
        return load_factor(scene.tool.history, times)

    times = np.linspace(0.0, scene.time.duration, scene.time.samples)
    places = scene.control_points or {"tool": scene.tool.place}
    probes = np.array([resolve(place, surface)[0] for place in places.values()])
    _check_inside(geometry.mesh, probes, tuple(places))
    observation = Observation(
        times,
        probes,
        (peak_sample(factor(times)), len(times) - 1),
        volume_rule.points,
        surface.points,
    )
    return Posed(
        geometry, foundation, tool, factor, surface_rule, volume_rule, observation, tuple(places)
    )


def _foundation(scene: Scene, surface: SurfaceMesh) -> Foundation:
    outward = OUTWARD[scene.support.side]
    level = float((surface.points @ outward).max())
    return Foundation(outward, level, scene.support.depth, scene.support.stiffness)


def _tool(scene: Scene, surface: SurfaceMesh) -> ToolPatch:
    """Tool pushing along its direction, or straight in from its side, or against the surface."""
    centre, normal = resolve(scene.tool.place, surface)
    if scene.tool.direction is not None:
        direction = np.array(scene.tool.direction)
    elif scene.tool.place.side is not None:
        direction = -OUTWARD[scene.tool.place.side]
    else:
        direction = -normal
    unit = direction / np.linalg.norm(direction)
    if unit @ normal >= 0.0:
        raise ValueError(
            "tool.direction: points out of the organ at tool.place; reverse it, or leave it out to "
            "push straight in"
        )
    return ToolPatch(centre, unit, scene.tool.radius, scene.tool.force)


def _check_inside(mesh: TetrahedralMesh, probes: Floats, names: tuple[str, ...]) -> None:
    """A probe beside the organ would be extrapolated, and scored, without meaning."""
    outside = locate(mesh, probes)[1].min(axis=1) < OUTSIDE
    if outside.any():
        name = names[int(outside.argmax())]
        raise ValueError(
            f"control_points.{name}: lies outside the organ; move it, or set snap to true"
        )


def _check_touch(foundation: Foundation, tool: ToolPatch, rule: SurfaceRule) -> None:
    if not (foundation.density(rule.points, rule.normals) > 0).any():
        raise ValueError("support: no surface faces its side within support.depth; enlarge it")
    if not (tool.profile(rule.points, rule.normals) > 0).any():
        raise ValueError(
            "tool: touches no surface that faces it; move tool.place, turn tool.direction or "
            "enlarge tool.radius"
        )
