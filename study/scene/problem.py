"""The problem of a scene: its organ built, with supports, tools and control points placed on it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import SurfaceMesh, TetrahedralMesh
from study.mesh.locate import locate
from study.mesh.quadrature import SurfaceRule, VolumeRule, over_surface, over_volume
from study.organ import geometry as shapes
from study.organ.geometry import Geometry
from study.problem.contact import Foundation, Load, ToolPatch, Weight
from study.problem.history import peak_sample
from study.problem.problem import PointProblem, Problem
from study.problem.rigid import BONDED, SHAPES, RigidTool
from study.problem.supports import (
    FOUNDATION,
    SLIDING,
    FixedSurface,
    Support,
    Supports,
    free_motion,
)
from study.problem.tool_travel import full_share
from study.problem.trajectory import Observation
from study.scene.obstacles import notes_on_misses, refuse_blocked
from study.scene.place import OUTWARD, refuse_far, refuse_long, resolve
from study.scene.schema import END_POINT, TOOL_POINT, Organ, Place, Scene, Tool
from study.scene.schema import Support as SupportTable
from study.scene.tissue import tissue_of
from study.scene.travel import travelling

Floats = NDArray[np.float64]

SURFACE_POINTS = 6
"""Integration points per direction on each facet: the tool covers only a few facets."""
VOLUME_POINTS = 2
AXES = "xyz"
OUTSIDE = -0.1
"""Barycentric coordinate below which a point is outside by more than rounding or a flat facet."""


def problem_of(scene: Scene) -> Problem:
    """Build the organ and place supports, tools and control points on it.

    Raises ValueError naming the key of a support or tool that misses the organ.
    """
    geometry = geometry_of(scene.organ, scene.reference.element_size)
    surface = geometry.surface
    refuse_far(dict(_places(scene)), surface, geometry.offset)
    refuse_long(dict(_lengths(scene)), surface)
    foundation = _support(scene, surface)
    first, *loads = _loads(scene.tool, "tool", surface)
    # The force of a moved tool is a result, and as a load it has none.
    tool = replace(first.tool, force=0.0) if scene.tool.is_moved else first.tool
    surface_rule = over_surface(surface, SURFACE_POINTS)
    volume_rule = over_volume(geometry.mesh, VOLUME_POINTS)
    _check_held(foundation, surface_rule)
    _check_touch(first.tool, "tool", surface_rule)
    further = tuple(_further_loads(scene, surface, surface_rule))
    weights = tuple(_weights(scene, surface, surface_rule))
    places = _probes(scene, surface, (first, *loads))
    _check_inside(geometry.mesh, np.array(list(places.values())), _keys_of_probes(scene, places))
    observation = _observation(scene, first.tool, places, volume_rule, surface)
    rigid = tuple(_rigid(name, one, surface, surface_rule) for name, one in _moved(scene))
    refuse_blocked(rigid, foundation, surface_rule, observation.times)
    return Problem(
        geometry=geometry,
        foundation=foundation,
        tool=tool,
        factor=first.factor,
        tissue=tissue_of(scene.tissue, geometry),
        surface_rule=surface_rule,
        volume_rule=volume_rule,
        observation=observation,
        probes=tuple(places),
        rigid_tools=rigid,
        loads=(*loads, *further),
        gravity=scene.gravity.acceleration * OUTWARD[scene.gravity.towards],
        weights=weights,
        given_loaded=scene.gravity.given == "loaded",
        of_tools=tuple(notes_on_misses(rigid, surface_rule, observation.times)),
    )


def _observation(
    scene: Scene,
    tool: ToolPatch,
    places: Mapping[str, Floats],
    volume_rule: VolumeRule,
    surface: SurfaceMesh,
) -> Observation:
    """The samples, the control points, and the fields at the peak and at the end."""
    times = np.linspace(0.0, scene.time.duration, scene.time.samples)
    return Observation(
        times=times,
        probes=np.array(list(places.values())),
        frames=(peak_sample(_extent(scene.tool, tool, times)), len(times) - 1),
        volume_points=volume_rule.points,
        surface_points=surface.points,
    )


def _places(scene: Scene) -> Iterator[tuple[str, Place]]:
    """Every place in a scene, by its key."""
    yield from ((f"control_points.{name}", one) for name, one in scene.control_points.items())
    for name, tool in zip(_names("tool", len(scene.tools)), scene.tools, strict=True):
        yield f"{name}.place", tool.place
    for name, support in zip(_names("support", len(scene.supports)), scene.supports, strict=True):
        if support.place is not None:
            yield f"{name}.place", support.place
    for number, weight in enumerate(scene.weight, 1):
        yield f"weight.{number}.place", weight.place
    for number, inclusion in enumerate(scene.tissue.inclusion, 1):
        if inclusion.place is not None:
            yield f"tissue.inclusion.{number}.place", inclusion.place


def _lengths(scene: Scene) -> Iterator[tuple[str, float]]:
    """Lengths [m] of tools, supports and weights, by their keys."""
    for name, tool in zip(_names("tool", len(scene.tools)), scene.tools, strict=True):
        yield f"{name}.radius", tool.radius
        yield f"{name}.displacement", abs(tool.displacement or 0.0)
        yield f"{name}.clearance", tool.clearance
        for number, point in enumerate(tool.path, 1):
            yield f"{name}.path.{number}", math.hypot(point.travel or 0.0, *(point.offset or ()))
    for name, support in zip(_names("support", len(scene.supports)), scene.supports, strict=True):
        yield f"{name}.depth", support.depth
        yield f"{name}.radius", support.radius or 0.0
    for number, weight in enumerate(scene.weight, 1):
        yield f"weight.{number}.radius", weight.radius


def _names(table: str, count: int) -> list[str]:
    """Names of tables, of which the first has no number."""
    return [table, *(f"{table}.{n}" for n in range(2, count + 1))]


def _probes(scene: Scene, surface: SurfaceMesh, loads: Sequence[Load]) -> dict[str, Floats]:
    """Control points [m] (3,) by name; by default the tissue at the tool.

    Of a travelling tool also at the end of its path.
    """
    if scene.control_points:
        return {name: resolve(one, surface)[0] for name, one in scene.control_points.items()}
    found = {TOOL_POINT: resolve(scene.tool.place, surface)[0]}
    if END_POINT in scene.probes:
        end = scene.tool.path[-1].time
        found[END_POINT] = max(loads, key=lambda one: full_share(one.factor, end)).tool.centre
    return found


def _loads(tool: Tool, name: str, surface: SurfaceMesh) -> tuple[Load, ...]:
    """A blunt tool as a load, or one per station of its path; a moved tool at its start."""
    patch = _tool(tool, name, surface)
    if tool.travels:
        return travelling(tool, patch, surface)
    return (Load(patch, tool.history.factor),)


def _further_loads(scene: Scene, surface: SurfaceMesh, rule: SurfaceRule) -> Iterator[Load]:
    """Further tools of given force. ValueError naming one that touches nothing."""
    for number, one in enumerate(scene.further_tools, 2):
        if not one.is_moved:
            name = f"tool.{number}"
            for load in _loads(one, name, surface):
                _check_touch(load.tool, name, rule)
                yield load


def _moved(scene: Scene) -> list[tuple[str, Tool]]:
    """Moved tools by the names of their tables."""
    named = zip(_names("tool", len(scene.tools)), scene.tools, strict=True)
    return [(name, one) for name, one in named if one.is_moved]


def _rigid(name: str, tool: Tool, surface: SurfaceMesh, rule: SurfaceRule) -> RigidTool:
    """A rigid tool at its first contact with the surface, facing as it would push.

    On an inclined surface, a tool whose tip is at its place would start inside the organ.
    """
    patch = _tool(tool, name, surface)
    bonded = tool.contact == BONDED
    placed = RigidTool(
        name,
        SHAPES[tool.shape],
        tool.radius,
        patch.centre,
        patch.direction,
        _travel(tool, patch.direction),
        bonded,
        tool.friction,
    )
    if bonded:
        return placed
    # The place itself too: points of the rule lie round it, and a sphere would sink in between.
    points = np.vstack([rule.points, patch.centre])
    normals = np.vstack([rule.normals, -patch.direction])
    first = placed.touching(points, normals)
    return replace(first, tip=first.tip - tool.clearance * patch.direction)


def _extent(tool: Tool, patch: ToolPatch, times: Floats) -> Floats:
    """Displacement of a moved tool, or force of a blunt one, at times [s], up to a factor."""
    if not tool.is_moved:
        return tool.history.factor(times)
    return np.asarray(_travel(tool, patch.direction)(times) @ patch.direction)


def _travel(tool: Tool, direction: Floats) -> Callable[[Floats], Floats]:
    """Displacement of a tip [m] (k, 3) at times [s] (k,)."""
    if tool.displacement is not None:
        whole, factor = tool.displacement * direction, tool.history.factor
        return lambda times: np.outer(factor(np.asarray(times)), whole)
    corners = np.array([point.time for point in tool.path])
    away = np.array(
        [
            (point.travel or 0.0) * direction if point.offset is None else point.offset
            for point in tool.path
        ]
    )
    return lambda times: np.stack([np.interp(times, corners, column) for column in away.T], axis=1)


def _weights(scene: Scene, surface: SurfaceMesh, rule: SurfaceRule) -> Iterator[Weight]:
    """Attached weights. ValueError naming one that touches nothing."""
    for number, one in enumerate(scene.weight, 1):
        held = Tool(place=one.place, radius=one.radius, force=1.0)
        patch = _tool(held, f"weight.{number}", surface)
        _check_touch(patch, f"weight.{number}", rule)
        yield Weight(patch, one.mass)


def point_problem_of(scene: Scene) -> PointProblem:
    """The single control mass point of a scene.

    Its mass is as declared, or such that eq. (2) meets the benchmark's gamma_0.
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
    """Meshes of an organ with elements of about `element_size` [m]. ValueError if it has none."""
    if organ.mesh is not None:
        how = (organ.axes, organ.pieces)
        return shapes.from_file(Path(organ.mesh), organ.unit, element_size, *how)
    if organ.shape == "block":
        return shapes.block(organ.size, element_size)
    return shapes.built_in_liver(organ.volume, element_size)


