"""PLY files, the Stanford polygon format: ASCII and binary of either byte order."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain, pairwise
from struct import unpack_from
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import FloatArray, MeshError
from study.mesh.raw import Block, RawMesh, by_corner_count, raw_mesh, strip_triangles
from study.mesh.text import is_number, text_lines, unit_note, whole

_TYPES = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "float": "f4",
    "double": "f8",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "int64": "i8",
    "uint64": "u8",
    "float32": "f4",
    "float64": "f8",
}
_LETTERS = {  # of the same types in the module struct, which is quick for single numbers
    **{"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I"},
    **{"i8": "q", "u8": "Q", "f4": "f", "f8": "d"},
}
_ORDERS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
_INDICES = ("vertex_indices", "vertex_index")  # both names are in use
_HEADER = re.compile(rb"\A\s*ply\s*?[\r\n].*?^[ \t]*end_header[ \t]*(\r\n|\r|\n)", re.S | re.M)
Values = Sequence[Any] | NDArray[Any]
"""A property of all rows of an element: a number each, or a list of numbers each."""


class _Property(NamedTuple):
    name: str
    dtype: np.dtype[Any]
    length: np.dtype[Any] | None
    """Of the number of entries, if it is a list."""


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    line: int
    properties: tuple[_Property, ...] = ()


def read_ply(data: bytes) -> RawMesh:
    """Positions, faces and triangle strips of a PLY file, whatever else their elements have.

    Raises
    ------
    MeshError
        Naming the line of a header that cannot be read, and if the file is truncated, has no
        positions or faces, or has cells of another kind.
    """
    header = _HEADER.match(data.replace(b"\r", b"\n") if b"\n" not in data[:64] else data)
    if header is None:
        raise MeshError("no `ply` or no `end_header`: truncated, or not a PLY file")
    lines = text_lines(header[0])
    form, elements = _elements(lines)
    body = data[header.end() :]
    if form == "ascii":
        body = _doubles(body)
    found, rest = _bodies(body, elements)
    notes = unit_note("\n".join(line for line in lines if line.split()[:1] == ["comment"]))
    if form == "ascii" and rest:
        raise MeshError(f"{rest // 8} more numbers than announced; export the file again")
    if rest:
        notes.append(f"{rest} bytes after the last element ignored")
    return raw_mesh(_positions(elements, found), _faces(elements, found), notes)


# ---- Header ------------------------------------------------------------------------------------


def _elements(lines: list[str]) -> tuple[str, list[_Element]]:
    """Form of the body, and what it holds."""
    form = ""
    elements: list[_Element] = []
    for number, line in enumerate(lines, start=1):
        words = line.split()
        if words in ([], ["ply"]):
            continue
        try:
            if len(words) > _header_words(words):
                raise MeshError(_unreadable(number, line))
            if words[0] == "format":
                form = words[1]
            elif words[0] == "element":
                elements.append(_Element(words[1], whole(words[2]), number))
            elif words[0] == "property":
                old = elements[-1]
                given = (*old.properties, _property(words[1:], form))
                elements[-1] = _Element(old.name, old.count, old.line, given)
            elif words[0] not in {"comment", "obj_info", "end_header"}:
                raise MeshError(_unreadable(number, line))
        except (ValueError, KeyError, IndexError) as error:
            raise MeshError(_unreadable(number, line)) from error
    if form not in _ORDERS:
        raise MeshError(f"format `{form[:40]}` is not one of {', '.join(_ORDERS)}")
    _check_elements(elements)
    return form, elements


def _header_words(words: list[str]) -> int:
    """Most words that a line of the header may have; a comment has any number."""
    if words[0] == "property":
        return 5 if words[1:2] == ["list"] else 3
    return 3 if words[0] in {"format", "element"} else len(words)


def _unreadable(number: int, line: str) -> str:
    return f"line {number}: cannot read `{line.strip()[:60]}`; export the file again"


def _property(words: list[str], form: str) -> _Property:
    """A number or a list; in text all of them are read as doubles."""
    listed = words[0] == "list"
    kinds = words[1:3] if listed else words[:1]
    names = ["f8" if form == "ascii" else _TYPES[kind] for kind in kinds if _TYPES[kind]]
    dtypes = [np.dtype(_ORDERS[form] + name) for name in names]
    return _Property(words[len(kinds) + listed], dtypes[-1], dtypes[0] if listed else None)


def _check_elements(elements: list[_Element]) -> None:
    names = [element.name for element in elements]
    for element in elements:
        if element.count < 0 or names.count(element.name) > 1:
            raise MeshError(f"line {element.line}: element {element.name[:40]} makes no sense")
        indices = any(entry.name in _INDICES for entry in element.properties)
        known = element.name in {"vertex", "face", "tristrips", "edge"}
        if element.count and (element.name == "range_grid" or (indices and not known)):
            raise MeshError(
                f"line {element.line}: element {element.name[:40]} holds cells that cannot be "
                "read; export faces"
            )


# ---- Body --------------------------------------------------------------------------------------


def _doubles(body: bytes) -> bytes:
    """The numbers of a text as the bytes of doubles, to be read like the binary form."""
    words = body.split()
    if b"_" in body:  # Python reads 1_0 as 10, which no mesh file means
        raise MeshError(_not_a_number(words))
    try:
        return np.array(words, dtype=bytes).astype(float).tobytes() if words else b""
    except ValueError:
        raise MeshError(_not_a_number(words)) from None


def _not_a_number(words: list[bytes]) -> str:
    place, word = next((i, one) for i, one in enumerate(words) if not is_number(one))
    return f"`{word.decode('latin-1')[:40]}`, word {place} (0-based) of the body, is no number"


def _bodies(body: bytes, elements: list[_Element]) -> tuple[dict[str, list[Values]], int]:
    """Every property of every element by the element's name, and the number of bytes left."""
    start = 0
    found: dict[str, list[Values]] = {}
    for element in elements:
        alike = _rows_alike(body, start, element)
        found[element.name], start = alike or _rows_one_by_one(body, start, element)
    return found, len(body) - start


