"""Wavefront OBJ files: positions and faces only."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from study.mesh.kinds import MeshError
from study.mesh.raw import RawMesh, by_corner_count, raw_mesh
from study.mesh.text import NumberedLine, floats, text_lines, unit_note, whole

_FACES = {"f", "fo"}  # the second name is an old one
# What would add to the surface and is not read: free forms, old patches, other files.
_REFUSED = {
    "surf": "a free-form surface",
    "curv": "a free-form curve",
    "curv2": "a free-form curve",
    "bsp": "a patch",
    "bzp": "a patch",
    "cdp": "a patch",
    "cdc": "a curve",
    "call": "another file",
    "csh": "a command",
}
_IGNORED = {
    *("vt", "vn", "vp", "p", "l", "g", "o", "s", "mg"),
    *("usemtl", "mtllib", "usemap", "maplib", "lod", "bevel", "c_interp", "d_interp"),
    *("shadow_obj", "trace_obj", "ctech", "stech"),
    # Settings and parts of free forms, which are refused where they begin.
    *("cstype", "deg", "bmat", "step", "parm", "trim", "hole", "scrv", "sp", "end", "con", "res"),
}


def read_obj(data: bytes) -> RawMesh:
    """Positions (`v`) and faces (`f`) of an OBJ file, of all its groups and objects.

    A corner is v, v/vt, v//vn or v/vt/vn; a negative number counts back from the last position.
    Textures, normals, colours, weights, points, lines, groups and materials are ignored.

    Raises
    ------
    MeshError
        Naming the line of a face or a number that cannot be read, or of a free-form surface.
    """
    positions: list[NumberedLine] = []
    faces: list[list[int]] = []
    unknown: Counter[str] = Counter()
    lines = text_lines(data)
    for number, words in _statements(lines):
        keyword = words[0].lower()
        if keyword == "v":
            positions.append((number, _position(number, words[1:])))
        elif keyword in _FACES:
            faces.append(_face(number, words[1:], len(positions)))
        elif keyword in _REFUSED:
            raise MeshError(
                f"line {number}: `{keyword}` is {_REFUSED[keyword]}, which cannot be "
                "read; export polygons"
            )
        elif keyword not in _IGNORED:
            unknown[keyword] += 1
    _refuse_forward_references(faces, len(positions))
    notes = [
        *unit_note("\n".join(line for line in lines if line.startswith("#"))),
        *(
            f"{count} lines `{word[:40]}`, unknown in OBJ, ignored"
            for word, count in unknown.items()
        ),
    ]
    return raw_mesh(floats(positions, 3), by_corner_count(faces), notes)


def _statements(lines: list[str]) -> Iterator[tuple[int, list[str]]]:
    """Number of the first line and words of every statement; a backslash joins lines."""
    words: list[str] = []
    first = 1
    for number, line in enumerate(lines, start=1):
        text = line.partition("#")[0].rstrip()
        first = first if words else number
        words += text.removesuffix("\\").split()
        if words and not text.endswith("\\"):
            yield first, words
            words = []
    if words:
        raise MeshError(f"line {first}: continued by a backslash, but nothing follows: truncated")


def _position(number: int, words: list[str]) -> list[str]:
    """Three coordinates, then a weight, a colour or both: five numbers are one too few or many."""
    if len(words) == 5 or len(words) > 7:
        raise MeshError(
            f"line {number}: `{' '.join(words)[:60]}` is no position: it has 3 numbers, 4 with a "
            "weight, 6 with a colour: damaged, export it again"
        )
    return words


def _face(number: int, corners: list[str], position_count: int) -> list[int]:
    try:
        given = [whole(corner.partition("/")[0]) for corner in corners]
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
