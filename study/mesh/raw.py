"""The content of a mesh file before any check."""

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
_SOLID = ("hexahedron", "wedge", "pyramid", "polyhedron", "tetra", "voxel", "VTK")


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
    places = np.asarray(points, dtype=float)
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
            corners = _corners(name, cells) if shape else np.asarray(cells)
            triangles.append(fan(places, corners))
            curved.add(name, len(cells), bool(shape and shape[2]))
            cut.add(name, len(cells), not name.startswith("triangle"))
        elif is_solid(name):
            solids[name] = solids.get(name, 0) + len(cells)
    return RawMesh(
        places,
        _stack(tetrahedra, 4),
        _stack(triangles, 3),
        solids,
        (*notes, *_notes(curved, cut)),
    )


def is_solid(name: str) -> bool:
    """Whether cells of this type have a volume, or are of one of VTK's types without a name."""
    return name.startswith(_SOLID)


class _Tally:
    """Count of the cells of each type that something was done to, and the first of them."""

    def __init__(self) -> None:
        self.types: dict[str, int] = {}
        self.first: list[int] = []
        self.seen = 0

    def add(self, name: str, count: int, concerned: bool) -> None:
        """Count the cells of a block, all or none of which are concerned."""
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
            f"{cut.text('faces')} cut into triangles from their first corner (unless that folds "
            f"them); first (0-based): {listing(np.array(cut.first))}; triangles are numbered after "
            "that"
        )


def fan(points: FloatArray, polygons: NDArray[Any]) -> NDArray[Any]:
    """Triangles around one corner of each polygon, shape (k (m - 2), 3) from (k, m).

    It is the first corner unless the polygon has a re-entrant one, where triangles round the first
    might fold over each other; then the corner from which they fold least.
    """
    if polygons.shape[1] < 3:
        raise MeshError(f"{len(polygons)} polygons have fewer than three corners: damaged file")
    if polygons.shape[1] > 3 and _within(polygons, len(points)):
        polygons = _turned(points, polygons)
    later = [polygons[:, [0, i, i + 1]] for i in range(1, polygons.shape[1] - 1)]
    return np.stack(later, axis=1).reshape(-1, 3)


def strip_triangles(strips: NDArray[Any]) -> NDArray[Any]:
    """Triangles of strips of equal length, shape (k (m - 2), 3) from (k, m), wound alike."""
    start = np.arange(strips.shape[1] - 2)
    odd = start % 2  # every other triangle would be wound the other way
    return np.asarray(strips[:, np.stack([start + odd, start + 1 - odd, start + 2], 1)]).reshape(
        -1, 3
    )


def _within(polygons: NDArray[Any], count: int) -> bool:
    """Whether the nodes exist; missing ones are refused elsewhere."""
    return bool(polygons.min() >= 0 and polygons.max() < count)


def _turned(points: FloatArray, polygons: NDArray[Any]) -> NDArray[Any]:
    """Polygons starting at the corner with the best fan, the first if its fan does not fold."""
    with np.errstate(all="ignore"):  # places that are no numbers are refused elsewhere
        corner = points[polygons]
        corner = corner - corner.mean(axis=1, keepdims=True)
        area = np.cross(corner, np.roll(corner, -1, axis=1)).sum(axis=1)
        start = np.zeros(len(polygons), dtype=np.int64)
        folded = np.flatnonzero(_fan_margin(corner, area, 0) < 0)
        margins = [_fan_margin(corner[folded], area[folded], k) for k in range(polygons.shape[1])]
    start[folded] = np.argmax(margins, axis=0)
    columns = (start[:, None] + np.arange(polygons.shape[1])) % polygons.shape[1]
    return np.take_along_axis(polygons, columns, axis=1)


def _fan_margin(corner: FloatArray, area: FloatArray, first: int) -> FloatArray:
    """Smallest component along the area vector of the triangles around one corner.

    Negative if a triangle of the fan is oriented against the polygon as a whole.
    """
    spokes = np.roll(corner, -first, axis=1)[:, 1:] - corner[:, first : first + 1]
    triangles = np.cross(spokes[:, :-1], spokes[:, 1:])
    return np.asarray(np.einsum("kid,kd->ki", triangles, area).min(axis=1))


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
