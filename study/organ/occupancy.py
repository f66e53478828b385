"""Which points of a regular grid lie inside a body."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numba
import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import SurfaceMesh, TetrahedralMesh

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]


class SolidShape(Protocol):
    """Anything that can say which points of a regular grid lie inside it."""

    def occupancy(self, x: Floats, y: Floats, z: Floats) -> Booleans:
        """Inside or not, shape (x.size, y.size, z.size), on the grid of three equidistant axes."""


@dataclass(frozen=True)
class ImplicitBody:
    """The points where `signed` is negative; `signed` takes points [m], shape (..., 3)."""

    signed: Callable[[Floats], Floats]

    def occupancy(self, x: Floats, y: Floats, z: Floats) -> Booleans:
        """See SolidShape. Evaluated layer by layer to bound the memory."""
        layer = np.stack(np.broadcast_arrays(y[:, None], z[None, :]), axis=-1)
        return np.stack([self._layer(value, layer) for value in x])

    def _layer(self, x: float, layer: Floats) -> Booleans:
        points = np.concatenate([np.full((*layer.shape[:2], 1), x), layer], axis=-1)
        return np.asarray(self.signed(points) < 0)


@dataclass(frozen=True)
class MeshBody:
    """The union of the tetrahedra of a mesh."""

    mesh: TetrahedralMesh

    def occupancy(self, x: Floats, y: Floats, z: Floats) -> Booleans:
        """See SolidShape."""
        inside = np.zeros((x.size, y.size, z.size), dtype=np.bool_)
        origin = np.array([x[0], y[0], z[0]])
        step = np.array([axis[1] - axis[0] if axis.size > 1 else 1.0 for axis in (x, y, z)])
        _rasterise(self.mesh.points, self.mesh.tetrahedra, origin, step, inside)
        return inside


@dataclass(frozen=True)
class SurfaceBody:
    """What a closed surface encloses whose triangles face outwards, by the turns round a point.

    Counted along z: a triangle met from outside counts one, from inside less one.
    """

    surface: SurfaceMesh

    def occupancy(self, x: Floats, y: Floats, z: Floats) -> Booleans:
        """See SolidShape."""
        turns = np.zeros((x.size, y.size, z.size + 1), dtype=np.int32)
        _count_crossings(self.surface.points[self.surface.triangles], x, y, z, turns)
        return np.asarray(turns.cumsum(axis=2)[:, :, :-1] > 0)


@numba.njit(cache=True)
def _count_crossings(
    triangles: Floats, x: Floats, y: Floats, z: Floats, turns: NDArray[np.int32]
) -> None:
    """Add the turn of each triangle to the first grid point beyond it on every line along z.

    A line through an edge meets one of its two triangles, as both cross the edge at the same place
    in floating point and it counts at its lower end only.
    """
    for t in range(triangles.shape[0]):
        a, b, c = triangles[t]
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if area == 0.0:
            continue
        first, last = min(a[1], b[1], c[1]), max(a[1], b[1], c[1])
        for j in range(np.searchsorted(y, first), np.searchsorted(y, last)):
            from_, to = np.inf, -np.inf
            for p, q in ((a, b), (b, c), (c, a)):
                low, high = (p, q) if p[1] < q[1] else (q, p)
                if low[1] <= y[j] < high[1]:
                    share = (y[j] - low[1]) / (high[1] - low[1])
                    at = low[0] + share * (high[0] - low[0])
                    from_, to = min(from_, at), max(to, at)
            for i in range(np.searchsorted(x, from_), np.searchsorted(x, to)):
                u = ((x[i] - a[0]) * (c[1] - a[1]) - (y[j] - a[1]) * (c[0] - a[0])) / area
                v = ((b[0] - a[0]) * (y[j] - a[1]) - (b[1] - a[1]) * (x[i] - a[0])) / area
                height = a[2] + u * (b[2] - a[2]) + v * (c[2] - a[2])
                turns[i, j, np.searchsorted(z, height)] += 1 if area < 0.0 else -1


def _rasterise(
    points: Floats, tetrahedra: NDArray[np.int64], origin: Floats, step: Floats, inside: Booleans
) -> None:
    """Mark the grid points of each tetrahedron by their barycentric coordinates."""
    corners = points[tetrahedra]
    low = np.ceil((corners.min(axis=1) - origin) / step)
    high = np.floor((corners.max(axis=1) - origin) / step)
    first = np.maximum(low, 0).astype(np.int64)
    end = np.minimum(high, np.array(inside.shape) - 1).astype(np.int64) + 1
    _mark(corners[:, 0].copy(), _barycentric_rows(corners), first, end, origin, step, inside)


def _barycentric_rows(corners: Floats) -> Floats:
    """Inverses (t, 3, 3) of the edge matrices of tetrahedra with corners (t, 4, 3), by cofactors.

    Row r, times the offset of a point from the first corner, is its barycentric coordinate r + 1.
    """
    edges = corners[:, 1:] - corners[:, :1]
    p, q = edges[:, [1, 2, 0]], edges[:, [2, 0, 1]]
    e, f = [1, 2, 0], [2, 0, 1]
    cofactors = p[:, :, e] * q[:, :, f] - p[:, :, f] * q[:, :, e]
    first = cofactors[:, 0] * edges[:, 0]
    six_volumes = first[:, 0] + first[:, 1] + first[:, 2]
    return np.asarray(cofactors / six_volumes[:, None, None])


@numba.njit(cache=True, no_cfunc_wrapper=True, _nrt=False)  # it allocates no array
def _mark(
    corner: Floats,
    rows: Floats,
    first: NDArray[np.int64],
    end: NDArray[np.int64],
    origin: Floats,
    step: Floats,
    inside: Booleans,
) -> None:
    """Mark those from the first to before the end (t, 3) that are in tetrahedra.

    `corner` (t, 3): first corner; `rows` (t, 3, 3): of `_barycentric_rows`.
    """
    tolerance = -1e-12
    for t in range(corner.shape[0]):
        for i in range(first[t, 0], end[t, 0]):
            dx = origin[0] + i * step[0] - corner[t, 0]
            for j in range(first[t, 1], end[t, 1]):
                dy = origin[1] + j * step[1] - corner[t, 1]
                for k in range(first[t, 2], end[t, 2]):
                    dz = origin[2] + k * step[2] - corner[t, 2]
                    a = rows[t, 0, 0] * dx + rows[t, 0, 1] * dy + rows[t, 0, 2] * dz
                    b = rows[t, 1, 0] * dx + rows[t, 1, 1] * dy + rows[t, 1, 2] * dz
                    c = rows[t, 2, 0] * dx + rows[t, 2, 1] * dy + rows[t, 2, 2] * dz
                    if min(a, b, c, 1.0 - a - b - c) >= tolerance:
                        inside[i, j, k] = True
