"""Rigid tools that are moved along a given path, and what of a body they touch.

A tool has a tip and an axis along which it faces the body. In its own frame, x and y across the
axis, z along it from the tip, it fills: a sphere of its radius below the tip; a punch, the cylinder
of its radius below the plane z = 0, of which the side touches nothing; a plate, all below z = 0.
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
"""All shapes; a blunt tool is no body but a smooth pressure."""
BONDED, SLIDING = "bonded", "sliding"
CONTACTS = (BONDED, SLIDING)
"""What a rigid tool does to the surface: hold what it touches at the start, or press on it only."""

FLUSH = 1e-3
"""Distance from a bonded plate, as a share of the body, within which the surface is held."""


@dataclass(frozen=True, eq=False)
class RigidTool:
    """A rigid tool whose tip starts at `tip` [m] (3,) and faces along the unit vector `axis` (3,).

    `shape`: a number of `SHAPES`; `radius` [m], without meaning for a plate. `travel`: displacement
    [m] (k, 3) of the tip at times [s] (k,). `bonded`: the surface within the tool's radius of its
    axis that faces it moves with it from the start; else a part of the surface is pushed while it
    would enter the tool, never pulled, and with `friction`, Coulomb's coefficient, dragged.
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
        """Which points (n, 3) with outward normals (n, 3) a bonded tool holds from its start on."""
        offset = points - self.tip
        along = offset @ self.axis
        facing = normals @ self.axis < 0.0
        if self.shape == PLATE:
            return np.asarray(facing & (np.abs(along) <= FLUSH * np.ptp(points, axis=0).max()))
        across = np.linalg.norm(offset - along[:, None] * self.axis, axis=1)
        return np.asarray(facing & (across <= self.radius) & (np.abs(along) < self.radius))

    def touching(self, points: Floats, normals: Floats) -> RigidTool:
        """The tool moved along its axis so far that it touches what faces it of a surface.

        Points (n, 3) with outward normals (n, 3); the tool itself if none is opposite. What lies
        deeper in it than its radius, such as another lobe behind it, does not count, but does so
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
        """Distance [m] (n,) of points (n, 3) from the tool at a time [s], and its gradient (n, 3).

        Negative inside the tool. Infinite where a punch has nothing opposite.
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
