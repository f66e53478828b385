"""Supports and blunt tools as fields over the surface, the same for every model and mesh."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SIDEWAYS = 1e-6
"""Cosine below which a surface is perpendicular to a direction, up to rounding."""


@dataclass(frozen=True)
class Foundation:
    """Winkler foundation of the surface that faces `outward`, near its extreme plane.

    `level` [m]: largest coordinate of the organ along `outward`; `depth` [m]: extent of the
    foundation below it; `stiffness` [Pa/m]: traction per displacement of a surface perpendicular to
    `outward`. With a `centre` [m] (3,) it is the surface within `depth` of that point, whatever its
    orientation.
    """

    outward: Floats
    level: float
    depth: float
    stiffness: float
    centre: Floats | None = None

    def density(self, points: Floats, normals: Floats) -> Floats:
        """Stiffness per area [Pa/m] at points (..., 3) with outward normals (..., 3).

        Area counts by its projection on the side. Over the deeper half of the depth the stiffness
        decreases smoothly to zero, so that integrals converge under refinement.
        """
        below = np.clip(self._below(points), 0.0, 1.0)
        fade = np.clip(2.0 * (1.0 - below), 0.0, 1.0)
        smooth = fade**2 * (3.0 - 2.0 * fade)
        return np.asarray(self.stiffness * smooth * self._facing(normals))

    def fixed(self, points: Floats, normals: Floats) -> NDArray[np.bool_]:
        """Fixed components (..., 3): none, as a foundation is elastic."""
        return np.zeros(np.broadcast_shapes(points.shape, normals.shape), dtype=np.bool_)

    def scaled(self, times: float) -> Foundation:
        """The foundation with `times` its stiffness."""
        return replace(self, stiffness=times * self.stiffness)

    def covers(self, points: Floats, normals: Floats) -> NDArray[np.bool_]:
        """Whether it supports points (..., 3) of the surface with outward normals (..., 3)."""
        return np.asarray((self._below(points) < 1.0) & (self._facing(normals) > SIDEWAYS))

    def _below(self, points: Floats) -> Floats:
        """Depth below the extreme plane, or distance from the centre, over the extent."""
        if self.centre is not None:
            return np.asarray(np.linalg.norm(points - self.centre, axis=-1) / self.depth)
        return np.asarray((self.level - points @ self.outward) / self.depth)

    def _facing(self, normals: Floats) -> Floats:
        """Share of an area that counts."""
        if self.centre is not None:
            return np.ones(normals.shape[:-1])
        return np.asarray(np.clip(normals @ self.outward, 0.0, None))


@dataclass(frozen=True)
class ToolPatch:
    """A blunt tool at `centre` [m] that pushes along the unit vector `direction` with `force` [N].

    `name`: the key of the scene that places it, for messages.
    """

    centre: Floats
    direction: Floats
    radius: float
    force: float
    name: str = "tool"

    def profile(self, points: Floats, normals: Floats) -> Floats:
        """Traction at points (..., 3) with outward normals (..., 3), up to a factor.

        (1 - (r/radius)^2)^2 over the surface that faces the tool, with r measured across its axis,
        times the projection of the surface on it. Each model scales its own integral to `force`.
        """
        offset = points - self.centre
        along = offset @ self.direction
        across = np.maximum((offset**2).sum(axis=-1) - along**2, 0.0) / self.radius**2
        near = (across < 1.0) & (np.abs(along) < self.radius)
        facing = np.clip(-(normals @ self.direction), 0.0, None)
        return np.asarray(np.where(near, (1.0 - across) ** 2 * facing, 0.0))


@dataclass(frozen=True, eq=False)
class Load:
    """A further blunt tool, or one station of a travelling tool (`study.problem.tool_travel`).

    `factor`: share of its force at times [s].
    """

    tool: ToolPatch
    factor: Callable[[Floats], Floats]


@dataclass(frozen=True, eq=False)
class Weight:
    """A body of a `mass` [kg] attached to a patch: it is pulled by gravity and adds inertia.

    `patch` has a force of 1 N, so that its scaled profile distributes the mass.
    """

    patch: ToolPatch
    mass: float
