"""Where rigid tools may touch an organ."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import SurfaceMesh
from study.mesh.quadrature import SurfaceRule, over_surface
from study.problem.rigid import PLATE, PUNCH, SPHERE, RigidTool

Floats = NDArray[np.float64]

APART = {SPHERE: 0.2, PUNCH: 0.35, PLATE: 0.35}
"""Distance between the points at which a tool is met, over the spacing, by the tool's shape.

What is bonded follows no shape: those of a bonded sphere are as far apart as a punch's.
"""
MOST_POINTS = 20_000


def touchable(
    tools: Sequence[RigidTool], surface: SurfaceMesh, spacing: float, times: Floats
) -> SurfaceRule | None:
    """Points of the surface that any tool may touch up to the last of `times` [s]; None without.

    Those are of triangles within twice a tool's radius, and the length of its travel, of the path
    of its tip; all triangles for a plate.
    """
    if not tools:
        return None
    centres = surface.points[surface.triangles].mean(axis=1)
    near = np.zeros(len(centres), dtype=bool)
    for tool in tools:
        near |= _near(tool, centres, times)
    kept = SurfaceMesh(surface.points, surface.triangles[near])
    if not len(kept.triangles):
        return over_surface(kept, 1)
    corner = kept.points[kept.triangles]
    edge = float(np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).mean())
    apart = min(APART[PUNCH if tool.bonded else tool.shape] for tool in tools) * spacing
    most = np.sqrt(MOST_POINTS / len(corner))
    per_direction = max(1, int(min(np.ceil(edge / apart), most)))
    return over_surface(kept, per_direction)


def _near(tool: RigidTool, points: Floats, times: Floats) -> NDArray[np.bool_]:
    if tool.shape == PLATE:
        return np.ones(len(points), dtype=bool)
    travel = tool.travel(times)
    reach = 2.0 * tool.radius + float(np.linalg.norm(travel, axis=1).max())
    path = tool.tip + travel[np.unique(np.linspace(0, len(times) - 1, 64).astype(int))]
    apart = np.linalg.norm(points[:, None, :] - path, axis=2).min(axis=1)
    return np.asarray(apart <= reach)
