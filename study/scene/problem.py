"""The problem that a scene poses: its organ built, support, tool and probes placed on it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import SurfaceMesh, TetrahedralMesh
from study.mesh.locate import locate
from study.mesh.quadrature import SurfaceRule, over_surface, over_volume
from study.organ import geometry as shapes
from study.organ.geometry import Geometry
from study.problem.contact import Foundation, ToolPatch
from study.problem.history import peak_sample
from study.problem.problem import PointProblem, Problem
from study.problem.trajectory import Observation
from study.scene.place import OUTWARD, resolve
from study.scene.schema import Organ, Scene

Floats = NDArray[np.float64]

SURFACE_POINTS = 6
"""Integration points per direction on each facet: the tool covers only a few facets."""
VOLUME_POINTS = 2
OUTSIDE = -0.1
"""Barycentric coordinate below which a point is not merely off by rounding or a flat facet."""


def problem_of(scene: Scene) -> Problem:
    """Build the organ and place support, tool and probes on it.

    Raises ValueError naming the key whose support or tool misses the organ.
    """
    geometry = geometry_of(scene.organ, scene.reference.element_size)
    surface = geometry.surface
    foundation = _foundation(scene, surface)
    tool = _tool(scene, surface)
    surface_rule = over_surface(surface, SURFACE_POINTS)
    volume_rule = over_volume(geometry.mesh, VOLUME_POINTS)
    _check_touch(foundation, tool, surface_rule)

    factor = scene.tool.history.factor
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
    return Problem(
        geometry,
        foundation,
        tool,
        factor,
        scene.tissue,
        surface_rule,
        volume_rule,
        observation,
        tuple(places),
    )


def point_problem_of(scene: Scene) -> PointProblem:
    """The single control mass point of a scene.

    Its mass is declared, or that for which eq. (2) meets the benchmark's gamma_0.
    """
    from msm.control_point import mass_that_meets

    h_0, table = scene.damping.reference_spacing, scene.basafa
    declared = scene.organ.mass
    mass = (
        mass_that_meets(table.gamma_0, scene.damping.ratio, table.k1 / h_0)
        if declared is None
        else declared
    )

    def force(times: Floats) -> Floats:
        return np.asarray(scene.tool.force * scene.tool.history.factor(times))

    return PointProblem(np.linspace(0.0, scene.time.duration, scene.time.samples), force, mass, h_0)


def geometry_of(organ: Organ, element_size: float) -> Geometry:
    """Meshes of an organ, of elements of about `element_size` [m]. ValueError if it has none."""
    if organ.mesh is not None:
        how = (organ.axes, organ.pieces)
        return shapes.from_file(Path(organ.mesh), organ.unit, element_size, *how)
    if organ.shape == "block":
        return shapes.block(organ.size, element_size)
    return shapes.built_in_liver(organ.volume, element_size)


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
