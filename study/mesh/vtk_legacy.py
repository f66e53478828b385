"""Legacy VTK files of unstructured grids and of surfaces, ASCII and binary."""

from __future__ import annotations

import re
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import IndexArray, MeshError
from study.mesh.numerals import read_numbers
from study.mesh.raw import RawMesh, raw_mesh
from study.mesh.text import whole_numbers
from study.mesh.vtk_cells import EMPTY, LINES, POINTS, POLYGON, STRIP, vtk_blocks

_MAX_COUNT = 200_000_000
_TYPES = {
    "char": "i1",
    "unsigned_char": "u1",
    "short": "i2",
    "unsigned_short": "u2",
    "int": "i4",
    "unsigned_int": "u4",
    "long": "i8",
    "unsigned_long": "u8",
    "vtkidtype": "i4",  # as its writer puts it
    "vtktypeint8": "i1",
    "vtktypeuint8": "u1",
    "vtktypeint16": "i2",
    "vtktypeuint16": "u2",
    "vtktypeint32": "i4",
    "vtktypeuint32": "u4",
    "vtktypeuint64": "u8",
    "vtktypeint64": "i8",
    "float": "f4",
    "double": "f8",
}
_SURFACE = {"VERTICES": POINTS, "LINES": LINES, "POLYGONS": POLYGON, "TRIANGLE_STRIPS": STRIP}
_ORDER = {kind: place for place, kind in enumerate(_SURFACE.values())}
_GHOST = re.compile(rb"^\s*vtkGhostType\s+1\s+(\d{1,9})\s+unsigned_char[ \t\r]*\n", re.MULTILINE)
_Cells = tuple[IndexArray, IndexArray, IndexArray]  # types, offsets and nodes


def read_vtk_legacy(data: bytes) -> RawMesh:
    """Points and cells of a legacy VTK file; attributes, which come after them, are not read.

    Raises
    ------
    MeshError
        If the file is damaged, of another kind, or holds fewer points or cells than announced.
    """
    stream = BytesIO(data)
    _check_version(stream.readline())
    stream.readline()  # title
    encoding = stream.readline().decode("latin-1").strip().upper()
    if encoding not in {"ASCII", "BINARY"}:
        raise MeshError(f"line 3: expected ASCII or BINARY, found `{encoding[:60]}`")
    return _read_sections(stream, binary=encoding == "BINARY")


def _check_version(line: bytes) -> None:
    if not re.match(rb"\s*#\s*vtk\s+DataFile\s+Version\b", line, re.IGNORECASE):
        raise MeshError("line 1: expected `# vtk DataFile Version`: not a legacy VTK file")


def _read_sections(stream: BytesIO, binary: bool) -> RawMesh:
    points = np.empty((0, 3))
    types: IndexArray | None = None
    cells: list[_Cells] = []
    while (words := _line(stream)) and words[0].upper() not in {"POINT_DATA", "CELL_DATA"}:
        section = words[0].upper()
        if section == "POINTS":
            if len(points):
                raise MeshError("a second section POINTS; keep one mesh in the file")
            numbers = _numbers(stream, _word(words, 2), 3 * _count(words, 1), binary)
            points = numbers.reshape(-1, 3).astype(float)
        elif section == "CELLS":
            offsets, nodes = _connectivity(stream, words, binary)
            cells.append((np.zeros(len(offsets) - 1, dtype=np.int64), offsets, nodes))
        elif section == "CELL_TYPES":
            types = _numbers(stream, "int", _count(words, 1), binary).astype(np.int64)
        elif section in _SURFACE:
            offsets, nodes = _connectivity(stream, words, binary)
            cells.append((np.full(len(offsets) - 1, _SURFACE[section]), offsets, nodes))
        elif section == "METADATA":
            _skip_to_blank_line(stream)
        elif section == "FIELD":
            _skip_field(stream, _count(words, 2), binary)
        elif section == "DATASET":
            _check_data_set(_word(words, 1).upper())
        else:
            raise MeshError(f"unknown VTK section `{section[:40]}`: damaged, export it again")
    shown, notes = _without_hidden(_typed(cells, types), _data(stream, words), binary)
    return raw_mesh(points, [b for part in shown for b in vtk_blocks(*part)], notes)


def _check_data_set(name: str) -> None:
    if name not in {"UNSTRUCTURED_GRID", "POLYDATA"}:
        raise MeshError(
            f"VTK data set {name[:40]}; only UNSTRUCTURED_GRID and POLYDATA can be read"
        )


def _typed(cells: list[_Cells], types: IndexArray | None) -> list[_Cells]:
    """Cells of a grid with their types, which have a section of their own."""
    count = sum(len(part[0]) for part in cells if not part[0].any())
    given = 0 if types is None else len(types)
    if count != given:
        raise MeshError(f"{count} CELLS but {given} CELL_TYPES: truncated, export it again")
    return [part if part[0].any() or types is None else (types, *part[1:]) for part in cells]


def _data(stream: BytesIO, words: list[str]) -> bytes:
    """What is stored of the cells: from the line CELL_DATA, if there is one, to POINT_DATA."""
    rest = stream.read()
    if words and words[0].upper() == "POINT_DATA":
        start = re.search(rb"^\s*CELL_DATA\s+\d+\s*$", rest, re.MULTILINE | re.IGNORECASE)
        rest = rest[start.end() :] if start else b""
    end = re.search(rb"^\s*POINT_DATA\s+\d+\s*$", rest, re.MULTILINE | re.IGNORECASE)
    return rest[: end.start()] if end else rest


