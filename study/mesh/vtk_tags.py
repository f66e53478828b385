"""Tags of VTK's XML files: the counts they announce, and the place of their content."""

from __future__ import annotations

import re
from typing import NamedTuple
from xml.parsers import expat

from study.mesh.kinds import MeshError

_MAX_COUNT = 20_000_000
_TAG = re.compile(rb"<(?:[^>\"']|\"[^\"]*\"|'[^']*')*>")


class Tag(NamedTuple):
    """A tag, by its place in the file."""

    name: str
    parent: str
    given: dict[str, str]
    start: int
    """First byte after the opening tag."""
    end: int
    """First byte of the closing tag; -1 if it stands after the appended data."""


def vtk_tags(data: bytes) -> list[Tag]:
    """Tags of a file in their order, up to the appended data.

    Raises
    ------
    MeshError
        If the file is not well-formed, declares a DOCTYPE, which can unfold without bound, or
        announces an absurd number of anything.
    """
    start = data.removeprefix(b"\xef\xbb\xbf").lstrip()
    if not start.startswith(b"<") or b"\0" in start[:4]:
        raise MeshError("not a VTK file in an ASCII-compatible encoding; export it as UTF-8")
    appended = re.search(rb"<AppendedData\b[^>]*>", data)
    head = data[: appended.end()] if appended else data
    if b"<!DOCTYPE" in head or b"<!ENTITY" in head:
        raise MeshError("declares a DOCTYPE, which no VTK file needs; remove it")
    try:
        tags = _parsed(head, appended is None)
    except expat.ExpatError as error:
        raise MeshError(f"not well-formed XML ({error}): truncated? Export it again") from None
    _check_counts(tags)
    return tags


def count(piece: Tag, name: str) -> int:
    """Number of points, cells and so on that a piece announces."""
    return int(piece.given.get(f"NumberOf{name}", 0))


def _parsed(head: bytes, whole: bool) -> list[Tag]:
    tags: list[Tag] = []
    path: list[int] = []
    parser = expat.ParserCreate()

    def start_tag(name: str, given: dict[str, str]) -> None:
        parent = tags[path[-1]].name if path else ""
        opening = _TAG.match(head, parser.CurrentByteIndex)
        path.append(len(tags))
        tags.append(Tag(name, parent, given, opening.end() if opening else -1, -1))

    def end_tag(_: str) -> None:
        i = path.pop()
        tags[i] = tags[i]._replace(end=parser.CurrentByteIndex)

    parser.StartElementHandler = start_tag
    parser.EndElementHandler = end_tag
    parser.Parse(head, whole)
    return tags


def _check_counts(tags: list[Tag]) -> None:
    """Check the counts before anything is allocated."""
    pieces = [tag for tag in tags if tag.name == "Piece"]
    for name, value in (item for piece in pieces for item in piece.given.items()):
        if not name.startswith("NumberOf"):
            continue
        if not re.fullmatch(r"\s*\d{1,12}\s*", value, re.ASCII):
            raise MeshError(f"{name}={value[:40]!r} is not a count")
        if int(value) > _MAX_COUNT:
            raise MeshError(f"{name} announces {int(value)} entries, the limit is {_MAX_COUNT}")
