"""MEDIT files (Gamma Mesh Format), text and binary of versions 1 to 4."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import FloatArray, IndexArray, MeshError
from study.mesh.raw import Block, RawMesh, raw_mesh

_CELLS = {  # keyword in capitals: its code in binary files, usual name, number of nodes
    "TRIANGLES": (6, "triangle", 3),
    "TRIANGLESP2": (24, "triangle6", 6),
    "TRIANGLESP3": (90, "triangle10", 10),
    "TRIANGLESP4": (91, "triangle15", 15),
    "QUADRILATERALS": (7, "quad", 4),
    "QUADRILATERALSQ2": (27, "quad9", 9),
    "QUADRILATERALSQ3": (88, "quad16", 16),
    "QUADRILATERALSQ4": (89, "quad25", 25),
    "TETRAHEDRA": (8, "tetra", 4),
    "TETRAHEDRAP2": (30, "tetra10", 10),
    "TETRAHEDRAP3": (96, "tetra20", 20),
    "TETRAHEDRAP4": (97, "tetra35", 35),
    "PRISMS": (9, "wedge", 6),
    "PRISMSP2": (86, "wedge18", 18),
    "PRISMSP3": (102, "wedge40", 40),
    "PRISMSP4": (103, "wedge75", 75),
    "HEXAHEDRA": (10, "hexahedron", 8),
    "HEXAEDRA": (10, "hexahedron", 8),
    "HEXAHEDRAQ2": (33, "hexahedron27", 27),
    "HEXAHEDRAQ3": (98, "hexahedron64", 64),
    "HEXAHEDRAQ4": (99, "hexahedron125", 125),
    "PYRAMIDS": (49, "pyramid", 5),
    "PYRAMIDSP2": (87, "pyramid14", 14),
    "PYRAMIDSP3": (100, "pyramid30", 30),
    "PYRAMIDSP4": (101, "pyramid55", 55),
    "POLYHEDRA": (46, "polyhedron", 0),
}
_BY_CODE = {code: name for name, (code, _, _) in _CELLS.items()}
_VERTICES, _DIMENSION, _END = 4, 3, 54
_ORDERINGS = {129, 130, 143, 144, 131, 132, 145, 146, 133, 134, 147, 148}
_LAST_CODE = 198  # of the keywords that are known

# Keywords that neither make nor move nodes and cells that are used.
_HARMLESS = re.compile(
    r"(?:REQUIRED|EDGES|TANGENT|NORMAL|VERTICESON|VERTEXON|TRIANGLESON|QUADRILATERALSON|EDGEON"
    r"|EXTRAVERTICES|FAULT|SOLAT|ISOLAT|DSOLAT|HOSOLAT|PERIODIC|SUBDOMAIN|EQUIVALENT).*"
    r"|(?:EDGES|HEXAHEDRA|PRISMS|PYRAMIDS)\w\dORDERING|\w*REFERENCEELEMENT"
    r"|MESHVERSIONFORMATTED|END|CORNERS|RIDGES|ANGLEOFCORNERBOUND|BOUNDINGBOX|PRIVATETABLE"
    r"|ITERATIONS|TIME|COARSEHEXAHEDRA|BYTEFLOW|FLOATINGPOINTPRECISION|BEZIERBASIS|BOUNDARYLAYERS"
    r"|POLYGONS|RESERVED|DOMAIN"
)
_TEXTS = {"COMMENTS", "IDENTIFIER", "GEOMETRY", "IREFGROUPS", "DREFGROUPS"}
_KEYWORD = re.compile(r"^[ \t]*([A-Za-z_]\w*)", re.MULTILINE)
_COMMENT = re.compile(r"#[^\n]*")


class _Section(NamedTuple):
    """A keyword of a text file with what follows it."""

    line: int
    name: str
    """In capitals."""
    text: str


def read_medit(data: bytes) -> RawMesh:
    """Vertices and cells of a MEDIT file; references, normals, ridges and solutions are ignored.

    Raises
    ------
    MeshError
        On a keyword that is not known, on counts that do not fit, and on a file that is cut off.
    """
    if data[:4] in {b"\1\0\0\0", b"\0\0\0\1"}:
        return _read_binary(data)
    return _read_text(data.removeprefix(b"\xef\xbb\xbf").decode("latin-1"))


# ---- Text --------------------------------------------------------------------------------------


def _read_text(text: str) -> RawMesh:
    text = _COMMENT.sub("", re.sub(r"\r\n?", "\n", text))
    if not re.match(r"\s*MeshVersionFormatted\b", text, re.IGNORECASE):
        raise MeshError("does not begin with MeshVersionFormatted: not a MEDIT file")
    found = list(_sections(text))
    if found[-1].name != "END":
        raise MeshError("no `End` in the last line: truncated? If it is complete, add it")
    points, blocks = np.empty((0, 3)), list[Block]()
    for section in found:
        if section.name == "DIMENSION":
            _check_dimension(section.text.strip())
        elif section.name == "VERTICES":
            _check_first(f"line {section.line}", len(points))
            points = _table(section, 4)[:, :3]
        elif section.name in _CELLS:
            blocks.append(_block(section))
        elif section.name.endswith("ORDERING") and not _HARMLESS.fullmatch(section.name):
            raise MeshError(f"line {section.line}: {section.name} puts nodes in another order")
    return _mesh(points, blocks)


def _sections(text: str) -> Iterator[_Section]:
    """Keywords, each at the beginning of a line; free text stands after some of them."""
    starts = list(_KEYWORD.finditer(text))
    free = False
    line, place = 1, 0
    ends = [*(start.start() for start in starts[1:]), len(text)]
    for start, end in zip(starts, ends, strict=False):  # no keyword has no end
        name = start[1].upper()
        line += text.count("\n", place, start.start(1))
        place = start.start(1)
        known = _is_known(name)
        if not known and not free:
            raise MeshError(f"line {line}: {start[1][:40]} is not known and might hold cells")
        free = name in _TEXTS if known else free
        yield _Section(line, name, text[start.end() : end])


def _is_known(name: str) -> bool:
    return (
        name in _CELLS
        or name in _TEXTS
        or name in {"VERTICES", "DIMENSION"}
        or name.endswith("ORDERING")
        or bool(_HARMLESS.fullmatch(name))
    )


def _check_dimension(word: str) -> None:
    if word != "3":
        raise MeshError(f"Dimension {word[:40] or 'missing'}: only bodies in space can be used")


def _check_first(where: str, vertices: int) -> None:
    if vertices:
        raise MeshError(f"{where}: Vertices a second time; keep one mesh in the file")


def _block(section: _Section) -> Block:
    _, name, nodes = _CELLS[section.name]
    if name.startswith(("triangle", "quad", "tetra")):
        return name, _whole(section, _table(section, nodes + 1)[:, :-1])
    words = section.text.split(maxsplit=1)
    return name, np.empty((_count(section, words[0] if words else ""), 0))


def _whole(section: _Section, numbers: FloatArray) -> IndexArray:
    """0-based node numbers."""
    if np.any(numbers % 1 != 0) or np.any(numbers < 1):
        raise MeshError(f"line {section.line}: {section.name} has node numbers that are none")
    return numbers.astype(np.int64) - 1


def _table(section: _Section, columns: int) -> FloatArray:
    """Rows after their number, shape (n, columns); the last column is a reference."""
    words = section.text.upper().replace("D", "E").split()
    rows = _count(section, words[0] if words else "")
    if len(words) - 1 != rows * columns:
        raise MeshError(
            f"line {section.line}: {section.name} announces {rows} entries of {columns} numbers, "
            f"but {len(words) - 1} numbers follow: truncated or damaged"
        )
    if any("_" in word for word in words):  # Python reads 1_0 as 10, which no mesh file means
        word = next(word for word in words if "_" in word)
        raise MeshError(f"line {section.line}: {section.name}: `{word[:40]}` is no number")
    try:
        return np.array(words[1:], dtype=float).reshape(rows, columns)
    except ValueError as error:
        raise MeshError(f"line {section.line}: {section.name}: {error}") from None


def _count(section: _Section, word: str) -> int:
    if not (word.isascii() and word.isdigit()) or len(word) > 18:
        raise MeshError(
            f"line {section.line}: {section.name}: `{word[:40]}` is not a number of entries"
        )
    return int(word)


# ---- Binary ------------------------------------------------------------------------------------


class _Binary(NamedTuple):
    """A binary file and the types its version stores numbers in."""

    data: bytes
    order: str
    version: int

    def take(self, place: int, dtype: str, count: int) -> tuple[NDArray[Any], int]:
        """Numbers at a place, and the place after them."""
        kind = np.dtype(self.order + dtype)
        end = place + count * kind.itemsize
        if count < 0 or end > len(self.data):
            raise MeshError(f"{count} numbers are announced at byte {place}: truncated")
        return np.frombuffer(self.data, kind, count, place), end

    def one(self, place: int, dtype: str) -> tuple[int, int]:
        """An integer at a place, and the place after it."""
        found, end = self.take(place, dtype, 1)
        return int(found[0]), end


def _read_binary(data: bytes) -> RawMesh:
    order = "<" if data[0] == 1 else ">"
    version, place = _Binary(data, order, 1).one(4, "i4")
    if version not in {1, 2, 3, 4}:
        raise MeshError(f"MEDIT version {version}; save it as one of 1 to 4")
    file = _Binary(data, order, version)
    points, blocks = np.empty((0, 3)), list[Block]()
    for code, start in _walk(file, place):
        if code == _DIMENSION:
            _check_dimension(str(file.one(start, "i4")[0]))
        elif code == _VERTICES:
            _check_first(f"byte {start}", len(points))
            points = _places(file, start)
        elif code in _BY_CODE:
            blocks.append(_cells(file, start, *_CELLS[_BY_CODE[code]][1:]))
        elif code in _ORDERINGS or not 0 < code <= _LAST_CODE:
            raise MeshError(f"keyword {code} at byte {start} is not known and might hold cells")
    return _mesh(points, blocks)


def _walk(file: _Binary, place: int) -> Iterator[tuple[int, int]]:
    """Code of every keyword and where its content begins; each says where the next one is."""
    position = "i4" if file.version < 3 else "i8"
    while True:
        code, after = file.one(place, "i4")
        if code == _END:
            return
        following, start = file.one(after, position)
        if not start <= following <= len(file.data):
            raise MeshError(f"keyword {code} at byte {place} leads to byte {following}: truncated")
        yield code, start
        place = following


def _places(file: _Binary, start: int) -> FloatArray:
    integer, real = ("i8" if file.version > 3 else "i4"), ("f4" if file.version == 1 else "f8")
    count, first = file.one(start, integer)
    row = np.dtype([("place", file.order + real, 3), ("reference", file.order + integer)])
    found, _ = file.take(first, "u1", max(count, -1) * row.itemsize)
    return np.asarray(found.view(row)["place"].astype(float))


def _cells(file: _Binary, start: int, name: str, nodes: int) -> Block:
    integer = "i8" if file.version > 3 else "i4"
    count, first = file.one(start, integer)
    if not name.startswith(("triangle", "quad", "tetra")):
        return name, np.empty((max(count, 0), 0))
    found, _ = file.take(first, integer, count * (nodes + 1))
    return name, found.reshape(count, nodes + 1)[:, :-1].astype(np.int64) - 1


# ---- Both --------------------------------------------------------------------------------------


def _mesh(points: FloatArray, blocks: list[Block]) -> RawMesh:
    if not len(points):
        raise MeshError("no Vertices: truncated, or not a mesh")
    return raw_mesh(points, blocks)
