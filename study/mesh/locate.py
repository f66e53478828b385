"""The tetrahedron that contains each point."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import TetrahedralMesh
from study.stages.threads import allowed

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
FEW, CANDIDATES = 6, 32
"""Candidate tetrahedra per point, and for a point outside all of the first."""
INSIDE = 1e-9
"""Smallest barycentric coordinate of a point that counts as inside."""


def locate(mesh: TetrahedralMesh, points: Floats) -> tuple[Ints, Floats]:
    """Tetrahedron (q,) of each point [m] (q, 3), and its four barycentric coordinates (q, 4).

    Of the nearest tetrahedra by centroid, the one whose smallest coordinate is largest. A point
    outside the mesh gets a negative coordinate: its tetrahedron is extrapolated.
    """
    from scipy.spatial import KDTree

    corner = mesh.points[mesh.tetrahedra]
    inverse = np.linalg.inv(np.swapaxes(corner[:, 1:] - corner[:, :1], 1, 2))
    tree = KDTree(corner.mean(axis=1))

    def best(points: Floats, count: int) -> tuple[Ints, Floats]:
        count = min(count, len(corner))
        near = tree.query(points, k=count, workers=allowed())[1].reshape(len(points), count)
        local = np.einsum("qcij,qcj->qci", inverse[near], points[:, None] - corner[near, 0])
        barycentric = np.concatenate([1.0 - local.sum(axis=2, keepdims=True), local], axis=2)
        chosen = barycentric.min(axis=2).argmax(axis=1)
        row = np.arange(len(points))
        return near[row, chosen], barycentric[row, chosen]

    cells, barycentric = best(points, FEW)
    open_ = np.flatnonzero(barycentric.min(axis=1) <= INSIDE)
    cells[open_], barycentric[open_] = best(points[open_], CANDIDATES)
    return cells, barycentric
