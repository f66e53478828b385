"""STL files, ASCII and binary."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator

import numpy as np

from study.mesh.kinds import FloatArray, MeshError
from study.mesh.raw import RawMesh, raw_mesh
from study.mesh.text import NumberedLine, floats, refuse_surplus, text_lines, unit_note

_HEADER = 84  # 80 bytes of anything, then the number of triangles
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_VERTEX = rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)\s+"
_NORMAL = rb"facet\s+normal\s+\S+\s+\S+\s+\S+\s+outer\s+loop\s+"
_FACET = re.compile(
    rb"\s*(?:" + _NORMAL + 3 * _VERTEX + rb"endloop\s+endfacet\b|(?:end)?solid\b[^\r\n]*)",
    re.IGNORECASE,
)
_KEYWORDS = {"facet", "outer", "vertex", "endloop", "endfacet"}


def read_stl(data: bytes) -> RawMesh:
    """Triangles of an STL file, three nodes each, of all its solids; normals are not used.

    Binary or ASCII is decided by size: the first word of a binary file may be `solid` too.

    Raises
    ------
    MeshError
        If the file is truncated, or the number of triangles is not the one announced.
    """
    announced = int(np.frombuffer(data, "<u4", 1, 80)[0]) if len(data) >= _HEADER else 0
    needed = _HEADER + _RECORD.itemsize * announced
    if announced and needed <= len(data):
        return _read_binary(data, announced, len(data) - needed)
    if re.match(rb"(\xef\xbb\xbf)?\s*solid\b", data, re.IGNORECASE) and re.search(
        rb"\bfacet\b", data, re.IGNORECASE
    ):
        return _read_ascii(data)
    raise MeshError(
        f"not a complete STL file: {len(data)} bytes, but the header announces {announced} "
        f"triangles, which need {needed}; export it again"
    )


def _read_binary(data: bytes, count: int, surplus: int) -> RawMesh:
    corners = np.frombuffer(data, _RECORD, count, _HEADER)["corners"].reshape(-1, 3)
    _refuse_more_triangles(data[len(data) - surplus :], count, corners)
    notes = unit_note(data[:80].decode("latin-1"))
    if surplus:
        notes.append(f"{surplus} bytes after the last triangle ignored")
    return raw_mesh(corners, [("triangle", np.arange(3 * count).reshape(-1, 3))], notes)


def _refuse_more_triangles(
    rest: bytes, count: int, corners: np.ndarray[tuple[int, ...], np.dtype[np.float32]]
) -> None:
    """Bytes after the last triangle are padding, unless they contain triangles of similar size."""
    later = np.frombuffer(rest, _RECORD, len(rest) // _RECORD.itemsize)
    low, high = corners.min(axis=0), corners.max(axis=0)
    with np.errstate(invalid="ignore", over="ignore"):
        inside = np.abs(later["corners"] - (low + high) / 2).max(axis=(1, 2)) <= 2 * np.ptp(
            corners, axis=0
        ).max(initial=0)
        distinct = np.ptp(later["corners"], axis=1).max(axis=1) > 0
    if len(later) and len(rest) % _RECORD.itemsize == 0 and np.all(inside & distinct):
        raise MeshError(
            f"the header announces {count} triangles, but {count + len(later)} are there; "
            "export it again"
        )
    if len(rest) > _HEADER:
        second = int(np.frombuffer(rest, "<u4", 1, 80)[0])
        if second and len(rest) == _HEADER + _RECORD.itemsize * second:
            raise MeshError(
                f"a second solid of {second} triangles follows the first one; export one surface"
            )


def _read_ascii(data: bytes) -> RawMesh:
    corners, notes = _plain_facets(data), list[str]()
    if corners is None:
        corners, notes = _corners_by_line(text_lines(data))
    notes = [*unit_note(text_lines(data[:1000])[0]), *notes]
    return raw_mesh(corners, [("triangle", np.arange(len(corners)).reshape(-1, 3))], notes)


def _plain_facets(data: bytes) -> FloatArray | None:
    """Corners of a file that consists of complete facets and solids only, else None.

    Much faster than parsing by lines, which finds out what is wrong.
    """
    place, solids, rows = 0, 0, []
    for found in _FACET.finditer(data):
        if found.start() != place:
            return None
        place = found.end()
        if found[1] is None:
            solids += -1 if found[0].lstrip()[:3].lower() == b"end" else 1
        else:
            rows.append(found.groups())
    if solids or data[place:].strip() or any(b"_" in word for row in rows for word in row):
        return None
    try:
        return np.array(rows, dtype=bytes).astype(float).reshape(-1, 3)
    except ValueError:
        return None


def _corners_by_line(lines: list[str]) -> tuple[FloatArray, list[str]]:
    """Corners, and notes on lines that are no part of a facet."""
    vertices: list[NumberedLine] = []
    counts: Counter[str] = Counter()
    for number, keyword, words in _statements(lines):
        counts[keyword] += 1
        if keyword == "vertex":
            vertices.append((number, words))
        elif keyword == "endfacet":
            _check_facet(number, counts)
    refuse_surplus(vertices, 3, "a vertex")
    corners = floats(vertices, 3)
    _check_ascii_end(counts)
    notes = [
        f"{count} lines `{word[:40]}`, unknown in STL, ignored"
        for word, count in counts.items()
        if word not in _KEYWORDS | {"solid", "endsolid"}
    ]
    return corners, notes


def _statements(lines: list[str]) -> Iterator[tuple[int, str, list[str]]]:
    """Line number, keyword in lower case and words after it; several may share one line."""
    for number, line in enumerate(lines, start=1):
        words = line.split()
        lowered = [word.lower() for word in words]
        if not words:
            continue
        starts = [i for i, word in enumerate(lowered) if word in _KEYWORDS]
        if lowered[0] in {"solid", "endsolid"} or not starts:
            starts = [0]
        for start, end in zip(starts, [*starts[1:], len(words)], strict=True):
            yield number, lowered[start], words[start + 1 : end]


def _check_facet(number: int, counts: Counter[str]) -> None:
    if counts["vertex"] != 3 * counts["endfacet"] or counts["facet"] != counts["endfacet"]:
        raise MeshError(f"line {number}: the facet that ends here does not have three vertices")


def _check_ascii_end(counts: Counter[str]) -> None:
    facets, vertices = counts["facet"], counts["vertex"]
    if vertices != 3 * facets or counts["endfacet"] != facets:
        raise MeshError(
            f"ASCII STL with {facets} facets, {vertices} vertices (expected {3 * facets}): "
            "truncated; export it again"
        )
    if counts["endsolid"] != counts["solid"]:
        raise MeshError(
            f"ASCII STL with {counts['solid']} `solid` but {counts['endsolid']} `endsolid`: "
            "truncated; export it again"
        )
