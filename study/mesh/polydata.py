"""Legacy VTK files with the data set POLYDATA, ASCII and binary."""

from __future__ import annotations

from io import BytesIO
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import IndexArray, MeshError
from study.mesh.numerals import read_numbers
from study.mesh.raw import Block, RawMesh, by_corner_count, raw_mesh

_TYPES = {
    "char": "i1",
    "unsigned_char": "u1",
    "short": "i2",
    "unsigned_short": "u2",
    "int": "i4",
    "unsigned_int": "u4",
    "long": "i8",
    "unsigned_long": "u8",
    "vtktypeint32": "i4",
    "vtktypeint64": "i8",
    "float": "f4",
    "double": "f8",
}
_CELLS = {"VERTICES", "LINES", "POLYGONS", "TRIANGLE_STRIPS"}


def read_polydata(data: bytes) -> RawMesh:
    """Polygons of a legacy VTK POLYDATA file; lines, vertices and attributes are ignored."""
    stream = BytesIO(data)
    stream.readline()  # version
    stream.readline()  # title
    encoding = stream.readline().decode("latin-1").strip().upper()
    if encoding not in {"ASCII", "BINARY"}:
        raise MeshError(f"line 3: expected ASCII or BINARY, found `{encoding[:60]}`")
    return _read_sections(stream, binary=encoding == "BINARY")


def _read_sections(stream: BytesIO, binary: bool) -> RawMesh:
    points = np.empty((0, 3))
    blocks: list[Block] = []
    while (words := _line(stream)) and words[0].upper() not in {"POINT_DATA", "CELL_DATA"}:
        section = words[0].upper()
        if section == "POINTS":
            numbers = _numbers(stream, _word(words, 2), 3 * _count(words, 1), binary)
            points = numbers.reshape(-1, 3).astype(float)
        elif section in _CELLS:
            blocks += _faces(section, _connectivity(stream, words, binary))
        elif section == "METADATA":
            _skip_to_blank_line(stream)
        elif section == "FIELD":
            _skip_field(stream, _count(words, 2), binary)
        elif section != "DATASET":
            raise MeshError(f"unknown VTK section `{section[:40]}`: damaged, export it again")
    return raw_mesh(points, blocks)


def _faces(section: str, cells: list[list[int]]) -> list[Block]:
    if section == "TRIANGLE_STRIPS" and cells:
        raise MeshError(f"{len(cells)} triangle strips; export the surface as single triangles")
    return by_corner_count(cells) if section == "POLYGONS" else []


def _connectivity(stream: BytesIO, words: list[str], binary: bool) -> list[list[int]]:
    """Node numbers of each cell, from either of the two layouts in use."""
    first, second = _count(words, 1), _count(words, 2)
    start = stream.tell()
    following = stream.readline().split()
    if following[:1] != [b"OFFSETS"]:  # before version 5: node count and nodes, cell after cell
        stream.seek(start)
        return _split_counted(_numbers(stream, "int", second, binary), first)
    # From version 5: where each cell starts, and where the last one ends; then the nodes.
    offsets = _numbers(stream, _word([w.decode("latin-1") for w in following], 1), first, binary)
    nodes = _numbers(stream, _word(_line(stream), 1), second, binary)
    return _split(nodes, offsets.astype(np.int64))


def _split(nodes: NDArray[Any], offsets: IndexArray) -> list[list[int]]:
    if len(offsets) == 0:
        return []
    if offsets[0] != 0 or offsets[-1] != len(nodes) or np.any(np.diff(offsets) < 1):
        raise MeshError("OFFSETS do not fit CONNECTIVITY: damaged, export it again")
    flat, bounds = nodes.tolist(), offsets.tolist()
    return [flat[a:b] for a, b in pairwise(bounds)]


def _split_counted(numbers: NDArray[Any], count: int) -> list[list[int]]:
    flat, cells, place = numbers.tolist(), [], 0
    while place < len(flat) and flat[place] > 0:
        cells.append(flat[place + 1 : place + 1 + flat[place]])
        place += 1 + flat[place]
    if len(cells) != count or place != len(flat):
        raise MeshError(f"{count} cells are announced in {len(flat)} numbers, which do not fit")
    return cells


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
        _numbers(stream, _word(words, 3), _count(words, 1) * _count(words, 2), binary)


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
    return int(word)


def _word(words: list[str], column: int) -> str:
    if len(words) <= column:
        raise MeshError(f"incomplete line `{' '.join(words)[:60]}`: truncated, export it again")
    return words[column]