def _support(scene: Scene, surface: SurfaceMesh) -> Support:
    """All supports, or a single foundation itself. ValueError naming one that holds no surface."""
    parts = []
    rule = over_surface(surface, SURFACE_POINTS)
    for number, one in enumerate(scene.supports, 1):
        extent = _extent_of(one, surface)
        if not extent.covers(rule.points, rule.normals).any():
            name = "support" if number == 1 else f"support.{number}"
            key = "radius" if one.place is not None else "depth"
            raise ValueError(f"{name}: no surface faces its side within {name}.{key}; enlarge it")
        parts.append(_held(one, extent))
    return parts[0] if len(parts) == 1 else Supports(tuple(parts))


def _extent_of(support: SupportTable, surface: SurfaceMesh) -> Foundation:
    """The extent of a support, as the foundation that would be there."""
    outward = OUTWARD[support.side]
    level = float((surface.points @ outward).max())
    if support.place is None:
        return Foundation(outward, level, support.depth, support.stiffness)
    centre, _ = resolve(support.place, surface)
    assert support.radius is not None  # noqa: S101 - as was checked with the scene
    return Foundation(outward, level, support.radius, support.stiffness, centre)


def _held(support: SupportTable, extent: Foundation) -> Support:
    if support.kind == FOUNDATION:
        return extent
    along = np.abs(extent.outward) > 0.5
    return FixedSurface(extent, along if support.kind == SLIDING else np.ones(3, dtype=np.bool_))


