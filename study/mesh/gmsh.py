"""Gmsh files: which format they have; formats 1 and 2 as text, format 2 binary."""

from __future__ import annotations

import re
from dataclasses import dataclass
from io import BytesIO

import numpy as np

from study.mesh.gmsh4 import Storage, read_gmsh_4
from study.mesh.gmsh_cells import CELLS, Section, cell_of, node_rows, section, sections
from study.mesh.kinds import MeshError
from study.mesh.numerals import read_numbers
from study.mesh.raw import Block, RawMesh, raw_mesh
from study.mesh.text import NumberedLine, floats, refuse_surplus, whole

_FORMAT = re.compile(rb"\s*(\d(?:\.\d+)?)[ \t]+([01])[ \t]+(\d+)[^\n]*\n")


@dataclass(frozen=True)
class _Layout:
    """What differs between the text formats."""

    nodes: str
    elements: str
    count_column: int
    """Column that tells how many words the row has."""
    fixed_columns: int
    """Words of a row in format 1 besides the nodes, in format 2 besides the tags and nodes."""


_FORMAT_1 = _Layout("NOD", "ELM", count_column=4, fixed_columns=5)
_FORMAT_2 = _Layout("Nodes", "Elements", count_column=2, fixed_columns=3)


def read_gmsh(data: bytes) -> RawMesh:
    """Nodes and elements of a Gmsh file of format 1, 2, 4.0 or 4.1; all other sections are ignored.

    Node numbers may have gaps, and the sections any order.

    Raises
    ------
    MeshError
        On another format, a section that is missing or cut off, an element type that is not known,
        and on nodes and elements that contradict each other.
    """
    found = sections(data)
    if "NOD" in found:
        return _read_text(data, found, _FORMAT_1)
    if "MeshFormat" not in found:
        raise MeshError("no $MeshFormat: not a Gmsh file of format 1, 2, 4.0 or 4.1, or truncated")
    header = _FORMAT.match(data, found["MeshFormat"].start)
    version = header[1].decode() if header else "unknown"
    if header is None or header[3] not in {b"4", b"8"}:
        raise MeshError("$MeshFormat is not followed by a version, 0 or 1, and a size of 4 or 8")
    binary = header[2] == b"1"
    order = ">" if binary and data[header.end() : header.end() + 4] == b"\0\0\0\1" else "<"
    if version in {"4", "4.0", "4.1"}:
        is_4_1 = version == "4.1"
        return read_gmsh_4(
            data, found, Storage(is_4_1, binary, order, int(header[3]) if is_4_1 else 8)
        )
    if not version.startswith("2"):
        raise MeshError(f"Gmsh format {version}; save it as format 2.2 or 4.1")
    return _read_binary(data, found, order) if binary else _read_text(data, found, _FORMAT_2)


# ---- Text --------------------------------------------------------------------------------------


def _read_text(data: bytes, found: dict[str, Section], layout: _Layout) -> RawMesh:
    rows = _lines(data, found, layout.nodes)
    refuse_surplus(rows, 4, "a node, with its number,")
    nodes = floats(rows, 4)
    elements = _lines(data, found, layout.elements)
    blocks = [(name, node_rows(rows, nodes[:, 0])) for name, rows in _blocks(elements, layout)]
    return raw_mesh(nodes[:, 1:], blocks)


def _lines(data: bytes, found: dict[str, Section], name: str) -> list[NumberedLine]:
    """Lines of a section after its count, which must agree with their number."""
    place = section(found, name)
    first = data.count(b"\n", 0, place.start) + 1
    text = data[place.start : place.end].decode("latin-1")
    lines = [(i, line.split()) for i, line in enumerate(text.split("\n"), start=first)]
    lines = [(i, words) for i, words in lines if words]
    announced = " ".join(lines[0][1]) if lines else "nothing"
    if announced != str(len(lines) - 1):
        raise MeshError(
            f"line {first}: section ${name} announces {announced[:40]} rows "
            f"but has {max(len(lines) - 1, 0)}"
        )
    return lines[1:]


def _blocks(lines: list[NumberedLine], layout: _Layout) -> list[Block]:
    by_type: dict[int, list[list[int]]] = {}
    for number, words in lines:
        kind, nodes = _element(number, words, layout)
        by_type.setdefault(kind, []).append(nodes)
    return [(CELLS[kind][0], np.array(rows)) for kind, rows in by_type.items()]


def _element(number: int, words: list[str], layout: _Layout) -> tuple[int, list[int]]:
    try:
        row = [whole(word) for word in words]
        kind, variable = row[1], row[layout.count_column]
    except (ValueError, IndexError):
        raise MeshError(f"line {number}: not an element: `{' '.join(words)[:60]}`") from None
    if kind not in CELLS:
        raise MeshError(f"line {number}: Gmsh element type {kind} is not known; export tetrahedra")
    first = layout.fixed_columns + (variable if layout is _FORMAT_2 else 0)
    expected = CELLS[kind][1]
    if len(row) != first + expected or (layout is _FORMAT_1 and variable != expected):
        raise MeshError(
            f"line {number}: element of type {kind} needs {expected} nodes in {first + expected} "
            f"columns, found {len(row)} columns"
        )
    return kind, row[first:]


# ---- Binary ------------------------------------------------------------------------------------


def _read_binary(data: bytes, found: dict[str, Section], order: str) -> RawMesh:
    node = np.dtype([("number", f"{order}i4"), ("place", f"{order}f8", 3)])
    stream, count = _counted(data, found, "Nodes")
    nodes = read_numbers(stream, node, count, binary=True)
    _expect_end(stream, "Nodes")
    blocks = [
        (name, node_rows(rows, nodes["number"]))
        for name, rows in _binary_blocks(*_counted(data, found, "Elements"), f"{order}i4")
    ]
    return raw_mesh(nodes["place"], blocks)


def _binary_blocks(stream: BytesIO, count: int, integer: str) -> list[Block]:
    """Blocks of elements, each under a type, a number of elements and one of tags."""
    by_type: dict[str, list[np.ndarray[tuple[int, ...], np.dtype[np.int64]]]] = {}
    left = count
    while left > 0:
        kind, rows, tags = read_numbers(stream, integer, 3, binary=True).tolist()
        name, nodes = cell_of(kind)
        if not 0 < rows <= left or tags < 0:
            raise MeshError(f"$Elements: {rows} elements with {tags} tags: damaged file")
        columns = 1 + tags + nodes
        found = read_numbers(stream, integer, rows * columns, binary=True).reshape(rows, columns)
        by_type.setdefault(name, []).append(found[:, 1 + tags :].astype(np.int64))
        left -= rows
    _expect_end(stream, "Elements")
    return [(name, np.concatenate(parts)) for name, parts in by_type.items()]


def _counted(data: bytes, found: dict[str, Section], name: str) -> tuple[BytesIO, int]:
    """What follows the count of a section, and the count."""
    stream = BytesIO(data)
    stream.seek(section(found, name).start)
    word = stream.readline().strip()
    if not word.isdigit() or len(word) > 18:
        raise MeshError(f"${name} is not followed by a count")
    return stream, int(word)


def _expect_end(stream: BytesIO, name: str) -> None:
    line = stream.readline().strip() or stream.readline().strip()
    if line != b"$End" + name.encode():
        raise MeshError(f"${name} has another length than announced: damaged, export it again")
