"""What rigid tools meet on their way: nothing, or a surface that cannot make way for them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from study.mesh.quadrature import SurfaceRule
from study.problem.rigid import RigidTool
from study.problem.supports import Support

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

LOOKS = 64
"""Times at most at which a tool is looked at, spread evenly over its motion."""
ENTERED = 0.01
"""Of a tool's travel, how deep a fixed point may be in it: the surface is told by points."""
BLOCKED = 0.1
"""Part of a unit normal along which a point is free, up to which it cannot leave the tool."""


def refuse_blocked(
    tools: Iterable[RigidTool], support: Support, rule: SurfaceRule, times: Floats
) -> None:
    """ValueError naming a tool that is moved into a surface that does not move.

    Its force would have no bound, and whatever a model gave for it would be that of its mesh.
    `times` [s] (k,) of the motion.
    """
    fixed = support.fixed(rule.points, rule.normals)
    some = fixed.any(axis=1)
    if not some.any():
        return
    for tool in tools:
        told = tool, rule.points[some], rule.normals[some], fixed[some]
        if _drags(*told, times) if tool.bonded else _enters(*told, times):
            raise ValueError(
                f"{tool.name}: is moved against a surface that a clamped or sliding support holds "
                f"in place; move {tool.name}.place or the support, or make the support a foundation"
            )


def notes_on_misses(tools: Iterable[RigidTool], rule: SurfaceRule, times: Floats) -> Iterator[str]:
    """A sentence on each tool that is not bonded and never comes to the surface as it is given."""
    for tool in tools:
        if tool.bonded:
            continue
        nearest = min(float(tool.gap(rule.points, time)[0].min()) for time in _looks(times)[1:])
        if nearest > 0.0:
            apart = f" by {1e3 * nearest:.2g} mm" if np.isfinite(nearest) else ""
            yield (
                f"{tool.name}: stays off the organ as it is given{apart}; its force is zero unless "
                "the organ comes to it"
            )


def _drags(
    tool: RigidTool, points: Floats, normals: Floats, fixed: Booleans, times: Floats
) -> bool:
    """Whether a bonded tool would move, along what is fixed, any of the points that it holds."""
    held = tool.holds(points, normals)
    moved = np.abs(tool.travel(times)).max(axis=0) > 0.0
    return bool((fixed[held] & moved).any())


def _enters(
    tool: RigidTool, points: Floats, normals: Floats, fixed: Booleans, times: Floats
) -> bool:
    """Whether a tool that is not bonded would have a point in it that cannot leave it."""
    del normals
    outside = tool.gap(points, float(times[0]))[0] >= -1e-9
    points, fixed = points[outside], fixed[outside]
    most = ENTERED * float(np.linalg.norm(tool.travel(times), axis=1).max())
    for time in _looks(times):
        gap, normal = tool.gap(points, float(time))
        free = np.linalg.norm(np.where(fixed, 0.0, normal), axis=1)
        if ((gap < -most) & (free <= BLOCKED)).any():
            return True
    return False


def _looks(times: Floats) -> Floats:
    chosen = np.linspace(0, len(times) - 1, min(LOOKS, len(times))).astype(int)
    return np.asarray(times[chosen])
