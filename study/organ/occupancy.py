"""Which points of a regular grid lie inside a body."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numba
import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import TetrahedralMesh

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


def _rasterise(
    points: Floats, tetrahedra: NDArray[np.int64], origin: Floats, step: Floats, inside: Booleans
) -> None:
    """Mark the grid points of each tetrahedron by their barycentric coordinates."""
    corners = points[tetrahedra]
    low = np.ceil((corners.min(axis=1) - origin) / step)
    high = np.floor((corners.max(axis=1) - origin) / step)
    first = np.maximum(low, 0).astype(np.int64)
    end = np.minimum(high, np.array(inside.shape) - 1).astype(np.int64) + 1
    _mark(corners, first, end, origin, step, inside)


@numba.njit(cache=True)
def _mark(
    corners: Floats,
    first: NDArray[np.int64],
    end: NDArray[np.int64],
    origin: Floats,
    step: Floats,
    inside: Booleans,
) -> None:
    """Mark those from the first to before the end (t, 3) that are in tetrahedra (t, 4, 3)."""
    tolerance = -1e-12
    rows = np.empty((3, 3))
    for t in range(corners.shape[0]):
        corner = corners[t]
        _barycentric_rows(corner, rows)
        for i in range(first[t, 0], end[t, 0]):
            for j in range(first[t, 1], end[t, 1]):
                for k in range(first[t, 2], end[t, 2]):
                    dx = origin[0] + i * step[0] - corner[0, 0]
                    dy = origin[1] + j * step[1] - corner[0, 1]
                    dz = origin[2] + k * step[2] - corner[0, 2]
                    a = rows[0, 0] * dx + rows[0, 1] * dy + rows[0, 2] * dz
                    b = rows[1, 0] * dx + rows[1, 1] * dy + rows[1, 2] * dz
                    c = rows[2, 0] * dx + rows[2, 1] * dy + rows[2, 2] * dz
                    if min(a, b, c, 1.0 - a - b - c) >= tolerance:
                        inside[i, j, k] = True


@numba.njit(cache=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _barycentric_rows(corner: Floats, rows: Floats) -> None:
    """Rows of the inverse of the edge matrix, written out: LAPACK would take seconds to compile."""
    for r in range(3):
        p, q = corner[1 + (r + 1) % 3], corner[1 + (r + 2) % 3]
        for d in range(3):
            e, f = (d + 1) % 3, (d + 2) % 3
            rows[r, d] = (p[e] - corner[0, e]) * (q[f] - corner[0, f]) - (p[f] - corner[0, f]) * (
                q[e] - corner[0, e]
            )
    six_volumes = 0.0
    for d in range(3):
        six_volumes += rows[0, d] * (corner[1, d] - corner[0, d])
    for r in range(3):
        for d in range(3):
            rows[r, d] /= six_volumes
