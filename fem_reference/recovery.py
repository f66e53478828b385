"""Local error estimates by recovery of a smooth strain, and estimates of the error of a goal.

The strain of finite elements is discontinuous. Its projection on the continuous shape functions is
closer to the exact one, and the difference of the two estimates the error: Zienkiewicz and Zhu
(1987), Int. J. Numer. Methods Eng. 24:337. The error of a goal, a linear functional of the
displacement, is the energy product of the errors of the solution and of the dual solution, whose
load is the functional: Becker and Rannacher (2001), Acta Numerica 10:1. These are estimates, not
bounds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse import diags_array
from scipy.sparse.linalg import cg

from fem_reference.assembly import cell_moduli, rows
from fem_reference.direct import Solve
from fem_reference.elasticity import Body
from fem_reference.grid import Projection
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]

PROJECTED = 1e-4
"""Relative residual of the projection; the estimate itself is accurate to some per cent."""
GAP_ORDER = 4


class Recovered(NamedTuple):
    """Strain of a displacement (3, 3, cells, q), and recovered minus computed strain."""

    strain: Floats
    error: Floats


def recovered(body: Body, u: Floats) -> Recovered:
    """Strain of a displacement u [m] (n,) and its estimated error, at the integration points."""
    basis = body.nodes
    gradient = np.stack([np.asarray(basis.interpolate(u[d::3]).grad) for d in range(3)])
    strain = 0.5 * (gradient + gradient.swapaxes(0, 1))
    project, error = _projection(body), np.empty_like(strain)
    for i, j in zip(*np.triu_indices(3), strict=True):
        smooth = np.asarray(basis.interpolate(project(strain[i, j])))
        error[i, j] = error[j, i] = smooth - strain[i, j]
    return Recovered(strain, error)


def goal_errors(
    body: Body,
    tissue: Tissue,
    solve: Solve,
    u: Floats,
    goals: Sequence[Floats],
    project: Projection | None = None,
) -> Floats:
    """Contribution of each cell (cells,) to the relative errors of all goals `goal @ u`.

    Absolute values are summed, so the total overestimates the errors. `u` [m] (n,): static
    displacement under the body's load; `goals` (n,) each, whose dual solutions `solve` computes.
    With `project`, the projection onto the exact surface, the gap between cells and surface
    contributes its volume times the mean energy density of primal and dual solution.
    """
    gaps, primal = _gaps(body, project), _energies(body, tissue, u)
    found = np.zeros(body.nodes.mesh.nelements)
    for goal in goals:
        dual = _energies(body, tissue, solve(goal))
        by_strain = np.sqrt(primal.error * dual.error)
        by_shape = gaps * np.sqrt(primal.whole * dual.whole)
        found += (by_strain + by_shape) / abs(float(goal @ u))
    return found


class _Energies(NamedTuple):
    """Twice the energy [J] of the strain of each cell, and of its estimated error."""

    whole: Floats
    error: Floats


def _energies(body: Body, tissue: Tissue, u: Floats) -> _Energies:
    found = recovered(body, u)
    return _Energies(*(energy_products(body, tissue, one, one) for one in found))


def _gaps(body: Body, project: Projection | None) -> Floats:
    """Volume between the facets of each cell and the surface, over that of the cell (cells,)."""
    basis = body.nodes
    gaps = np.zeros(basis.mesh.nelements)
    if project is None:
        return gaps
    facets = skfem.FacetBasis(basis.mesh, basis.elem, basis.mapping, intorder=GAP_ORDER)
    points = np.ascontiguousarray(rows(facets.global_coordinates())).reshape(-1, 3)
    off = np.linalg.norm(project(points) - points, axis=1).reshape(facets.dx.shape)
    np.add.at(gaps, basis.mesh.f2t[0, facets.find], (off * facets.dx).sum(axis=1))
    return np.asarray(gaps / basis.dx.sum(axis=1))


def energy_products(body: Body, tissue: Tissue, a: Floats, b: Floats) -> Floats:
    """Energy product [J] of two strains (3, 3, cells, q) in each cell (cells,).

    For mixed elements the volumetric part is omitted: it is as accurate as the deviatoric part and
    would be dominated by rounding.
    """
    lame, mu = cell_moduli(body.composition, tissue)
    density = 2.0 * mu * np.einsum("ijcq,ijcq->cq", a, b)
    if body.stiffness.pressure is None:
        density += lame * np.einsum("iicq,jjcq->cq", a, b)
    return np.asarray((density * body.nodes.dx).sum(axis=1))


def _projection(body: Body) -> Callable[[Floats], Floats]:
    """L2 projection from values (cells, q) at the integration points to nodal values."""
    basis, products = body.nodes, body.nodal_volume
    shapes = [np.asarray(basis.basis[k][0]) for k in range(basis.Nbfun)]
    scale = diags_array(1.0 / products.diagonal())

    def project(values: Floats) -> Floats:
        right = np.zeros(basis.N)
        for dofs, shape in zip(basis.element_dofs, shapes, strict=True):
            right += np.bincount(dofs, (values * shape * basis.dx).sum(axis=1), basis.N)
        return np.asarray(cg(products, right, M=scale, rtol=PROJECTED)[0])

    return project
