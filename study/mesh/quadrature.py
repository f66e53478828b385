"""Gauss rules on triangles and tetrahedra, by collapsing the square and the cube.

Stroud (1971), Approximate calculation of multiple integrals: a product of Gauss-Jacobi rules is
exact to degree 2 n - 1 with n points per direction, and all its weights are positive.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import SurfaceMesh, TetrahedralMesh

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class SurfaceRule:
    """Points [m] (q, 3), outward unit normals (q, 3) and areas [m^2] (q,) over a surface."""

    points: Floats
    normals: Floats
    weights: Floats


@dataclass(frozen=True)
class VolumeRule:
    """Points [m] (q, 3) and volumes [m^3] (q,) over a body."""

    points: Floats
    weights: Floats


def over_surface(surface: SurfaceMesh, per_direction: int) -> SurfaceRule:
    """Rule with `per_direction`^2 points on each triangle."""
    barycentric, weights = _simplex_rule(2, per_direction)
    corner = surface.points[surface.triangles]
    area_vector = 0.5 * np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    area = np.linalg.norm(area_vector, axis=1)
    return SurfaceRule(
        np.einsum("qv,tvd->tqd", barycentric, corner).reshape(-1, 3),
        np.repeat(area_vector / area[:, None], len(weights), axis=0),
        np.outer(area, weights).ravel(),
    )


def over_volume(mesh: TetrahedralMesh, per_direction: int) -> VolumeRule:
    """Rule with `per_direction`^3 points in each tetrahedron."""
    barycentric, weights = _simplex_rule(3, per_direction)
    corner = mesh.points[mesh.tetrahedra]
    volume = np.abs(np.linalg.det(corner[:, 1:] - corner[:, :1])) / 6.0
    points = np.einsum("qv,tvd->tqd", barycentric, corner).reshape(-1, 3)
    return VolumeRule(points, np.outer(volume, weights).ravel())


@cache
def _simplex_rule(dimension: int, count: int) -> tuple[Floats, Floats]:
    """Barycentric points (q, dimension + 1) and weights (q,) of sum one."""
    from scipy.special import roots_jacobi

    points, weights = np.ones((1, 1)), np.ones(1)
    for power in range(dimension):
        # One more barycentric coordinate; the others shrink, hence the Jacobi weight (1 - t)^power.
        root, weight = roots_jacobi(count, power, 0)
        t, w = 0.5 * (root + 1.0), weight / weight.sum()
        shrunk = (points[:, None] * (1.0 - t)[None, :, None]).reshape(-1, power + 1)
        points = np.column_stack([shrunk, np.tile(t, len(weights))])
        weights = np.outer(weights, w).ravel()
    return points, weights
