"""Find the tetrahedron round each point."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import TetrahedralMesh

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
CANDIDATES = 32


def locate(mesh: TetrahedralMesh, points: Floats) -> tuple[Ints, Floats]:
    """Tetrahedron (q,) of each point [m] (q, 3), and its four barycentric coordinates (q, 4).

    Of the nearest tetrahedra by centroid, the one whose smallest coordinate is largest. A point
    outside the mesh gets a negative coordinate: its tetrahedron is extrapolated.
    """
    from scipy.spatial import KDTree

    corner = mesh.points[mesh.tetrahedra]
    count = min(CANDIDATES, len(corner))
    near = KDTree(corner.mean(axis=1)).query(points, k=count)[1].reshape(len(points), count)
    inverse = np.linalg.inv(np.swapaxes(corner[:, 1:] - corner[:, :1], 1, 2))
    local = np.einsum("qcij,qcj->qci", inverse[near], points[:, None] - corner[near, 0])
    barycentric = np.concatenate([1.0 - local.sum(axis=2, keepdims=True), local], axis=2)
    best = barycentric.min(axis=2).argmax(axis=1)
    row = np.arange(len(points))
    return near[row, best], barycentric[row, best]
