"""The way of a blunt tool over the organ: a load at each station, found on the surface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import SurfaceMesh
from study.problem.contact import Load, ToolPatch
from study.problem.tool_travel import APART, SAME, station_loads, stations
from study.scene.place import depths
from study.scene.schema import Tool

Floats = NDArray[np.float64]


class OffSurfaceError(ValueError):
    """A way that leaves the surface facing its tool."""


def travelling(tool: Tool, patch: ToolPatch, surface: SurfaceMesh) -> tuple[Load, ...]:
    """A load at each station of a tool's path, the first one at its place.

    ValueError naming the path where it leaves the surface, an OffSurfaceError, has no length across
    the push, or takes too many stations.
    """
    offsets = np.array([point.offset or (0.0, 0.0, 0.0) for point in tool.path])
    across = offsets - np.outer(offsets @ patch.direction, patch.direction)
    times = np.array([point.time for point in tool.path])
    try:
        found, marks = stations(across, APART * tool.radius)
    except ValueError as error:
        raise ValueError(f"{patch.name}.path: {error}") from error
    reached = np.interp(found.marks, marks, times)
    places = _on_surface(patch, found.away, reached, surface)
    return tuple(
        Load(replace(patch, centre=place), factor)
        for place, factor in station_loads(
            found, places, times, marks, tool.history.factor, SAME * tool.radius
        )
    )


def _on_surface(patch: ToolPatch, away: Floats, reached: Floats, surface: SurfaceMesh) -> Floats:
    """Places [m] (k, 3) of a tool on the surface that faces it, `away` across its push.

    Where there are several, the nearest to the one before counts. `reached` [s] (k,): when.
    """
    before, found = 0.0, []
    for offset, time in zip(away, reached, strict=True):
        met = depths(patch.centre + offset, patch.direction, surface)
        if not met.size or np.abs(met - before).min() > patch.radius:
            raise OffSurfaceError(
                f"{patch.name}.path: leaves the surface that faces the tool, "
                f"{1e3 * np.linalg.norm(offset):.3g} mm across from {patch.name}.place at "
                f"{time:.3g} s; end it before, or move the place"
            )
        before = float(met[np.abs(met - before).argmin()])
        found.append(patch.centre + offset + before * patch.direction)
    return np.array(found)
