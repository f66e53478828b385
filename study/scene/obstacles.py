"""What moved rigid tools meet: nothing, or a fixed surface that cannot yield."""

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
"""Largest number of times at which a tool is checked, evenly distributed over its motion."""
ENTERED = 0.01
"""Depth of a fixed point inside a tool, over its travel, above which it counts as entered."""
BLOCKED = 0.1
"""Free part of a unit normal up to which a point cannot leave the tool."""


def refuse_blocked(
    tools: Iterable[RigidTool], support: Support, rule: SurfaceRule, times: Floats
) -> None:
    """Raise ValueError naming a tool that is moved into a fixed surface.

    Its force would be unbounded, and its computed value would depend on the mesh. `times` [s] (k,)
    of the motion.
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
    """A sentence on each tool in unilateral contact that never reaches the undeformed surface."""
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
    """Whether a bonded tool would move any of its points along a fixed direction."""
    held = tool.holds(points, normals)
    moved = np.abs(tool.travel(times)).max(axis=0) > 0.0
    return bool((fixed[held] & moved).any())


def _enters(
    tool: RigidTool, points: Floats, normals: Floats, fixed: Booleans, times: Floats
) -> bool:
    """Whether a tool in unilateral contact would contain a point that cannot leave it."""
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
