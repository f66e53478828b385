"""What all Gmsh formats share: sections, element types and node numbers with gaps."""

from __future__ import annotations

import re
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import IndexArray, MeshError

_NODES = {
    "line": {1: 2, 8: 3, 26: 4, 27: 5, 28: 6, 62: 7, 63: 8, 64: 9, 65: 10, 66: 11},
    "triangle": {2: 3, 9: 6, 20: 9, 21: 10, 22: 12, 23: 15, 24: 15, 25: 21, 42: 28, 43: 36},
    "quad": {3: 4, 10: 9, 16: 8, 36: 16, 37: 25, 38: 36, 39: 12, 40: 16, 41: 20},
    "tetra": {4: 4, 11: 10, 29: 20, 30: 35, 31: 56, 71: 84, 72: 120},
    "hexahedron": {5: 8, 12: 27, 17: 20, 92: 64, 93: 125},
    "wedge": {6: 6, 13: 18, 18: 15, 90: 40, 91: 75},
    "pyramid": {7: 5, 14: 14, 19: 13, 118: 30, 119: 55},
    "vertex": {15: 1},
}
_LINEAR = {1, 2, 3, 4, 5, 6, 7, 15}
CELLS = {
    kind: (shape if kind in _LINEAR else f"{shape}{count}", count)
    for shape, counts in _NODES.items()
    for kind, count in counts.items()
}
"""Gmsh's element type number -> usual name and number of nodes, the corners first."""

_SECTION = re.compile(rb"^\$(?!End|END)(\w+)[ \t\r]*$", re.MULTILINE)


class Section(NamedTuple):
    """A part of a file between `$Name` and `$EndName`."""

    start: int
    """First byte of its content."""
    end: int
    """Where its last line begins."""


def sections(data: bytes) -> dict[str, Section]:
    """All sections by name; data may come several times, the mesh may not.

    Raises
    ------
    MeshError
        On a section that is not ended, and on a second one of nodes or elements.
    """
    found: dict[str, Section] = {}
    place = 0
    while start := _SECTION.search(data, place):
        name = start[1].decode("latin-1")
        end = re.compile(rb"\$(?:End|END)" + re.escape(start[1]) + rb"\b").search(data, start.end())
        line = data.count(b"\n", 0, start.start()) + 1
        if end is None:
            raise MeshError(
                f"line {line}: section ${name} ... $End{name} missing or cut off; export it again"
            )
        if name in found and name in {"Nodes", "Elements", "NOD", "ELM", "MeshFormat"}:
            raise MeshError(f"line {line}: a second section ${name}; keep one mesh in the file")
        found[name] = Section(start.end() + 1, end.start())
        place = end.end()
    return found


def section(found: dict[str, Section], name: str) -> Section:
    """The section of that name, which has to be there."""
    if name == "Nodes" and "ParametricNodes" in found:
        raise MeshError("$ParametricNodes is not read; save without parametric coordinates")
    if name not in found:
        raise MeshError(f"section ${name} ... $End{name} missing or cut off; export it again")
    return found[name]


def cell_of(kind: int) -> tuple[str, int]:
    """Name and number of nodes of an element type; MeshError on one that is not known."""
    if kind not in CELLS:
        raise MeshError(f"Gmsh element type {kind} cannot be read; export tetrahedra")
    return CELLS[kind]


def node_rows(rows: IndexArray, numbers: NDArray[Any]) -> IndexArray:
    """Row indices of the nodes with the given numbers."""
    order = np.argsort(numbers, kind="stable")
    ordered = numbers[order]
    repeated = np.flatnonzero(np.diff(ordered) == 0)
    if len(repeated):
        raise MeshError(f"node number {ordered[repeated[0]]:.0f} is given more than once")
    place = np.minimum(np.searchsorted(ordered, rows), len(ordered) - 1)
    unknown = rows[ordered[place] != rows] if len(ordered) else rows.ravel()
    if len(unknown):
        raise MeshError(f"an element uses node number {unknown[0]}, which is not in the file")
    return order[place]
