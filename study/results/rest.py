"""The folder of a scene of which only the state at rest is required.

rest.csv    displacement at the control points under the full load, and its estimated errors
rest.vtu    displacement of the organ on the finest mesh, if the field is required
scene.toml  the scene that was solved
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import TetrahedralMesh
from study.results.tables import write_table
from study.system import folders

TABLE, FIELD, SCENE = "rest.csv", "rest.vtu", "scene.toml"
FILES = {TABLE, FIELD, SCENE}

Floats = NDArray[np.float64]


class RestRow(NamedTuple):
    """A control point at rest, a row of rest.csv; errors are relative to its displacement.

    `along_push_m`: along the push of the tool; `mesh_error` includes a factor of safety; the other
    error is that of large displacements on a lattice, or of neglecting them.
    """

    probe: str
    x_m: float
    y_m: float
    z_m: float
    along_push_m: float
    mesh_error: float | None
    large_displacement_error: float


def replacing(folder: Path) -> AbstractContextManager[Path]:
    """A folder beside `folder` that replaces it when the block ends without an exception.

    FolderError before the block if `folder` holds anything but a rest, or cannot be written.
    """
    return folders.replacing(folder, _foreign, "run of a scene at rest")


def _foreign(present: set[str]) -> str | None:
    others = sorted(present - FILES) if TABLE in present else sorted(present)
    return others[0] if others else None


def write(rows: Iterable[RestRow], scene: str, folder: Path) -> None:
    """Write the table and the text of the scene."""
    write_table(folder / TABLE, RestRow, rows)
    (folder / SCENE).write_text(scene, encoding="utf-8")


def write_field(mesh: TetrahedralMesh, displacement: Floats, folder: Path) -> None:
    """Write the displacement [m] (n, 3) of the vertices of a mesh."""
    import meshio

    cells = [("tetra", mesh.tetrahedra)]
    found = meshio.Mesh(mesh.points, cells, point_data={"displacement": displacement})
    found.write(folder / FIELD)
