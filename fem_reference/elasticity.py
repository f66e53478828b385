"""Linear elasticity on quadratic tetrahedra: matrices, load, strain and point evaluation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array
from skfem.helpers import dot
from skfem.models.elasticity import lame_parameters, linear_elasticity

from study.contact import Foundation, ToolPatch
from study.mesh.kinds import TetrahedralMesh
from study.mesh.locate import locate
from study.scene import Tissue

Floats = NDArray[np.float64]

# Products of two quadratic functions; the load and the support vary inside a facet, so more there.
CELL_ORDER = 4
FACET_ORDER = 10


@dataclass(frozen=True)
class Body:
    """The discretised body: u has three unknowns per node of quadratic tetrahedra.

    `stiffness` [N/m] with the foundation in it, `mass` [kg], consistent; `load` [N], the tool's
    force spread over the surface, its sum `force` along the tool; `support` [N/m], the foundation.
    """

    mesh: TetrahedralMesh
    basis: Any
    stiffness: csc_array
    mass: csc_array
    support: csc_array
    load: Floats

    @property
    def node_count(self) -> int:
        """Number of vertices and edge nodes."""
        return int(self.basis.N) // 3


def discretise(
    mesh: TetrahedralMesh, tissue: Tissue, foundation: Foundation, tool: ToolPatch
) -> Body:
    """Assemble the body. ValueError if the tool or the support touches no surface."""
    grid = skfem.MeshTet(
        np.ascontiguousarray(mesh.points.T), np.ascontiguousarray(mesh.tetrahedra.T)
    )
    element = skfem.ElementVector(skfem.ElementTetP2())
    basis = skfem.Basis(grid, element, intorder=CELL_ORDER)
    surface = skfem.FacetBasis(grid, element, intorder=FACET_ORDER)
    support = _finite(_foundation_form(foundation).assemble(surface), "the support")
    if support.nnz == 0 or not support.diagonal().any():
        raise ValueError("the support holds no surface; enlarge support.depth")
    elastic = linear_elasticity(*lame_parameters(tissue.youngs_modulus, tissue.poisson_ratio))
    stiffness = _finite(elastic.assemble(basis), "the stiffness")
    mass = _finite(_mass_form(tissue.density).assemble(basis), "the mass")
    return Body(mesh, basis, stiffness + support, mass, support, _load(surface, tool))


def _finite(matrix: Any, name: str) -> csc_array:
    """scikit-fem assembles broken meshes without complaint; the matrix tells."""
    if not np.isfinite(matrix.data).all():
        raise ValueError(f"{name} matrix is not finite: the mesh has a flat tetrahedron")
    return csc_array(matrix)


def _mass_form(density: float) -> Any:
    return skfem.BilinearForm(lambda u, v, _: density * dot(u, v))


def _foundation_form(foundation: Foundation) -> Any:
    def form(u: Any, v: Any, w: Any) -> Any:
        return foundation.density(_rows(w.x), _rows(w.n)) * dot(u, v)

    return skfem.BilinearForm(form)


def _load(surface: Any, tool: ToolPatch) -> Floats:
    """Nodal forces [N] of the tool's traction, scaled so that they add up to its force."""

    def form(v: Any, w: Any) -> Any:
        profile = tool.profile(_rows(w.x), _rows(w.n))
        return profile * sum(d * v[i] for i, d in enumerate(tool.direction))

    nodal = np.asarray(skfem.LinearForm(form).assemble(surface))
    total = float(nodal.reshape(-1, 3).sum(axis=0) @ tool.direction)
    if total <= 0.0:
        raise ValueError("the tool touches no surface; move tool.place or enlarge tool.radius")
    return nodal * (tool.force / total)


def _rows(values: Any) -> Floats:
    """scikit-fem's (3, ...) as (..., 3): the one place where it is transposed."""
    return np.moveaxis(np.asarray(values), 0, -1)


def evaluation(body: Body, points: Floats) -> csc_array:
    """Matrix that takes unknowns to displacement at points [m] (q, 3), rows point by point."""
    cells, barycentric = locate(body.mesh, points)
    local = np.ascontiguousarray(barycentric[:, 1:].T)[:, :, None]
    values, columns = [], []
    for k in range(body.basis.Nbfun):
        field = body.basis.elem.gbasis(body.basis.mapping, local, k, tind=cells)[0]
        values.append(np.asarray(field)[:, :, 0].T)
        columns.append(np.repeat(body.basis.element_dofs[k, cells][:, None], 3, axis=1))
    rows = np.tile(np.arange(3 * len(points)), body.basis.Nbfun)
    data = np.concatenate([v.ravel() for v in values])
    column = np.concatenate([c.ravel() for c in columns])
    return csc_array(coo_array((data, (rows, column)), shape=(3 * len(points), body.basis.N)))


def largest_strain(body: Body, displacement: Floats) -> float:
    """Largest absolute principal strain at the integration points."""
    gradient = np.moveaxis(np.asarray(body.basis.interpolate(displacement).grad), (0, 1), (-2, -1))
    strain = 0.5 * (gradient + np.swapaxes(gradient, -2, -1))
    return float(np.abs(np.linalg.eigvalsh(strain)).max())
