"""A quarter of a straight cylinder of tetrahedra, with its axis along z from the origin."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import TetrahedralMesh
from study.mesh.tetrahedra import oriented

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SECTORS = 2
"""Sectors of the quarter; ring k has k parts of an arc in each."""


def quarter_cylinder(radius: float, height: float, rings: int, layers: int) -> TetrahedralMesh:
    """The quarter with x and y from zero, of a `radius` [m] and a `height` [m].

    Rings become thinner towards the rim and layers towards both ends, where held faces make the
    stress singular.
    """
    radii = radius * np.sin(0.5 * np.pi * np.arange(rings + 1) / rings)
    levels = 0.5 * height * (1.0 - np.cos(np.pi * np.arange(layers + 1) / layers))
    disc = np.concatenate([_ring(r, k) for k, r in enumerate(radii)])
    points = np.concatenate([np.insert(disc, 2, z, axis=1) for z in levels])
    bottom = np.sort(_triangles(rings), axis=1)
    prisms = [
        np.concatenate([bottom + layer * len(disc), bottom + (layer + 1) * len(disc)], axis=1)
        for layer in range(layers)
    ]
    # Cut along the diagonals from lower numbers below to higher numbers above: neighbours agree.
    cuts = np.array([[0, 1, 2, 5], [0, 1, 4, 5], [0, 3, 4, 5]])
    tetrahedra = np.concatenate(prisms)[:, cuts].reshape(-1, 4)
    return oriented(TetrahedralMesh(points, tetrahedra))


def onto_side(radius: float, rings: int) -> Callable[[Floats], Floats]:
    """Moves the midpoints of edges on the curved side (n, 3) onto it, and leaves other points."""
    nearest = radius * np.cos(0.25 * np.pi / (SECTORS * rings)) * (1.0 - 1e-9)

    def project(points: Floats) -> Floats:
        away = np.hypot(points[:, 0], points[:, 1])
        scale = np.where(away >= nearest, radius / np.maximum(away, nearest), 1.0)
        return np.asarray(points * np.stack([scale, scale, np.ones_like(scale)], axis=1))

    return project


def _ring(radius: float, number: int) -> Floats:
    """Points (SECTORS number + 1, 2) of a quarter of a circle."""
    angle = np.linspace(0.0, 0.5 * np.pi, SECTORS * number + 1)
    found = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    found[0, 1] = 0.0
    found[-1, 0] = 0.0 if number else found[-1, 0]  # exactly on the planes of symmetry
    return found


def _triangles(rings: int) -> Ints:
    """Triangles (k, 3) of all rings; ring k starts at number SECTORS k (k - 1) / 2 + k."""
    found = []
    for k in range(rings):
        inner, outer = (SECTORS * n * (n - 1) // 2 + n for n in (k, k + 1))
        for sector in range(SECTORS):
            a, b = inner + sector * k, outer + sector * (k + 1)
            found += [[a + j, b + j, b + j + 1] for j in range(k + 1)]
            found += [[a + j, b + j + 1, a + j + 1] for j in range(k)]
    return np.array(found, dtype=np.int64)
