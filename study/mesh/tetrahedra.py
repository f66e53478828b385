"""Geometry of a tetrahedral mesh: volumes, boundary, quality, refinement."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import SurfaceMesh, TetrahedralMesh

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Face i lies opposite vertex i; seen from outside its vertices run anticlockwise.
FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
EDGES = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])


def volumes(mesh: TetrahedralMesh) -> Floats:
    """Signed volume [m^3] of each tetrahedron."""
    corner = mesh.points[mesh.tetrahedra]
    return np.asarray(np.linalg.det(corner[:, 1:] - corner[:, :1]) / 6.0)


def boundary(mesh: TetrahedralMesh) -> SurfaceMesh:
    """Closed surface of the mesh, triangles outward; its points are those of the mesh on it."""
    faces = mesh.tetrahedra[:, FACES].reshape(-1, 3)
    _, first, count = np.unique(
        np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True
    )
    outer = faces[np.sort(first[count == 1])]
    used, triangles = np.unique(outer, return_inverse=True)
    return SurfaceMesh(mesh.points[used], triangles.reshape(outer.shape))


def mean_edge(mesh: TetrahedralMesh) -> float:
    """Mean length [m] of the distinct edges."""
    ends = mesh.points[edges(mesh.tetrahedra)]
    return float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean())


def edges(tetrahedra: Ints) -> Ints:
    """Distinct edges, shape (e, 2), the lower number first."""
    pairs = np.sort(tetrahedra[:, EDGES].reshape(-1, 2), axis=1)
    count = int(pairs.max(initial=0)) + 1
    # Sorted as one number each: numpy compares rows as bytes, which takes ten times as long.
    return np.stack(np.divmod(np.unique(pairs @ np.array([count, 1])), count), axis=1)


def smallest_dihedral_angle(mesh: TetrahedralMesh) -> Floats:
    """Smallest of the six dihedral angles [degrees] of each tetrahedron."""
    corner = mesh.points[mesh.tetrahedra]
    a, b, c = (corner[:, FACES[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    cosine = -np.einsum("tid,tid->ti", normal[:, EDGES[:, 0]], normal[:, EDGES[:, 1]])
    return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))).min(axis=1))


def refined(mesh: TetrahedralMesh) -> TetrahedralMesh:
    """Each tetrahedron split into eight: four at the corners, four around the inner diagonal.

    The shortest of the three inner diagonals is used, which keeps the best element shapes.
    """
    edge_list = edges(mesh.tetrahedra)
    key = edge_list @ np.array([len(mesh.points), 1])
    pairs = np.sort(mesh.tetrahedra[:, EDGES], axis=2)
    middle = len(mesh.points) + np.searchsorted(key, pairs @ np.array([len(mesh.points), 1]))
    points = np.concatenate([mesh.points, mesh.points[edge_list].mean(axis=1)])
    children = np.concatenate([_corner_children(mesh.tetrahedra, middle), _inner(points, middle)])
    return oriented(TetrahedralMesh(points, children))


def _corner_children(tetrahedra: Ints, middle: Ints) -> Ints:
    m01, m02, m03, m12, m13, m23 = middle.T
    v0, v1, v2, v3 = tetrahedra.T
    return np.concatenate(
        [
            np.stack([v0, m01, m02, m03], axis=1),
            np.stack([m01, v1, m12, m13], axis=1),
            np.stack([m02, m12, v2, m23], axis=1),
            np.stack([m03, m13, m23, v3], axis=1),
        ]
    )


def _inner(points: Floats, middle: Ints) -> Ints:
    """The octahedron between the edge middles, split round its shortest diagonal."""
    m01, m02, m03, m12, m13, m23 = middle.T
    choices = np.stack(  # the diagonal's two ends, then the ring round it
        [
            np.stack([m01, m23, m02, m03, m13, m12], axis=1),
            np.stack([m02, m13, m01, m03, m23, m12], axis=1),
            np.stack([m03, m12, m01, m02, m23, m13], axis=1),
        ],
        axis=1,
    )
    length = np.linalg.norm(points[choices[..., 0]] - points[choices[..., 1]], axis=2)
    chosen = choices[np.arange(len(middle)), length.argmin(axis=1)]
    a, b, ring = chosen[:, 0], chosen[:, 1], chosen[:, 2:]
    return np.concatenate(
        [np.stack([a, b, ring[:, i], ring[:, (i + 1) % 4]], axis=1) for i in range(4)]
    )


def oriented(mesh: TetrahedralMesh) -> TetrahedralMesh:
    """The same mesh with all volumes positive."""
    tetrahedra = mesh.tetrahedra.copy()
    negative = volumes(mesh) < 0
    tetrahedra[negative, 2:] = tetrahedra[negative, :1:-1]
    return TetrahedralMesh(mesh.points, tetrahedra)
