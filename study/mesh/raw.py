"""What a mesh file says, before anything is checked."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import FloatArray, IndexArray, MeshError
from study.mesh.listing import listing

Block = tuple[str, NDArray[Any]]
"""A cell type by its usual name (tetra, tetra10, triangle, quad, hexahedron, ...) and its cells."""

# Shape and, unless the cell is linear, the number of its nodes, of which the corners come first.
_USABLE = re.compile(r"(tetra|triangle|quad)(\d*)")
_CORNERS = {"tetra": 4, "triangle": 3, "quad": 4}
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
    curved, cut = _Tally(), _Tally()
    for name, cells in blocks:
        if len(cells) == 0:
            continue
        shape = _USABLE.fullmatch(name)
        if shape and shape[1] == "tetra":
            tetrahedra.append(_corners(name, cells))
            curved.add(name, len(cells), bool(shape[2]))
        elif shape or (name == "polygon" and np.ndim(cells) == 2):
            triangles.append(fan(_corners(name, cells) if shape else np.asarray(cells)))
            curved.add(name, len(cells), bool(shape and shape[2]))
            cut.add(name, len(cells), not name.startswith("triangle"))
        elif is_solid(name):
            solids[name] = solids.get(name, 0) + len(cells)
    return RawMesh(
        np.asarray(points, dtype=float),
        _stack(tetrahedra, 4),
        _stack(triangles, 3),
        solids,
        (*notes, *_notes(curved, cut)),
    )


def is_solid(name: str) -> bool:
    """Whether cells of this type have a volume."""
    return name.startswith(_SOLID)


class _Tally:
    """How many cells of which types something was done to, and the first of them."""

    def __init__(self) -> None:
        self.types: dict[str, int] = {}
        self.first: list[int] = []
        self.seen = 0

    def add(self, name: str, count: int, concerned: bool) -> None:
        """Count the cells of a block, to all or none of which it is done."""
        if concerned:
            self.types[name] = self.types.get(name, 0) + count
            self.first += range(self.seen, self.seen + min(count, 6 - len(self.first)))
        self.seen += count

    def text(self, what: str) -> str:
        """Number of cells, their types and the first of them, as `12 faces of type quad`."""
        names = ", ".join(self.types)
        kind = "type" if len(self.types) == 1 else "types"
        return f"{sum(self.types.values())} {what} of {kind} {names}"


def _notes(curved: _Tally, cut: _Tally) -> Iterator[str]:
    if curved.types:
        yield f"{curved.text('cells')}: mid-side nodes not used, edges straight"
    if cut.types:
        yield (
            f"{cut.text('faces')} cut into triangles from their first corner; first (0-based): "
            f"{listing(np.array(cut.first))}; triangles are numbered after that"
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


def nodes_of(name: str) -> int:
    """Number of nodes of a tetrahedron, triangle or quad of any order, zero for other cells."""
    shape = _USABLE.fullmatch(name)
    return int(shape[2] or _CORNERS[shape[1]]) if shape else 0


def _corners(name: str, cells: NDArray[Any]) -> NDArray[Any]:
    expected = nodes_of(name)
    if np.ndim(cells) != 2 or cells.shape[1] != expected:
        raise MeshError(
            f"cells of type {name} have shape {np.shape(cells)} instead of (n, {expected}): "
            "damaged or truncated file; export it again"
        )
    return cells[:, : _CORNERS[name.rstrip("0123456789")]]


def _stack(rows: list[NDArray[Any]], width: int) -> IndexArray:
    if not rows:
        return np.empty((0, width), dtype=np.int64)
    return np.concatenate(rows).astype(np.int64)
