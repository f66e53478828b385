"""Cells of VTK's data model, by type number."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import IndexArray, MeshError
from study.mesh.raw import Block, strip_triangles

EMPTY = 0
"""VTK's number of an empty cell."""
POINTS, LINES, STRIP, POLYGON = 2, 4, 6, 7
"""VTK's numbers of the cells of a surface, each with any number of nodes."""


class _Cell(NamedTuple):
    """A cell type that can be read."""

    name: str
    nodes: int
    """Of every cell; 0 if they vary."""


_READ = {
    5: _Cell("triangle", 3),
    STRIP: _Cell("strip", 0),
    POLYGON: _Cell("polygon", 0),
    8: _Cell("pixel", 4),
    9: _Cell("quad", 4),
    10: _Cell("tetra", 4),
    22: _Cell("triangle6", 6),
    23: _Cell("quad8", 8),
    24: _Cell("tetra10", 10),
    28: _Cell("quad9", 9),
}
_TETRAHEDRA = (10, 24)
# Points and curves, of any order, with the number of nodes of those that have a fixed one.
_THIN = {EMPTY: None, 1: 1, 2: None, 3: 2, 4: None, 21: 3, 35: 4, 60: None, 68: None, 75: None}
_OTHER_FACES = {30, 34, 36, 61, 62, 63, 69, 70, 76, 77}
_OTHER_SOLIDS = {
    11: "voxel",
    12: "hexahedron",
    13: "wedge",
    14: "pyramid",
    25: "hexahedron20",
    26: "wedge15",
    27: "pyramid13",
    29: "hexahedron27",
    32: "wedge18",
    42: "polyhedron",
}


def vtk_blocks(types: IndexArray, offsets: IndexArray, nodes: IndexArray) -> list[Block]:
    """Blocks of cells from a type (c,) and an offset (c + 1,) each, and the nodes of all.

    Points and curves are left out, and beside tetrahedra the faces that cannot be read.

    Raises
    ------
    MeshError
        If offsets, types and nodes do not fit each other.
    """
    sizes = np.diff(offsets)
    if len(offsets) != len(types) + 1 or offsets[0] != 0 or offsets[-1] != len(nodes):
        raise MeshError("offsets do not fit the number of cells and nodes: damaged, export again")
    if np.any(sizes < 0):
        raise MeshError("offsets of cells decrease: damaged, export it again")
    solid = bool(np.isin(types, _TETRAHEDRA).any())
    blocks: list[Block] = []
    for kind in np.unique(types).tolist():
        chosen = np.flatnonzero(types == kind)
        _check_sizes(kind, sizes[chosen], chosen)
        if kind in _THIN or (solid and kind in _OTHER_FACES):
            continue
        for size in np.unique(sizes[chosen]).tolist():
            starts = offsets[chosen[sizes[chosen] == size]]
            blocks += _block(kind, nodes[starts[:, None] + np.arange(size)])
    return blocks


def _check_sizes(kind: int, sizes: IndexArray, cells: IndexArray) -> None:
    expected = _READ[kind].nodes if kind in _READ else _THIN.get(kind)
    least = 3 if kind in {STRIP, POLYGON} else 0
    wrong = cells[sizes != expected if expected else sizes < least]
    if len(wrong):
        raise MeshError(
            f"{len(wrong)} cells of VTK type {kind} do not have {expected or f'{least} or more'} "
            f"nodes; first cell (0-based) {wrong[0]}: damaged or truncated, export it again"
        )


def _block(kind: int, rows: NDArray[Any]) -> list[Block]:
    if kind not in _READ:
        return [(_OTHER_SOLIDS.get(kind, f"VTK type {kind}"), rows)]
    name = _READ[kind].name
    if name == "strip":
        return [("triangle", strip_triangles(rows))]
    if name == "pixel":  # its nodes run row by row, not round
        return [("quad", rows[:, [0, 1, 3, 2]])]
    return [("triangle" if rows.shape[1] == 3 else name, rows)]
