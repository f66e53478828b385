"""Finite-element solutions beyond the reach of a direct solver, with their own error."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import LinearOperator, cg

from fem_reference.dynamics import factorised
from fem_reference.elasticity import Body, discretise, evaluation
from study.contact import Foundation, ToolPatch
from study.mesh.kinds import TetrahedralMesh
from study.run.comparison import relative_l2
from study.scene import Tissue

Floats = NDArray[np.float64]

ORDER = 2
"""Assumed of the reference's error in the element size.

Three meshes give 2.0 on the liver, whose facets are flat, and 2.3 or more on the block.
"""
TOLERANCE = 1e-8


class Converged(NamedTuple):
    """Displacement [m] (q, 3) on the finest mesh, and its estimated relative L2 error."""

    field: Floats
    error: float


def converged(
    meshes: tuple[TetrahedralMesh, TetrahedralMesh],
    ratio: float,
    tissue: Tissue,
    foundation: Foundation,
    tool: ToolPatch,
    points: Floats,
    volumes: Floats,
) -> Converged:
    """Solution at points [m] (q, 3) on the second of two meshes, `ratio` times finer."""
    coarse, fine = (field(discretise(mesh, tissue, foundation, tool), points) for mesh in meshes)
    error = relative_l2(coarse, fine, volumes) / (ratio**ORDER - 1.0)
    return Converged(fine, error)


def field(body: Body, points: Floats) -> Floats:
    """Displacement [m] (q, 3) at points under the full load at rest."""
    return np.asarray((evaluation(body, points) @ solve(body)).reshape(-1, 3))


def solve(body: Body) -> Floats:
    """Unknowns of the body at rest, by conjugate gradients.

    The preconditioner adds a direct solution with linear elements on the same mesh, an eighth of
    the unknowns, to the diagonal: the iterations do not grow as the mesh is refined.
    """
    stiffness = csr_array(body.stiffness)
    prolong = _from_linear(body.basis)
    coarse = factorised(csc_array(prolong.T @ stiffness @ prolong))
    diagonal = stiffness.diagonal()

    def precondition(residual: Floats) -> Floats:
        return np.asarray(residual / diagonal + prolong @ coarse.solve(prolong.T @ residual))

    operator = LinearOperator(stiffness.shape, matvec=precondition, dtype=np.float64)
    found, failed = cg(stiffness, body.load, rtol=TOLERANCE, maxiter=2000, M=operator)
    if failed:
        raise ValueError("the finite elements find no rest: the support does not hold the body")
    return np.asarray(found)


def _from_linear(basis: Any) -> csr_array:
    """Matrix from displacements of the vertices to all unknowns: edge nodes take the mean."""
    vertex, edge, ends = basis.nodal_dofs, basis.edge_dofs, basis.mesh.edges
    count = vertex.shape[1]
    rows, columns, values = [], [], []
    for d in range(3):
        first = d * count
        rows += [vertex[d], edge[d], edge[d]]
        columns += [first + np.arange(count), first + ends[0], first + ends[1]]
        values += [np.ones(count), *np.full((2, ends.shape[1]), 0.5)]
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    return csr_array(entries, shape=(basis.N, 3 * count))
