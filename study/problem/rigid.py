"""Rigid tools that are moved along a prescribed path, and their geometry of contact.

A tool has a tip and an axis along which it faces the body. In its own frame, with x and y across
the axis and z along it from the tip, it occupies: a sphere of its radius below the tip; a punch,
the cylinder of its radius below the plane z = 0, without contact on its side; a plate, all of z <
0.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SPHERE, PUNCH, PLATE = range(3)
SHAPES = {"sphere": SPHERE, "punch": PUNCH, "plate": PLATE}
"""Shapes of rigid tools by name."""
TOOLS = ("blunt", *SHAPES)
"""All shapes; a blunt tool is no rigid body but a smooth pressure."""
BONDED, SLIDING = "bonded", "sliding"
CONTACTS = (BONDED, SLIDING)
"""Contact of a rigid tool: hold what it touches at the start, or press without adhesion."""

FLUSH = 1e-3
"""Distance from a bonded plate, relative to the body, within which the surface is held."""


@dataclass(frozen=True, eq=False)
class RigidTool:
    """A rigid tool whose tip starts at `tip` [m] (3,) and faces along the unit vector `axis` (3,).

    `shape`: a number of `SHAPES`; `radius` [m], unused for a plate. `travel`: displacement [m] (k,
    3) of the tip at times [s] (k,). `bonded`: the facing surface within the tool's radius of its
    axis moves with it from the start. Otherwise contact is unilateral: the surface is kept out of
    the tool, never pulled, and dragged with Coulomb's coefficient `friction`.
    """

    name: str
    shape: int
    radius: float
    tip: Floats
    axis: Floats
    travel: Callable[[Floats], Floats]
    bonded: bool = False
    friction: float = 0.0

    def holds(self, points: Floats, normals: Floats) -> NDArray[np.bool_]:
        """Which points (n, 3) with outward normals (n, 3) a bonded tool holds."""
        offset = points - self.tip
        along = offset @ self.axis
        facing = normals @ self.axis < 0.0
        if self.shape == PLATE:
            return np.asarray(facing & (np.abs(along) <= FLUSH * np.ptp(points, axis=0).max()))
        across = np.linalg.norm(offset - along[:, None] * self.axis, axis=1)
        return np.asarray(facing & (across <= self.radius) & (np.abs(along) < self.radius))

    def touching(self, points: Floats, normals: Floats) -> RigidTool:
        """The tool shifted along its axis until it touches the surface opposite to it.

        For points (n, 3) with outward normals (n, 3); the tool itself if none is opposite. Points
        deeper in it than its radius, such as those of another lobe behind it, are ignored, except
        for a plate.
        """
        offset = points - self.tip
        along = offset @ self.axis
        across = np.linalg.norm(offset - along[:, None] * self.axis, axis=1)
        opposite = normals @ self.axis < 0.0
        if self.shape != PLATE:
            opposite &= (across <= self.radius) & (along > -2.0 * self.radius)
        if not opposite.any():
            return self
        if self.shape == SPHERE:
            along = along + self.radius - np.sqrt(np.maximum(self.radius**2 - across**2, 0.0))
        return replace(self, tip=self.tip + along[opposite].min() * self.axis)

    def gap(self, points: Floats, time: float) -> tuple[Floats, Floats]:
        """Gap [m] (n,) between points (n, 3) and the tool at a time [s], and its gradient (n, 3).

        Negative inside the tool, infinite where nothing of a punch is opposite.
        """
        offset = points - self.tip - self.travel(np.array([time]))[0]
        along = offset @ self.axis
        if self.shape == SPHERE:
            from_centre = offset + self.radius * self.axis
            away = np.linalg.norm(from_centre, axis=1)
            outward = from_centre / np.maximum(away, 1e-300)[:, None]
            return away - self.radius, outward
        outward = np.broadcast_to(self.axis, points.shape)
        if self.shape == PLATE:
            return along, outward
        across = np.linalg.norm(offset - along[:, None] * self.axis, axis=1)
        return np.where(across <= self.radius, along, np.inf), outward
