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


class Body(Protocol):
    """Anything that can say which points of a regular grid lie inside it."""

    def occupancy(self, x: Floats, y: Floats, z: Floats) -> Booleans:
        """Inside or not, shape (x.size, y.size, z.size), on the grid of three equidistant axes."""


@dataclass(frozen=True)
class ImplicitBody:
    """The points where `signed` is negative; `signed` takes points [m], shape (..., 3)."""

    signed: Callable[[Floats], Floats]

    def occupancy(self, x: Floats, y: Floats, z: Floats) -> Booleans:
        """See Body. Evaluated layer by layer to bound the memory."""
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
        """See Body."""
        inside = np.zeros((x.size, y.size, z.size), dtype=np.bool_)
        origin = np.array([x[0], y[0], z[0]])
        step = np.array([axis[1] - axis[0] if axis.size > 1 else 1.0 for axis in (x, y, z)])
        _rasterise(self.mesh.points, self.mesh.tetrahedra, origin, step, inside)
        return inside


@numba.njit(cache=True)
def _rasterise(
    points: Floats, tetrahedra: NDArray[np.int64], origin: Floats, step: Floats, inside: Booleans
) -> None:
    """Mark the grid points of each tetrahedron by their barycentric coordinates."""
    tolerance = -1e-12
    first = np.empty(3, np.int64)
    last = np.empty(3, np.int64)
    for t in range(tetrahedra.shape[0]):
        corner = points[tetrahedra[t]]
        inverse = np.linalg.inv((corner[1:] - corner[0]).T)
        for axis in range(3):
            low = (corner[:, axis].min() - origin[axis]) / step[axis]
            high = (corner[:, axis].max() - origin[axis]) / step[axis]
            first[axis] = max(0, int(np.ceil(low)))
            last[axis] = min(inside.shape[axis] - 1, int(np.floor(high)))
        for i in range(first[0], last[0] + 1):
            for j in range(first[1], last[1] + 1):
                for k in range(first[2], last[2] + 1):
                    dx = origin[0] + i * step[0] - corner[0, 0]
                    dy = origin[1] + j * step[1] - corner[0, 1]
                    dz = origin[2] + k * step[2] - corner[0, 2]
                    a = inverse[0, 0] * dx + inverse[0, 1] * dy + inverse[0, 2] * dz
                    b = inverse[1, 0] * dx + inverse[1, 1] * dy + inverse[1, 2] * dz
                    c = inverse[2, 0] * dx + inverse[2, 1] * dy + inverse[2, 2] * dz
                    if min(a, b, c, 1.0 - a - b - c) >= tolerance:
                        inside[i, j, k] = True
