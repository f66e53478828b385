"""What a mesh file says, before anything is checked."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import FloatArray, IndexArray, MeshError

Block = tuple[str, NDArray[Any]]
"""A cell type by its usual name (tetra, tetra10, triangle, quad, hexahedron, ...) and its cells."""

# Type -> corner nodes, which come first in every row; the rest of the row is mid-side nodes.
_TETRAHEDRA = {"tetra": 4, "tetra10": 4}
_FACES = {"triangle": 3, "triangle6": 3, "quad": 4, "quad8": 4, "quad9": 4}
_ROW = {"tetra": 4, "tetra10": 10, "triangle": 3, "triangle6": 6, "quad": 4, "quad8": 8, "quad9": 9}
_SOLID = ("hexahedron", "wedge", "pyramid", "polyhedron", "tetra", "VTK_LAGRANGE")


@dataclass(frozen=True)
class RawMesh:
    """Nodes [file units], shape (n, 3), and cells as rows of 0-based node numbers, as read."""

    points: FloatArray
    tetrahedra: IndexArray
    triangles: IndexArray
    solids: dict[str, int]
    """Number of volume cells of every type that cannot be used."""
    notes: tuple[str, ...] = ()


def raw_mesh(points: NDArray[Any], blocks: Iterable[Block], notes: Sequence[str] = ()) -> RawMesh:
    """Sort cell blocks by what can be done with them; polygons become fans of triangles.

    Raises
    ------
    MeshError
        If a block has rows of a length that does not fit its type.
    """
    tetrahedra: list[NDArray[Any]] = []
    triangles: list[NDArray[Any]] = []
    solids: dict[str, int] = {}
    found = list(notes)
    for name, cells in blocks:
        if len(cells) == 0:
            continue
        if name in _TETRAHEDRA:
            tetrahedra.append(_corners(name, cells, _TETRAHEDRA[name], found))
        elif name in _FACES:
            triangles.append(fan(_corners(name, cells, _FACES[name], found)))
            _note_fan(name, cells, found)
        elif name == "polygon" and np.ndim(cells) == 2:
            triangles.append(fan(np.asarray(cells)))
            _note_fan(name, cells, found)
        elif name.startswith(_SOLID):
            solids[name] = solids.get(name, 0) + len(cells)
    return RawMesh(
        np.asarray(points, dtype=float),
        _stack(tetrahedra, 4),
        _stack(triangles, 3),
        solids,
        tuple(found),
    )


def fan(polygons: NDArray[Any]) -> NDArray[Any]:
    """Triangles around the first corner of each polygon, shape (k (m - 2), 3) from (k, m)."""
    if polygons.shape[1] < 3:
        raise MeshError(f"{len(polygons)} polygons have fewer than three corners: damaged file")
    later = [polygons[:, [0, i, i + 1]] for i in range(1, polygons.shape[1] - 1)]
    return np.stack(later, axis=1).reshape(-1, 3)


def by_corner_count(polygons: Sequence[Sequence[int]]) -> list[Block]:
    """Blocks of polygons with equal corner numbers; the order within a block is the file's."""
    counts = np.array([len(polygon) for polygon in polygons], dtype=np.int64)
    return [
        (
            "triangle" if count == 3 else "polygon",
            np.array(
                [polygons[i] for i in np.flatnonzero(counts == count).tolist()], dtype=np.int64
            ),
        )
        for count in np.unique(counts)
    ]


def _corners(name: str, cells: NDArray[Any], corners: int, notes: list[str]) -> NDArray[Any]:
    if np.ndim(cells) != 2 or cells.shape[1] != _ROW[name]:
        raise MeshError(
            f"cells of type {name} have shape {np.shape(cells)} instead of (n, {_ROW[name]}): "
            "damaged or truncated file; export it again"
        )
    if cells.shape[1] > corners:
        notes.append(f"{len(cells)} cells of type {name}: mid-side nodes not used, edges straight")
    return cells[:, :corners]


def _note_fan(name: str, cells: NDArray[Any], notes: list[str]) -> None:
    if not name.startswith("triangle"):
        notes.append(
            f"{len(cells)} faces of type {name} cut into triangles from their first corner; "
            "triangles are numbered after that"
        )


def _stack(rows: list[NDArray[Any]], width: int) -> IndexArray:
    if not rows:
        return np.empty((0, width), dtype=np.int64)
    return np.concatenate(rows).astype(np.int64)
