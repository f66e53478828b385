"""Gmsh text files of formats 1 and 2."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from study.mesh.kinds import IndexArray, MeshError
from study.mesh.raw import Block, RawMesh, raw_mesh
from study.mesh.text import NumberedLine, floats

CELLS = {
    1: ("line", 2),
    2: ("triangle", 3),
    3: ("quad", 4),
    4: ("tetra", 4),
    5: ("hexahedron", 8),
    6: ("wedge", 6),
    7: ("pyramid", 5),
    8: ("line3", 3),
    9: ("triangle6", 6),
    10: ("quad9", 9),
    11: ("tetra10", 10),
    12: ("hexahedron27", 27),
    13: ("wedge18", 18),
    14: ("pyramid14", 14),
    15: ("vertex", 1),
    16: ("quad8", 8),
    17: ("hexahedron20", 20),
    18: ("wedge15", 15),
    19: ("pyramid13", 13),
}
"""Gmsh's element type number -> usual name and number of nodes."""


@dataclass(frozen=True)
class _Layout:
    """What differs between the formats."""

    nodes: str
    end_nodes: str
    elements: str
    end_elements: str
    count_column: int
    """Column that tells how many words the row has."""
    fixed_columns: int
    """Words of a row in format 1 besides the nodes, in format 2 besides the tags and nodes."""


_FORMAT_1 = _Layout("NOD", "ENDNOD", "ELM", "ENDELM", count_column=4, fixed_columns=5)
_FORMAT_2 = _Layout("Nodes", "EndNodes", "Elements", "EndElements", count_column=2, fixed_columns=3)


def is_gmsh_text(data: bytes) -> bool:
    """Whether these are Gmsh data of format 1, or of format 2 as text."""
    version_2 = re.search(rb"^\$MeshFormat\s+2(?:\.\d+)?\s+0\s", data[:4096], re.MULTILINE)
    return bool(version_2) or bool(re.search(rb"^\$NOD\s*$", data, re.MULTILINE))


def read_gmsh(data: bytes) -> RawMesh:
    """Nodes and elements of a Gmsh 1 or 2 text file; node numbers may have gaps."""
    text = data.decode("latin-1")
    layout = _FORMAT_2 if "$MeshFormat" in text[:4096] else _FORMAT_1
    nodes = floats(_section(text, layout.nodes, layout.end_nodes), 4)
    elements = _section(text, layout.elements, layout.end_elements)
    blocks = [(name, node_rows(rows, nodes[:, 0])) for name, rows in _blocks(elements, layout)]
    return raw_mesh(nodes[:, 1:], blocks)


def _section(text: str, start: str, end: str) -> list[NumberedLine]:
    """Lines of a section after its count, which must agree with their number."""
    found = re.search(
        rf"^\${start}[ \t\r]*\n(.*?)^\${end}[ \t\r]*$", text, re.MULTILINE | re.DOTALL
    )
    if not found:
        raise MeshError(f"section ${start} ... ${end} missing or cut off; export it again")
    first = text.count("\n", 0, found.start(1)) + 1
    lines = [(i, line.split()) for i, line in enumerate(found[1].split("\n"), start=first)]
    lines = [(i, words) for i, words in lines if words]
    announced = " ".join(lines[0][1]) if lines else "nothing"
    if announced != str(len(lines) - 1):
        raise MeshError(
            f"line {first}: section ${start} announces {announced[:40]} rows "
            f"but has {max(len(lines) - 1, 0)}"
        )
    return lines[1:]


def _blocks(lines: list[NumberedLine], layout: _Layout) -> list[Block]:
    by_type: dict[int, list[list[int]]] = {}
    for number, words in lines:
        kind, nodes = _element(number, words, layout)
        by_type.setdefault(kind, []).append(nodes)
    return [(CELLS[kind][0], np.array(rows)) for kind, rows in by_type.items() if kind in CELLS]


def _element(number: int, words: list[str], layout: _Layout) -> tuple[int, list[int]]:
    try:
        row = [int(word) for word in words]
        kind, variable = row[1], row[layout.count_column]
    except (ValueError, IndexError):
        raise MeshError(f"line {number}: not an element: `{' '.join(words)[:60]}`") from None
    first = layout.fixed_columns + (variable if layout is _FORMAT_2 else 0)
    expected = CELLS[kind][1] if kind in CELLS else len(row) - first
    if len(row) != first + expected or (layout is _FORMAT_1 and variable != expected):
        raise MeshError(
            f"line {number}: element of type {kind} needs {expected} nodes in {first + expected} "
            f"columns, found {len(row)} columns"
        )
    return kind, row[first:]


def node_rows(
    rows: IndexArray, numbers: np.ndarray[tuple[int, ...], np.dtype[np.float64]]
) -> IndexArray:
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
