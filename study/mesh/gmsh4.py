"""Gmsh files of formats 4.0 and 4.1, text and binary."""

from __future__ import annotations

from io import BytesIO
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from study.mesh.gmsh_cells import Section, cell_of, node_rows, section
from study.mesh.kinds import FloatArray, MeshError
from study.mesh.numerals import read_numbers
from study.mesh.raw import Block, RawMesh, raw_mesh

Numbers = NDArray[Any]


class Storage(NamedTuple):
    """How the numbers of a file are stored."""

    is_4_1: bool
    binary: bool
    order: str
    """`<` or `>`, as in NumPy."""
    size: int
    """Bytes of a count and, in format 4.1, of a node or element number."""

    @property
    def count_type(self) -> str:
        """Type of counts."""
        return f"{self.order}u{self.size}"

    @property
    def tag_type(self) -> str:
        """Type of node and element numbers."""
        return self.count_type if self.is_4_1 else f"{self.order}i4"


class _Reader(NamedTuple):
    """A section that is being read."""

    stream: BytesIO
    name: str
    storage: Storage

    def take(self, dtype: str, count: int) -> Numbers:
        """Next numbers; a refusal names the section and, in a text, the line."""
        try:
            return read_numbers(self.stream, dtype, count, self.storage.binary)
        except MeshError as error:
            lines = self.stream.getvalue()[: self.stream.tell()].count(b"\n")
            where = "" if self.storage.binary else f", line {lines}"
            raise MeshError(f"section ${self.name}{where}: {error}") from None


def read_gmsh_4(data: bytes, found: dict[str, Section], storage: Storage) -> RawMesh:
    """Nodes and elements of a file of format 4.0 or 4.1; node numbers may have gaps."""
    numbers, points = _nodes(_opened(data, found, "Nodes", storage))
    elements = _elements(_opened(data, found, "Elements", storage))
    return raw_mesh(points, [(name, node_rows(rows, numbers)) for name, rows in elements])


def _opened(data: bytes, found: dict[str, Section], name: str, storage: Storage) -> _Reader:
    stream = BytesIO(data)
    stream.seek(section(found, name).start)
    return _Reader(stream, name, storage)


def _nodes(reader: _Reader) -> tuple[Numbers, FloatArray]:
    numbers, places = [np.empty(0)], [np.empty((0, 3))]
    blocks, announced = _counts(reader)
    for _ in range(blocks):
        dimension, parametric, count = _block_header(reader)
        columns = 3 + (dimension if parametric else 0)
        tags, values = (_tags_then_places if reader.storage.is_4_1 else _rows)(
            reader, count, columns
        )
        numbers.append(tags)
        places.append(values[:, :3])
    found = np.concatenate(numbers)
    _finish(reader, announced, len(found))
    return found, np.concatenate(places)


def _tags_then_places(reader: _Reader, count: int, columns: int) -> tuple[Numbers, FloatArray]:
    tags = reader.take(reader.storage.tag_type, count).astype(float)
    values = reader.take(f"{reader.storage.order}f8", columns * count)
    return tags, values.reshape(-1, columns).astype(float)


def _rows(reader: _Reader, count: int, columns: int) -> tuple[Numbers, FloatArray]:
    """Format 4.0 has the number of every node before its place."""
    order = reader.storage.order
    if not reader.storage.binary:
        rows = reader.take(f"{order}f8", (1 + columns) * count).reshape(-1, 1 + columns)
        return rows[:, 0].astype(float), rows[:, 1:].astype(float)
    row_size = 4 + 8 * columns
    raw = reader.take("u1", row_size * count).reshape(-1, row_size)
    tags = np.ascontiguousarray(raw[:, :4]).view(f"{order}i4")
    places = np.ascontiguousarray(raw[:, 4:]).view(f"{order}f8")
    return tags.ravel().astype(float), places.astype(float)


def _elements(reader: _Reader) -> list[Block]:
    found: list[Block] = []
    blocks, announced = _counts(reader)
    for _ in range(blocks):
        _, kind, count = _block_header(reader)
        name, nodes = cell_of(kind)
        rows = reader.take(reader.storage.tag_type, (1 + nodes) * count).reshape(-1, 1 + nodes)
        found.append((name, rows[:, 1:].astype(np.int64)))
    _finish(reader, announced, sum(len(rows) for _, rows in found))
    return found


def _counts(reader: _Reader) -> tuple[int, int]:
    """Number of blocks and of rows in all of them; format 4.1 goes on with the range of numbers."""
    found = reader.take(reader.storage.count_type, 4 if reader.storage.is_4_1 else 2).tolist()
    return int(found[0]), int(found[1])


def _block_header(reader: _Reader) -> tuple[int, int, int]:
    """Dimension of the entity, what distinguishes the block, and its number of rows."""
    storage = reader.storage
    if storage.binary:
        small = reader.take(f"{storage.order}i4", 3).tolist()
        first, second, third, count = small + reader.take(storage.count_type, 1).tolist()
    else:
        first, second, third, count = reader.take("i8", 4).tolist()
    dimension = first if storage.is_4_1 else second  # the other one is the entity's number
    if count < 0 or not 0 <= dimension <= 3:
        raise MeshError(f"a block of {count} rows of dimension {dimension}: damaged file")
    return dimension, third, count


def _finish(reader: _Reader, announced: int, found: int) -> None:
    """The section has to end, after the number of rows that its first line announces."""
    line = reader.stream.readline().strip() or reader.stream.readline().strip()
    if line != b"$End" + reader.name.encode():
        raise MeshError(f"expected $End{reader.name}: truncated or damaged, export it again")
    if announced != found:
        raise MeshError(f"section ${reader.name} announces {announced} rows but has {found}")
