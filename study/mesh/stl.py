"""STL files, ASCII and binary."""

from __future__ import annotations

import re

import numpy as np

from study.mesh.kinds import MeshError
from study.mesh.raw import RawMesh, raw_mesh
from study.mesh.text import floats, lines_starting

_HEADER = 84  # 80 bytes of anything, then the number of triangles
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl(data: bytes) -> RawMesh:
    """Triangles of an STL file, three nodes each; normals are not used.

    Binary or ASCII is decided by size: the first word of a binary file may be `solid` too.
    """
    announced = int(np.frombuffer(data, "<u4", 1, 80)[0]) if len(data) >= _HEADER else 0
    needed = _HEADER + _RECORD.itemsize * announced
    if announced and needed <= len(data):
        return _read_binary(data, announced, len(data) - needed)
    if re.match(rb"\s*solid\b", data) and b"facet" in data:
        return _read_ascii(data)
    raise MeshError(
        f"not a complete STL file: {len(data)} bytes, but the header announces {announced} "
        f"triangles, which need {needed}; export it again"
    )


def _read_binary(data: bytes, count: int, surplus: int) -> RawMesh:
    corners = np.frombuffer(data, _RECORD, count, _HEADER)["corners"].reshape(-1, 3)
    notes = [f"{surplus} bytes after the last triangle ignored"] if surplus else []
    return raw_mesh(corners, [("triangle", np.arange(3 * count).reshape(-1, 3))], notes)


def _read_ascii(data: bytes) -> RawMesh:
    text = data.decode("latin-1")
    corners = floats(lines_starting(text, "vertex"), 3)
    facets = len(re.findall(r"^\s*facet\b", text, re.MULTILINE))
    if len(corners) != 3 * facets or not re.search(r"\bendsolid\b[^\n]*\s*\Z", text):
        raise MeshError(
            f"ASCII STL with {facets} facets, {len(corners)} vertices (expected {3 * facets}) "
            "and possibly no `endsolid`: truncated; export it again"
        )
    return raw_mesh(corners, [("triangle", np.arange(3 * facets).reshape(-1, 3))])
