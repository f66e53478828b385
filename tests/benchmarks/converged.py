"""Finite-element solutions with their own error, from systematically refined meshes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fem_reference.elasticity import discretise
from fem_reference.elements import ELEMENTS
from fem_reference.error_estimate import discretisation_error
from fem_reference.grid import Projection
from fem_reference.model import static_field
from study.mesh.kinds import TetrahedralMesh
from study.problem.contact import Foundation, ToolPatch
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]


class Converged(NamedTuple):
    """Displacement [m] (q, 3) on the finest mesh, and its estimated relative L2 error."""

    field: Floats
    error: float


def converged(
    meshes: Sequence[TetrahedralMesh],
    sizes: Sequence[float],
    tissue: Tissue,
    foundation: Foundation,
    tool: ToolPatch,
    points: Floats,
    volumes: Floats,
    project: Projection | None = None,
) -> Converged:
    """Solution at points [m] (q, 3) on the last of three meshes, coarse to fine by their sizes."""
    bodies = [discretise(m, tissue, foundation, tool, project=project) for m in meshes]
    fields = [static_field(body, points) for body in bodies]
    formal = ELEMENTS[bodies[-1].element].formal_order
    return Converged(fields[-1], discretisation_error(fields, sizes, formal, volumes).error)
