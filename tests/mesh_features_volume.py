"""Features of the formats that hold tetrahedra: Abaqus, Gmsh, MEDIT and text lists."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from tests.mesh_features import Feature, Treatment
from tests.mesh_samples import cube

ABAQUS = "Abaqus and CalculiX (.inp)"


def abaqus(edit: Callable[[str], str] = str) -> Callable[[Path], Path]:
    """Writer of the cube as a keyword file after an edit of its text."""
    points, tetrahedra = cube(2)
    rows = ["*HEADING", "cube", "*NODE"]
    rows += [f"{i}, {x!r}, {y!r}, {z!r}" for i, (x, y, z) in enumerate(points.tolist(), start=1)]
    rows += ["*ELEMENT, TYPE=C3D4"]
    rows += [f"{i}, " + ", ".join(map(str, t + 1)) for i, t in enumerate(tetrahedra, start=1)]
    text = "\n".join([*rows, ""])

    def write(folder: Path) -> Path:
        path = folder / "cube.inp"
        path.write_text(edit(text))
        return path

    return write


def _after(keyword: str, *lines: str) -> Callable[[str], str]:
    return lambda text: text.replace(f"{keyword}\n", "\n".join([keyword, *lines, ""]), 1)


def _at_end(*lines: str) -> Callable[[str], str]:
    return lambda text: "\n".join([text + lines[0], *lines[1:], ""])


def _abaqus(
    name: str, treatment: Treatment, edit: Callable[[str], str] = str, words: str = ""
) -> Feature:
    return Feature(ABAQUS, name, treatment, abaqus(edit), words)


FEATURES: list[Feature] = [
    _abaqus("nodes, linear tetrahedra", "read"),
    _abaqus("`*NSET`, `*ELSET`", "ignored", _at_end("*NSET, NSET=ALL", "1, 2, 3")),
    _abaqus("`*INCLUDE`", "refused", _at_end("*INCLUDE, INPUT=other.inp"), "*INCLUDE"),
]
