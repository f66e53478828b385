"""Meshes of a ball and an eighth of a shell: octahedra mapped to spheres, with exact surfaces."""

from __future__ import annotations

from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray

from fem_reference.grid import Projection
from study.mesh.kinds import TetrahedralMesh
from study.mesh.tetrahedra import oriented, refined

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def ball(refinements: int) -> tuple[TetrahedralMesh, Projection]:
    """Mesh of the unit ball, eight tetrahedra refined twice or more, and its sphere."""
    points = np.vstack([np.zeros(3), np.eye(3), -np.eye(3)])
    octants = np.array(list(product((1, 4), (2, 5), (3, 6))))
    return _ball(points, np.insert(octants, 0, 0, axis=1), refinements)


def ball_octant(refinements: int) -> tuple[TetrahedralMesh, Projection]:
    """Mesh of the eighth of the unit ball where x, y and z are positive, and its sphere."""
    return _ball(np.vstack([np.zeros(3), np.eye(3)]), np.arange(4)[None], refinements)


def _ball(points: Floats, octants: Ints, refinements: int) -> tuple[TetrahedralMesh, Projection]:
    mesh = oriented(TetrahedralMesh(points, octants))
    for _ in range(refinements):
        mesh = refined(mesh)
    return _blown_up(mesh), _spheres((1.0,), 0.5**refinements)


def shell_octant(inner: float, outer: float, layers: int) -> tuple[TetrahedralMesh, Projection]:
    """Mesh of a thick shell [m] where x, y and z are positive, and its two spheres.

    A quarter of a circle has twice as many cells as there are layers.
    """
    i, j = np.array([(i, j) for i in range(2 * layers + 1) for j in range(2 * layers + 1 - i)]).T
    triangle = np.stack([i, j, 2 * layers - i - j], axis=1) / (2 * layers)
    radii = np.linspace(inner, outer, layers + 1)
    points = (radii[:, None, None] * triangle).reshape(-1, 3)
    prisms = _prisms(_triangles(2 * layers), len(triangle), layers)
    mesh = _blown_up(TetrahedralMesh(points, prisms))
    return mesh, _spheres((inner, outer), (outer - inner) / layers)


def _triangles(cells: int) -> Ints:
    """Triangles of the vertices (i, j), i + j <= cells, in rows of i; numbers ascend in each."""
    start = np.cumsum([0, *range(cells + 1, 0, -1)])
    found = []
    for i in range(cells):
        for j in range(cells - i):
            this, following = start[i] + j, start[i + 1] + j
            found.append((this, this + 1, following))
            if j < cells - i - 1:
                found.append((this + 1, following, following + 1))
    return np.array(found)


def _prisms(triangles: Ints, vertices: int, layers: int) -> Ints:
    """Tetrahedra (t, 4) of prisms; diagonals follow vertex numbers, so that neighbours agree."""
    low = np.concatenate([triangles + vertices * layer for layer in range(layers)])
    both = np.concatenate([low, low + vertices], axis=1)
    return np.concatenate([both[:, [0, 1, 2, 5]], both[:, [0, 1, 4, 5]], both[:, [0, 3, 4, 5]]])


def _blown_up(mesh: TetrahedralMesh) -> TetrahedralMesh:
    """Map octahedra to spheres: |x| + |y| + |z|, constant on an octahedron, becomes the radius."""
    size = np.linalg.norm(mesh.points, axis=1)
    scale = np.abs(mesh.points).sum(axis=1) / np.where(size > 0.0, size, 1.0)
    return oriented(TetrahedralMesh(scale[:, None] * mesh.points, mesh.tetrahedra))


def _spheres(radii: tuple[float, ...], layer: float) -> Projection:
    """Projection onto the spheres of a mesh with layers of this thickness.

    The midpoint of a chord is closer to its sphere than a quarter of a layer, all others are
    farther.
    """
    return partial(_onto_spheres, radii=radii, near=0.25 * layer)


def _onto_spheres(points: Floats, radii: tuple[float, ...], near: float) -> Floats:
    """Points [m] (n, 3) near one of the spheres about the origin, moved onto it."""
    distance = np.linalg.norm(points, axis=1)
    target = distance.copy()
    for radius in radii:
        target[np.abs(distance - radius) < near] = radius
    return np.asarray(points * (target / distance)[:, None])
