"""A mesh of tetrahedra as a file that `organ.mesh` reads again."""

from __future__ import annotations

from pathlib import Path

from study.mesh.kinds import TetrahedralMesh

FORMAT = "gmsh"
"""Gmsh 4.1 by meshio's name of it: binary, so that numbers are exact."""


def save(mesh: TetrahedralMesh, path: Path, format_: str = FORMAT) -> None:
    """Write corners and tetrahedra in metres, in a format by meshio's name of it."""
    import meshio

    meshio.Mesh(mesh.points, [("tetra", mesh.tetrahedra)]).write(path, format_)
