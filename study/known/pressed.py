"""Blocks and columns on a foundation under a tool; the displacement of a column is linear.

Under a uniform pressure p the base of a column sinks by p / k on a foundation of k [Pa/m] (Winkler,
1867). Above it the strain is p over Young's modulus if the sides are free and nu = 0, or over
lambda + 2 mu between smooth walls.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fem_reference.elasticity import Body, discretise
from study.known.verification.solid import at_rest, free_everywhere
from study.mesh.kinds import TetrahedralMesh
from study.organ.block import block_mesh
from study.problem.contact import Foundation, ToolPatch
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]

DOWN = np.array([0.0, 0.0, -1.0])
BLOCK = (0.06, 0.05, 0.04)
COLUMN = (0.04, 0.04, 0.06)
"""Width, depth and height of the column [m]."""
FOUNDATION = 5e5
"""Stiffness under the column [Pa/m]."""
PRESSURE = 200.0
"""Pressure on the column [Pa]."""
WIDE = 1e6
"""Radius [m] of a tool whose pressure on a column is uniform up to rounding."""


def on_base(
    mesh: TetrahedralMesh, tissue: Tissue, element: str, foundation: float, tool: ToolPatch
) -> Body:
    """A body whose base z = 0 rests on a foundation [Pa/m]."""
    return discretise(mesh, tissue, Foundation(DOWN, 0.0, 1e-3, foundation), tool, element)


def block(tissue: Tissue, element: str, cell: float) -> Body:
    """A block of 6 x 5 x 4 cm in cells [m], under a tool of 0.1 N at the centre of its top."""
    tool = ToolPatch(np.array([0.03, 0.025, 0.04]), DOWN, 0.02, 0.1)
    return on_base(block_mesh(BLOCK, cell), tissue, element, 1e6, tool)


def column(
    mesh: TetrahedralMesh,
    tissue: Tissue,
    element: str,
    foundation: float = FOUNDATION,
    pressure: float = PRESSURE,
) -> Body:
    """A box from the origin on a foundation [Pa/m] under a uniform pressure [Pa]."""
    corner = mesh.points.max(axis=0)
    tool = ToolPatch(corner, DOWN, WIDE, float(pressure * corner[0] * corner[1]))
    return on_base(mesh, tissue, element, foundation, tool)


def walls(points: Floats) -> NDArray[np.bool_]:
    """Which displacements (nodes, 3) at nodes [m] are fixed by smooth walls around a column."""
    side = (points < 1e-9) | (points > points.max(axis=0) - 1e-9)
    return np.asarray(side & [True, True, False])


def between_walls(body: Body) -> Floats:
    """Displacement [m] (nodes, 3) of a column between smooth walls, by a direct solver."""
    prescribed = np.where(walls(body.points), 0.0, free_everywhere(body.points))
    return at_rest(body.stiffness, body.load, prescribed).reshape(-1, 3)


def exact_column(points: Floats, modulus: float, foundation: float = FOUNDATION) -> Floats:
    """Exact displacement [m] (n, 3) under `PRESSURE`, for a strain of pressure over `modulus`."""
    return np.asarray((PRESSURE / foundation + PRESSURE / modulus * points[:, 2:]) * DOWN)
