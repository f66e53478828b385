"""A tetrahedral mesh as a file that `organ.mesh` reads."""

from __future__ import annotations

from pathlib import Path

from study.mesh.kinds import TetrahedralMesh

FORMAT = "gmsh"
"""meshio's name of Gmsh 4.1: binary, so that numbers are exact."""


def save(mesh: TetrahedralMesh, path: Path, format_: str = FORMAT) -> None:
    """Write corners and tetrahedra in metres, in a format by meshio's name."""
    import meshio

    meshio.Mesh(mesh.points, [("tetra", mesh.tetrahedra)]).write(path, format_)
