"""Gmsh files of format 4.1, text and binary."""

from __future__ import annotations

import re
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from study.mesh.gmsh import CELLS, node_rows
from study.mesh.kinds import FloatArray, MeshError
from study.mesh.numerals import read_numbers
from study.mesh.raw import Block, RawMesh, raw_mesh

_HEADER = re.compile(rb"^\$MeshFormat[ \t\r]*\n[ \t]*4\.1[ \t]+([01])[ \t]+([48])[^\n]*\n", re.M)


def is_gmsh_4(data: bytes) -> bool:
    """Whether these are Gmsh data of format 4.1."""
    return bool(_HEADER.search(data[:4096]))


def read_gmsh_4(data: bytes) -> RawMesh:
    """Nodes and elements of a Gmsh 4.1 file; node numbers may have gaps."""
    header = _HEADER.search(data[:4096])
    if header is None:
        raise MeshError("no $MeshFormat section of version 4.1")
    binary = header[1] == b"1"
    order = ">" if binary and data[header.end() : header.end() + 4] == b"\0\0\0\1" else "<"
    size = np.dtype(f"{order}u{int(header[2])}")
    numbers, points = _nodes(_section(data, b"Nodes"), size, binary)
    blocks = [
        (name, node_rows(rows, numbers))
        for name, rows in _elements(_section(data, b"Elements"), size, binary)
    ]
    return raw_mesh(points, blocks)


def _nodes(stream: BytesIO, size: np.dtype[Any], binary: bool) -> tuple[NDArray[Any], FloatArray]:
    numbers, places = [np.empty(0, dtype=size)], [np.empty((0, 3))]
    for _ in range(_block_count(stream, size, binary)):
        dimension, _, parametric, count = _block_header(stream, size, binary)
        columns = 3 + (dimension if parametric else 0)
        numbers.append(read_numbers(stream, size, count, binary))
        values = read_numbers(stream, size.byteorder + "f8", columns * count, binary)
        places.append(values.reshape(-1, columns)[:, :3])
    _expect_end(stream, b"$EndNodes")
    return np.concatenate(numbers).astype(float), np.concatenate(places)


def _elements(stream: BytesIO, size: np.dtype[Any], binary: bool) -> list[Block]:
    blocks = []
    for _ in range(_block_count(stream, size, binary)):
        _, _, kind, count = _block_header(stream, size, binary)
        if kind not in CELLS:
            raise MeshError(f"Gmsh element type {kind} cannot be read; export tetrahedra")
        name, nodes = CELLS[kind]
        rows = read_numbers(stream, size, (1 + nodes) * count, binary)
        blocks.append((name, rows.reshape(-1, 1 + nodes)[:, 1:].astype(np.int64)))
    _expect_end(stream, b"$EndElements")
    return blocks


def _section(data: bytes, name: bytes) -> BytesIO:
    start = re.search(rb"^\$" + name + rb"[ \t\r]*\n", data, re.MULTILINE)
    if start is None:
        raise MeshError(f"section ${name.decode()} missing: truncated, export it again")
    stream = BytesIO(data)
    stream.seek(start.end())
    return stream


def _block_count(stream: BytesIO, size: np.dtype[Any], binary: bool) -> int:
    """First of the four numbers that open a section."""
    return int(read_numbers(stream, size, 4, binary)[0])


def _block_header(stream: BytesIO, size: np.dtype[Any], binary: bool) -> tuple[int, int, int, int]:
    """Three small numbers and the number of rows; dimension and number of the entity first."""
    if binary:
        small = read_numbers(stream, size.byteorder + "i4", 3, binary).tolist()
        row_count = read_numbers(stream, size, 1, binary).tolist()
        first, second, third, count = small + row_count
    else:
        first, second, third, count = read_numbers(stream, np.int64, 4, binary).tolist()
    if count < 0 or not 0 <= first <= 3:
        raise MeshError(f"a block of {count} rows of dimension {first}: damaged, export it again")
    return first, second, third, count


def _expect_end(stream: BytesIO, keyword: bytes) -> None:
    line = stream.readline().strip() or stream.readline().strip()
    if line != keyword:
        raise MeshError(f"expected {keyword.decode()}: truncated or damaged, export it again")
