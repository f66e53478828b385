"""Parallel view of the organ, the same for every picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

BESIDE, ABOVE = 0.6, 0.45
"""How far the eye moves sideways and upwards for each length it moves back along the push."""
MARGIN = 1.12
SUPERIOR = np.array([0.0, 0.0, 1.0])
ANTERIOR = np.array([0.0, -1.0, 0.0])
NEARLY_PARALLEL = 0.9


@dataclass(frozen=True)
class Camera:
    """Parallel view: unit vectors `right`, `up`, `toward` the eye, (3,); `centre` [m] (3,).

    `half_width` and `half_height` [m] of what is seen.
    """

    centre: Floats
    right: Floats
    up: Floats
    toward: Floats
    half_width: float
    half_height: float

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom, top [m] of the picture in the plane of the screen."""
        return -self.half_width, self.half_width, -self.half_height, self.half_height

    def project(self, points: Floats) -> Floats:
        """Coordinates [m] in the plane of the screen, (..., 2), of points (..., 3)."""
        return (points - self.centre) @ np.stack([self.right, self.up], axis=1)

    def depth(self, points: Floats) -> Floats:
        """Distance [m] towards the eye from the centre, (...), of points (..., 3)."""
        return np.asarray((points - self.centre) @ self.toward)


def facing_tool(points: Floats, tool: Floats, push: Floats) -> Camera:
    """View of the side that the tool pushes, from half beside and above.

    `points` [m] (n, 3): all that must fit; `tool` [m] (3,); `push`: unit vector (3,).
    """
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    if abs(push @ SUPERIOR) > NEARLY_PARALLEL:
        offset = BESIDE * ANTERIOR + ABOVE * _towards(tool - centre, np.cross(push, ANTERIOR))
    else:
        offset = BESIDE * _towards(tool - centre, np.cross(push, SUPERIOR)) + ABOVE * SUPERIOR
    toward = _unit(offset - push)
    right = _unit(np.cross(SUPERIOR, toward))
    up = np.cross(toward, right)
    across = (points - centre) @ np.stack([right, up], axis=1)
    low, high = across.min(axis=0), across.max(axis=0)
    middle = 0.5 * (low + high)
    half_width, half_height = 0.5 * MARGIN * np.maximum(high - low, 1e-9)
    centre = centre + middle[0] * right + middle[1] * up
    return Camera(centre, right, up, toward, float(half_width), float(half_height))


def _towards(place: Floats, side: Floats) -> Floats:
    """The unit vector along `side` or against it, whichever points to `place`."""
    return _unit(side if place @ side >= 0.0 else -side)


def _unit(vector: Floats) -> Floats:
    return vector / np.linalg.norm(vector)
