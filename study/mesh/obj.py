"""Wavefront OBJ files: positions and faces only."""

from __future__ import annotations

from study.mesh.kinds import MeshError
from study.mesh.raw import RawMesh, by_corner_count, raw_mesh
from study.mesh.text import NumberedLine, floats


def read_obj(data: bytes) -> RawMesh:
    """Positions (`v`) and faces (`f`) of an OBJ file; textures, normals and groups are ignored.

    A corner is v, v/vt, v//vn or v/vt/vn; a negative number counts back from the last position.
    """
    positions: list[NumberedLine] = []
    faces: list[list[int]] = []
    for number, line in enumerate(data.decode("latin-1").split("\n"), start=1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        if words[0] == "v":
            positions.append((number, words[1:]))
        elif words[0] == "f":
            faces.append(_face(number, words[1:], len(positions)))
    _refuse_forward_references(faces, len(positions))
    return raw_mesh(floats(positions, 3), by_corner_count(faces))


def _face(number: int, corners: list[str], position_count: int) -> list[int]:
    try:
        given = [int(corner.partition("/")[0]) for corner in corners]
    except ValueError:
        raise MeshError(f"line {number}: cannot read the face `{' '.join(corners)[:60]}`") from None
    if len(given) < 3:
        raise MeshError(f"line {number}: a face needs three corners, found {len(given)}")
    nodes = [i - 1 if i > 0 else position_count + i for i in given]
    if 0 in given or min(nodes) < 0:
        raise MeshError(
            f"line {number}: face refers to position {min(given)}; positions count from 1, "
            f"or back from -1 to -{position_count}"
        )
    return nodes


def _refuse_forward_references(faces: list[list[int]], position_count: int) -> None:
    for face, nodes in enumerate(faces):
        if max(nodes) >= position_count:
            raise MeshError(
                f"face {face} (0-based) refers to position {max(nodes) + 1}, but there are only "
                f"{position_count}: truncated or damaged file"
            )
