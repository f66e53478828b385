"""What holds the organ: elastic foundations, and surfaces that do not move or slide only."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from study.problem.contact import Foundation

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

FOUNDATION, CLAMPED, SLIDING = "foundation", "clamped", "sliding"
KINDS = (FOUNDATION, CLAMPED, SLIDING)
"""Kinds of support by name."""
FREE = 1e-6
"""Of the stiffness against a rigid motion relative to the largest, below which nothing resists."""


class Support(Protocol):
    """What holds a surface."""

    def density(self, points: Floats, normals: Floats) -> Floats:
        """Stiffness per area [Pa/m] at points [m] (..., 3) with outward normals (..., 3)."""

    def fixed(self, points: Floats, normals: Floats) -> Booleans:
        """Components (..., 3) along which the surface there does not move."""

    def scaled(self, times: float) -> Support:
        """So many times as stiff, but for what does not move."""


@dataclass(frozen=True, eq=False)
class FixedSurface:
    """A surface that does not move along `directions` (3,): that of a foundation of this `extent`.

    The limit of such a foundation as its stiffness grows, in those directions.
    """

    extent: Foundation
    directions: Booleans

    def density(self, points: Floats, normals: Floats) -> Floats:
        """No stiffness beside what is fixed."""
        return np.zeros(np.broadcast_shapes(points.shape, normals.shape)[:-1])

    def fixed(self, points: Floats, normals: Floats) -> Booleans:
        """See Support."""
        held = self.extent.covers(points, normals)
        return np.asarray(held[..., None] & self.directions)

    def scaled(self, times: float) -> FixedSurface:
        """Itself, as it has no stiffness."""
        del times
        return self


@dataclass(frozen=True, eq=False)
class Supports:
    """Several supports, each of which holds its own surface."""

    parts: tuple[Support, ...]

    def density(self, points: Floats, normals: Floats) -> Floats:
        """The sum of all."""
        return np.asarray(sum(one.density(points, normals) for one in self.parts))

    def fixed(self, points: Floats, normals: Floats) -> Booleans:
        """What any of them fixes."""
        found = np.stack([one.fixed(points, normals) for one in self.parts])
        return np.asarray(found.any(axis=0))

    def scaled(self, times: float) -> Supports:
        """All of them so many times as stiff."""
        return Supports(tuple(one.scaled(times) for one in self.parts))


def free_motion(
    support: Support, points: Floats, normals: Floats, areas: Floats
) -> tuple[Floats, Floats] | None:
    """A rigid motion that nothing resists, as translation and rotation (3,); None if there is none.

    `areas` (n,) of the points of a surface. The rotation is about the middle of the points, over
    half of their extent; the larger of the two is 1.
    """
    extent = 0.5 * float(np.ptp(points, axis=0).max())
    arm = (points - points.mean(axis=0)) / extent
    motions = np.zeros((len(points), 3, 6))
    motions[:, :, :3] = np.eye(3)
    for k in range(3):
        motions[:, :, 3 + k] = np.cross(np.eye(3)[k], arm)
    held = (support.density(points, normals) > 0.0)[:, None] | support.fixed(points, normals)
    stiffness = np.einsum("nda,nd,ndb->ab", motions, held * areas[:, None], motions)
    squares, shapes = np.linalg.eigh(stiffness)
    if squares[0] > FREE * squares[-1]:
        return None
    shape = shapes[:, 0] / np.abs(shapes[:, 0]).max()
    return shape[:3], shape[3:]
