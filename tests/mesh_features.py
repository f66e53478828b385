"""What mesh files may have besides the plain mesh, and what becomes of it: read, ignored, refused.

Every feature makes a file of the same cube; tests/test_mesh_features.py loads each of them, and
`python -m tests.mesh_features` writes docs/mesh_formats.md from the same list.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import groupby
from pathlib import Path
from typing import Literal, NamedTuple

PAGE = Path(__file__).resolve().parent.parent / "docs" / "mesh_formats.md"

Treatment = Literal["read", "ignored", "ignored with a note", "refused"]


class Feature(NamedTuple):
    """Something that a file of a format may have."""

    format: str
    """As the page heads it: name and ending, e.g. `Abaqus (.inp)`."""
    name: str
    treatment: Treatment
    write: Callable[[Path], Path]
    """Makes the cube of 0.12 m (`mesh_samples.cube(2)` or its surface) with the feature, in a
    folder; a file that is to be read or whose feature is ignored holds the whole cube [m]."""
    words: str = ""
    """What the refusal or the note has to say, among other words: the keyword and the line."""


def features() -> list[Feature]:
    """Those of volume formats, then those of surfaces and VTK."""
    from tests.mesh_features_surface import FEATURES as SURFACE
    from tests.mesh_features_volume import FEATURES as VOLUME

    return [*VOLUME, *SURFACE]


def page(listed: Iterable[Feature]) -> str:
    """The page of the formats: a table each, in the order of the list."""
    parts = [
        "# Mesh formats\n",
        "What a mesh file may contain besides nodes and elements, and how it is treated. Content "
        "that is\n*ignored* changes neither nodes nor elements. Content that would change them but "
        "is not supported is\n*refused*, with its name and line. Every row is a test.\n",
    ]
    for name, group in groupby(listed, key=lambda feature: feature.format):
        parts += [f"## {name}\n", "| in the file | treatment |", "|---|---|"]
        parts += [
            f"| {feature.name.replace('|', chr(92) + '|')} | {feature.treatment} |"
            for feature in group
        ]
        parts.append("")
    return "\n".join(parts)


if __name__ == "__main__":
    PAGE.write_text(page(features()), encoding="utf-8")
