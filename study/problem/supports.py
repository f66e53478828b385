"""Supports of the organ: elastic foundations, and clamped or sliding surfaces."""

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
"""Stiffness against a rigid motion, relative to the largest, below which the motion is free."""


class Support(Protocol):
    """Protocol of a support of part of the surface."""

    def density(self, points: Floats, normals: Floats) -> Floats:
        """Stiffness per area [Pa/m] at points [m] (..., 3) with outward normals (..., 3)."""

    def fixed(self, points: Floats, normals: Floats) -> Booleans:
        """Components (..., 3) that are fixed at points with outward normals (..., 3)."""

    def scaled(self, times: float) -> Support:
        """The support with `times` its stiffness; fixed components stay fixed."""


@dataclass(frozen=True, eq=False)
class FixedSurface:
    """A surface fixed along `directions` (3,): that of a foundation of this `extent`.

    It is the limit of that foundation as its stiffness grows, in those directions.
    """

    extent: Foundation
    directions: Booleans

    def density(self, points: Floats, normals: Floats) -> Floats:
        """Zero: it has no stiffness beside the fixed components."""
        return np.zeros(np.broadcast_shapes(points.shape, normals.shape)[:-1])

    def fixed(self, points: Floats, normals: Floats) -> Booleans:
        """See Support."""
        held = self.extent.covers(points, normals)
        return np.asarray(held[..., None] & self.directions)

    def scaled(self, times: float) -> FixedSurface:
        """The surface unchanged, as it has no stiffness to scale."""
        del times
        return self


@dataclass(frozen=True, eq=False)
class Supports:
    """Several supports, each of its own part of the surface."""

    parts: tuple[Support, ...]

    def density(self, points: Floats, normals: Floats) -> Floats:
        """The sum over all supports."""
        return np.asarray(sum(one.density(points, normals) for one in self.parts))

    def fixed(self, points: Floats, normals: Floats) -> Booleans:
        """Components that any of the supports fixes."""
        found = np.stack([one.fixed(points, normals) for one in self.parts])
        return np.asarray(found.any(axis=0))

    def scaled(self, times: float) -> Supports:
        """All supports with `times` their stiffness."""
        return Supports(tuple(one.scaled(times) for one in self.parts))


def free_motion(
    support: Support, points: Floats, normals: Floats, areas: Floats
) -> tuple[Floats, Floats] | None:
    """A rigid motion that the support does not resist, None if there is none.

    As translation and rotation (3,) about the middle of the points, the rotation scaled by half of
    their extent; the larger of the two is 1. `areas` (n,): weights of the surface points.
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
