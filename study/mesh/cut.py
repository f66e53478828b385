"""A plane section of a tetrahedral mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import TetrahedralMesh

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ON_PLANE = 1e-9
"""Distance from the plane over the body's extent below which a vertex counts as above it."""
AT_VERTEX = 1e-6
"""Share of an edge within which the plane passes through its end."""
FLAT = 1e-12
"""Area of a triangle over the square of the extent below which it is omitted."""


def cut(mesh: TetrahedralMesh, place: Floats, normal: Floats) -> tuple[Floats, Ints]:
    """Points [m] (c, 3) and triangles (k, 3) of the section of a body by a plane.

    `place` [m] (3,) of the plane, `normal` (3,) its unit normal. The points lie on edges of
    tetrahedra, so that every field on them is defined there. Both are empty where the plane misses
    the body.
    """
    extent = float(np.ptp(mesh.points, axis=0).max())
    away = (mesh.points - place) @ normal
    away = np.where(np.abs(away) < ON_PLANE * extent, ON_PLANE * extent, away)
    above = away[mesh.tetrahedra] > 0.0
    count = above.sum(axis=1)
    lone_below = _corners(mesh.tetrahedra, ~above, count == 3)
    lone_above = _corners(mesh.tetrahedra, above, count == 1)
    halved = _corners(mesh.tetrahedra, above, count == 2)
    # One corner against three: a triangle; two against two: a quadrilateral, in two triangles.
    triangles = [
        np.stack([one[:, [0, k]] for k in (1, 2, 3)], axis=1) for one in (lone_below, lone_above)
    ]
    ring = np.stack([halved[:, pair] for pair in ((0, 2), (0, 3), (1, 3), (1, 2))], axis=1)
    triangles += [ring[:, [0, 1, 2]], ring[:, [0, 2, 3]]]
    edges = np.sort(np.concatenate(triangles), axis=2)
    ends, numbers = np.unique(edges.reshape(-1, 2), axis=0, return_inverse=True)
    share = away[ends[:, 0]] / (away[ends[:, 0]] - away[ends[:, 1]])
    share = np.where(share < AT_VERTEX, 0.0, np.where(share > 1.0 - AT_VERTEX, 1.0, share))[:, None]
    places = (1.0 - share) * mesh.points[ends[:, 0]] + share * mesh.points[ends[:, 1]]
    # Edges that end in the plane share the vertex there.
    points, same = np.unique(places, axis=0, return_inverse=True)
    return _without_flat(points, same.ravel()[numbers.ravel()].reshape(-1, 3), FLAT * extent**2)


def _corners(tetrahedra: Ints, first: NDArray[np.bool_], chosen: NDArray[np.bool_]) -> Ints:
    """Chosen tetrahedra, the corners that are `first` before the others."""
    order = np.argsort(~first[chosen], axis=1, kind="stable")
    return np.take_along_axis(tetrahedra[chosen], order, axis=1)


def _without_flat(points: Floats, triangles: Ints, least: float) -> tuple[Floats, Ints]:
    """Triangles of some area, and the points that they have."""
    corners = points[triangles]
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    kept = triangles[0.5 * np.linalg.norm(doubled, axis=1) > least]
    used, numbers = np.unique(kept, return_inverse=True)
    return points[used], numbers.reshape(-1, 3)