def _rows_alike(body: bytes, start: int, element: _Element) -> tuple[list[Values], int] | None:
    """All rows at once, if all lists are as long as those of the first row."""
    if not element.count or not element.properties:
        return [[] for _ in element.properties], start
    first, _ = _row(body, start, element, 0)
    fields: list[tuple[Any, ...]] = []
    for i, (entry, value) in enumerate(zip(element.properties, first, strict=True)):
        if entry.length is None:
            fields.append((f"value {i}", entry.dtype))
        else:
            fields += [(f"count {i}", entry.length), (f"value {i}", entry.dtype, (len(value),))]
    record = np.dtype(fields)
    if record.itemsize * element.count > len(body) - start:
        return None
    rows = np.frombuffer(body, record, element.count, start)
    names = [name for name in record.names or () if name.startswith("count")]
    if any(np.any(rows[name] != rows[name][0]) for name in names):
        return None
    values: list[Values] = [rows[f"value {i}"] for i in range(len(element.properties))]
    return values, start + record.itemsize * element.count


def _rows_one_by_one(body: bytes, start: int, element: _Element) -> tuple[list[Values], int]:
    rows = []
    for number in range(element.count):
        row, start = _row(body, start, element, number)
        rows.append(row)
    return [list(values) for values in zip(*rows, strict=True)], start


def _row(body: bytes, start: int, element: _Element, number: int) -> tuple[list[Any], int]:
    row: list[Any] = []
    for entry in element.properties:
        count = 1
        if entry.length is not None:
            (length,), start = _take(body, start, entry.length, 1, element, number)
            count = _list_length(length, element, number)
        values, start = _take(body, start, entry.dtype, count, element, number)
        row.append(values if entry.length is not None else values[0])
    return row, start


def _list_length(value: float, element: _Element, number: int) -> int:
    if not (value >= 0 and value == int(value)):
        raise MeshError(f"row {number} (0-based) of element {element.name}: a list of {value:g}")
    return int(value)


def _take(
    body: bytes, start: int, dtype: np.dtype[Any], count: int, element: _Element, number: int
) -> tuple[tuple[Any, ...], int]:
    end = start + count * dtype.itemsize
    if end > len(body):
        raise MeshError(
            f"{element.count} rows of element {element.name[:40]} are announced, but row {number} "
            "(0-based) is cut off: truncated, export it again"
        )
    order = ">" if dtype.byteorder == ">" else "<" if dtype.byteorder == "<" else "="
    return unpack_from(f"{order}{count}{_LETTERS[dtype.str[1:]]}", body, start), end


# ---- Meaning -----------------------------------------------------------------------------------


def _positions(elements: list[_Element], found: dict[str, list[Values]]) -> FloatArray:
    columns = [_values(elements, found, "vertex", (axis,), listed=False) for axis in "xyz"]
    return np.stack([np.asarray(column, dtype=float) for column in columns], axis=1)


def _faces(elements: list[_Element], found: dict[str, list[Values]]) -> list[Block]:
    blocks: list[Block] = []
    if found.get("face"):
        blocks += _polygons(_values(elements, found, "face", _INDICES, listed=True))
    if found.get("tristrips"):
        for strip in _values(elements, found, "tristrips", _INDICES, listed=True):
            blocks += _strips(_whole(np.asarray(strip)))
    return blocks


def _values(
    elements: list[_Element],
    found: dict[str, list[Values]],
    name: str,
    properties: tuple[str, ...],
    listed: bool,
) -> Values:
    element = next((one for one in elements if one.name == name), _Element(name, 0, 0))
    for entry, values in zip(element.properties, found.get(name, []), strict=True):
        if entry.name in properties and (entry.length is not None) == listed:
            return values
    raise MeshError(f"element {name} has no {'list' if listed else 'number'} {properties[0]}")


def _polygons(faces: Values) -> list[Block]:
    if isinstance(faces, np.ndarray) and faces.ndim == 2:
        return [("triangle" if faces.shape[1] == 3 else "polygon", _whole(faces))]
    _whole(np.fromiter(chain.from_iterable(faces), dtype=float))
    return by_corner_count(list(faces))


def _whole(nodes: NDArray[Any]) -> NDArray[np.int64]:
    with np.errstate(invalid="ignore"):
        whole = nodes.astype(np.int64)
    if np.any(whole != nodes):
        raise MeshError("a face has a node number that is not whole: damaged, export it again")
    return whole


def _strips(nodes: NDArray[np.int64]) -> list[Block]:
    """Triangles of strips one after the other, each ended by -1."""
    bounds = [-1, *np.flatnonzero(nodes == -1).tolist(), len(nodes)]
    strips = [nodes[a + 1 : b] for a, b in pairwise(bounds) if b - a > 3]
    return [("triangle", strip_triangles(strip[None])) for strip in strips]
