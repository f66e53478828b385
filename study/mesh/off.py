"""OFF files, the Object File Format of Geomview, as text."""

from __future__ import annotations

import re

from study.mesh.kinds import MeshError
from study.mesh.raw import Block, RawMesh, by_corner_count, raw_mesh
from study.mesh.text import NumberedLine, floats, text_lines, unit_note, whole

_KEYWORD = re.compile(r"(ST)?(C)?(N)?(4)?(n)?OFF")
_NUMBERS = {"ST": 2, "C": 3, "N": 3}
"""That each prefix adds to a point, at least: a colour may have an opacity too."""


def read_off(data: bytes) -> RawMesh:
    """Positions and polygons of an OFF file; normals, colours and texture coordinates are ignored.

    Every position and every face has a line of its own: x, y, z, then further values of the
    point; the number of corners, the corners, then the colour.

    Raises
    ------
    MeshError
        On places in four or more dimensions, on the binary form, and naming the line if the file
        is truncated or longer than announced.
    """
    lines = text_lines(data)
    rows = [
        (i, words) for i, line in enumerate(lines, 1) if (words := line.partition("#")[0].split())
    ]
    prefixes, rows = _after_keyword(rows)
    points, faces = _counts(rows)
    if len(rows) - 1 != points + faces:
        raise MeshError(
            f"{points} points and {faces} faces are announced, on a line each, but "
            f"{len(rows) - 1} lines found: truncated or damaged, export it again"
        )
    _refuse_uneven(rows[1 : 1 + points], prefixes)
    places = floats(rows[1 : 1 + points], 3)
    blocks, thin = _polygons(rows[1 + points :])
    notes = [f"{thin} faces of one or two corners, which are points or lines, left out"]
    comments = "\n".join(line.partition("#")[2] for line in lines if "#" in line)
    return raw_mesh(places, blocks, [*unit_note(comments), *(notes if thin else [])])


def _after_keyword(rows: list[NumberedLine]) -> tuple[list[str], list[NumberedLine]]:
    """Prefixes of the keyword, and the rows from the one with the counts on.

    The counts may follow the keyword on its line.
    """
    first = rows[0][1] if rows else []
    if first and all(re.fullmatch(r"[0-9]+", word) for word in first):
        return [], rows  # the keyword may be missing
    keyword = (
        _KEYWORD.fullmatch(first[0]) or _KEYWORD.fullmatch(first[0].upper()) if first else None
    )
    if keyword is None:
        raise MeshError("line 1: expected `OFF`, or it with the prefixes ST, C, N: not an OFF file")
    if keyword[4] or keyword[5]:
        raise MeshError(f"line {rows[0][0]}: `{first[0]}` holds places in more than 3 dimensions")
    if first[1:2] and first[1].upper() == "BINARY":
        raise MeshError(f"line {rows[0][0]}: `OFF BINARY` cannot be read; save it as text")
    prefixes = [one for one in keyword.groups() if one]
    return prefixes, [(rows[0][0], first[1:]), *rows[1:]] if first[1:] else rows[1:]


def _refuse_uneven(rows: list[NumberedLine], prefixes: list[str]) -> None:
    """MeshError for a point with fewer or more numbers than the others, or than are announced.

    With a number missing in front, a colour would stand for a coordinate.
    """
    width = max((len(words) for _, words in rows), default=0)
    least = 3 + sum(_NUMBERS[one] for one in prefixes)
    for number, words in rows:
        if not least <= len(words) == width:
            raise MeshError(
                f"line {number}: a point of {len(words)} numbers, but {max(least, width)} are due: "
                "damaged, export it again"
            )


def _counts(rows: list[NumberedLine]) -> tuple[int, int]:
    """Numbers of points and faces; that of the edges, which is not used, may be missing."""
    number, words = rows[0] if rows else (1, [])
    if not 2 <= len(words) <= 3 or not all(re.fullmatch(r"[0-9]{1,12}", word) for word in words):
        raise MeshError(
            f"line {number}: expected the numbers of points, faces and edges, found "
            f"`{' '.join(words)[:60]}`: truncated?"
        )
    return int(words[0]), int(words[1])


def _polygons(rows: list[NumberedLine]) -> tuple[list[Block], int]:
    """Blocks of polygons, and the number of faces with less than three corners."""
    faces = [_corners(number, words) for number, words in rows]
    solid = [face for face in faces if len(face) >= 3]
    return by_corner_count(solid), len(faces) - len(solid)


def _corners(number: int, words: list[str]) -> list[int]:
    try:
        count = whole(words[0])
        nodes = [whole(word) for word in words[1 : 1 + count]]
    except ValueError:
        count, nodes = -1, []
    if count < 1 or len(nodes) != count:
        raise MeshError(f"line {number}: not a face with its corners: `{' '.join(words)[:60]}`")
    return nodes
