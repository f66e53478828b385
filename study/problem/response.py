"""The response quantities: displacement and velocity along the tool's push, and tool forces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from study.problem.trajectory import Trajectory

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """Time [s], displacement [m] and velocity [m/s] of a point along an axis, (samples,)."""

    time: Floats
    displacement: Floats
    velocity: Floats


@dataclass(frozen=True)
class ToolPath:
    """A rigid tool by name: its unit axis (3,), and the travel [m] (samples, 3) of its tip."""

    name: str
    axis: Floats
    travel: Floats


@dataclass(frozen=True)
class ToolCurve:
    """Travel [m] along a tool's axis, axial and tangential force [N] on the body, (samples,)."""

    time: Floats
    travel: Floats
    force: Floats
    tangential: Floats


@dataclass(frozen=True)
class Response:
    """Times [s], names of the control points, and the unit vector of the tool's push.

    `volumes` [m^3] (q,): weights of the points of the volume field. `tools`: rigid tools, whose
    forces are response quantities too.
    """

    times: Floats
    probes: tuple[str, ...]
    direction: Floats
    volumes: Floats
    tools: tuple[ToolPath, ...] = ()

    def tool_curve(self, trajectory: Trajectory, tool: int) -> ToolCurve:
        """Force of a tool on the body over time."""
        path, force = self.tools[tool], -trajectory.tool_force[:, tool]
        along = force @ path.axis
        across = np.linalg.norm(force - np.outer(along, path.axis), axis=1)
        return ToolCurve(self.times, path.travel @ path.axis, along, across)

    def motion(self, trajectory: Trajectory, probe: int) -> Motion:
        """Displacement and velocity of a control point along the push."""
        return Motion(
            self.times,
            trajectory.displacement[:, probe] @ self.direction,
            trajectory.velocity[:, probe] @ self.direction,
        )