def _tool(tool: Tool, name: str, surface: SurfaceMesh) -> ToolPatch:
    """A tool that pushes along its direction, or inwards from its side, or against the surface."""
    centre, normal = resolve(tool.place, surface)
    if tool.direction is not None:
        direction = np.array(tool.direction)
    elif tool.place.side is not None:
        direction = -OUTWARD[tool.place.side]
    else:
        direction = -normal
    unit = direction / np.linalg.norm(direction)
    if unit @ normal >= 0.0:
        raise ValueError(
            f"{name}.direction: points out of the organ at {name}.place; reverse it, or leave it "
            "out to push straight in"
        )
    return ToolPatch(centre, unit, tool.radius, tool.force, name)


def _keys_of_probes(scene: Scene, names: Iterable[str]) -> list[str]:
    """Keys of a scene that place its control points; by default those of the tool do."""
    if scene.control_points:
        return [f"control_points.{name}" for name in names]
    return ["tool.place" if name == TOOL_POINT else "tool.path" for name in names]


def _check_inside(mesh: TetrahedralMesh, probes: Floats, keys: Sequence[str]) -> None:
    """Refuse control points outside the organ, where the field would be extrapolated."""
    outside = locate(mesh, probes)[1].min(axis=1) < OUTSIDE
    if outside.any():
        key = keys[int(outside.argmax())]
        raise ValueError(f"{key}: lies outside the organ; move it, or set snap to true")


def _check_held(support: Support, rule: SurfaceRule) -> None:
    """Refuse a body with a free rigid motion: it has no rest."""
    free = free_motion(support, rule.points, rule.normals, rule.weights)
    if free is not None:
        shift, turn = np.abs(free[0]), np.abs(free[1])
        how = (
            f"be moved along {AXES[int(shift.argmax())]}"
            if shift.max() >= turn.max()
            else f"be turned about {AXES[int(turn.argmax())]}"
        )
        raise ValueError(
            f"support: nothing resists when the organ is to {how}; add a [[support]] on another "
            "side, or make one a foundation or clamped"
        )


def _check_touch(patch: ToolPatch, name: str, rule: SurfaceRule) -> None:
    if not (patch.profile(rule.points, rule.normals) > 0).any():
        turn = "" if name.startswith("weight") else f"turn {name}.direction "
        raise ValueError(
            f"{name}: touches no surface that faces it; move {name}.place, {turn}or enlarge "
            f"{name}.radius"
        )
