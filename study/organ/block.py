"""A block of tetrahedra, with its lower corner at the origin."""

from __future__ import annotations

from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import TetrahedralMesh
from study.mesh.tetrahedra import oriented


def cell_counts(size: tuple[float, float, float], element_size: float) -> NDArray[np.int64]:
    """Cells along each axis, none longer than `element_size` [m]."""
    return np.maximum(1, np.ceil(np.array(size) / element_size - 1e-9).astype(np.int64))


def block_mesh(size: tuple[float, float, float], element_size: float) -> TetrahedralMesh:
    """Block [0, size] [m] of cells no longer than `element_size`."""
    return block_of_cells(size, cell_counts(size, element_size))


def block_of_cells(size: tuple[float, float, float], counts: NDArray[np.int64]) -> TetrahedralMesh:
    """Block [0, size] [m] with this number of cells per axis, each cut into six (Kuhn)."""
    axes = [np.linspace(0.0, s, n + 1) for s, n in zip(size, counts, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(len(points)).reshape(counts + 1)
    lowest = number[:-1, :-1, :-1].ravel()
    stride = np.array([(counts[1] + 1) * (counts[2] + 1), counts[2] + 1, 1])
    # Each order of walking the three axes from the lowest to the highest corner is a tetrahedron.
    walks = np.array([np.cumsum([0, *stride[list(order)]]) for order in permutations(range(3))])
    tetrahedra = (lowest[:, None, None] + walks[None]).reshape(-1, 4)
    return oriented(TetrahedralMesh(points, tetrahedra))