def _without_hidden(
    cells: list[_Cells], data: bytes, binary: bool
) -> tuple[list[_Cells], list[str]]:
    """Cells of which those marked in the array vtkGhostType are empty, and a note on them."""
    mark = _GHOST.search(data)
    if mark is None:
        if b"vtkGhostType" in data:
            raise MeshError("cells are marked as ghosts or hidden; remove these, or save as .vtu")
        return cells, []
    stream = BytesIO(data)
    stream.seek(mark.end())
    hidden = read_numbers(stream, "u1", int(mark[1]), binary) != 0
    # VTK numbers vertices, lines, polygons and strips in this order, whatever that of the file.
    order = sorted(range(len(cells)), key=lambda i: _ORDER.get(int(cells[i][0].max(initial=0)), 0))
    ends = np.cumsum([len(cells[i][0]) for i in order])
    if not len(ends) or ends[-1] != len(hidden):
        raise MeshError(f"vtkGhostType marks {len(hidden)} cells, but there are others: damaged")
    parts = dict(zip(order, np.split(hidden, ends[:-1]), strict=True))
    shown = [(np.where(parts[i], EMPTY, part[0]), *part[1:]) for i, part in enumerate(cells)]
    count = int(hidden.sum())
    return shown, [f"{count} cells marked as ghosts or hidden left out"] if count else []


def _connectivity(stream: BytesIO, words: list[str], binary: bool) -> tuple[IndexArray, IndexArray]:
    """Offsets and nodes of cells, from either of the two layouts in use."""
    first, second = _count(words, 1), _count(words, 2)
    start = stream.tell()
    following = stream.readline().split()
    if following[:1] != [b"OFFSETS"]:  # before version 5: node count and nodes, cell after cell
        stream.seek(start)
        return _split_counted(_numbers(stream, "int", second, binary).astype(np.int64), first)
    # From version 5: where each cell starts, and where the last one ends; then the nodes.
    offsets = _numbers(stream, _word([w.decode("latin-1") for w in following], 1), first, binary)
    nodes = _numbers(stream, _word(_line(stream), 1), second, binary)
    starts = offsets if first else np.zeros(1)
    return whole_numbers(starts, "offsets of cells"), whole_numbers(nodes, "nodes of cells")


def _split_counted(numbers: IndexArray, count: int) -> tuple[IndexArray, IndexArray]:
    """Offsets and nodes from numbers in which every cell begins with its number of nodes."""
    flat, starts, place = numbers.tolist(), [], 0
    while place < len(flat) and flat[place] >= 0:
        starts.append(place)
        place += 1 + flat[place]
    if len(starts) != count or place != len(flat):
        raise MeshError(f"{count} cells are announced in {len(flat)} numbers, which do not fit")
    sizes = numbers[starts] if starts else np.empty(0, dtype=np.int64)
    return np.concatenate([[0], np.cumsum(sizes)]), np.delete(numbers, starts)


def _numbers(stream: BytesIO, kind: str, count: int, binary: bool) -> NDArray[Any]:
    """Next `count` numbers of a VTK type."""
    if kind.lower() not in _TYPES:
        raise MeshError(f"unknown VTK number type `{kind[:40]}`; known: {', '.join(_TYPES)}")
    return read_numbers(stream, ">" + _TYPES[kind.lower()], count, binary)


def _skip_to_blank_line(stream: BytesIO) -> None:
    while stream.readline().strip():
        pass


def _skip_field(stream: BytesIO, arrays: int, binary: bool) -> None:
    for _ in range(arrays):
        words = _line(stream)
        while words[:1] == ["METADATA"]:  # of the array before
            _skip_to_blank_line(stream)
            words = _line(stream)
        kind, count = _word(words, 3).lower(), _count(words, 1) * _count(words, 2)
        if kind in {"string", "unicode_string"}:
            _skip_strings(stream, count, binary)
        elif kind == "bit" and binary:
            _numbers(stream, "char", (count + 7) // 8, binary)
        else:
            _numbers(stream, "char" if kind == "bit" else kind, count, binary)


def _skip_strings(stream: BytesIO, count: int, binary: bool) -> None:
    """Strings have a line each, or follow their length, whose first two bits give its size."""
    for _ in range(min(count, stream.getbuffer().nbytes)):
        if binary:
            first = stream.read(1) or b"\0"
            rest = stream.read((8, 4, 2, 1)[first[0] >> 6] - 1)
            stream.seek(int.from_bytes(bytes([first[0] & 63]) + rest, "big"), 1)
        else:
            stream.readline()


def _line(stream: BytesIO) -> list[str]:
    """Words of the next line that is not blank; none at the end of the file."""
    for line in stream:
        if line.strip():
            return line.decode("latin-1").split()
    return []


def _count(words: list[str], column: int) -> int:
    word = _word(words, column)
    if not (word.isascii() and word.isdecimal()) or len(word) > 12:
        raise MeshError(f"section {words[0][:40]}: `{word[:40]}` is not a count")
    if int(word) > _MAX_COUNT:
        raise MeshError(f"{words[0][:40]} announces {int(word)} entries, the limit is {_MAX_COUNT}")
    return int(word)


def _word(words: list[str], column: int) -> str:
    if len(words) <= column:
        raise MeshError(f"incomplete line `{' '.join(words)[:60]}`: truncated, export it again")
    return words[column]
