"""Assembly of the stiffness of linear elasticity from integrals of shape functions.

Isotropic elasticity is a sum of scalar forms: with D_ij the integral of d_i u d_j v for one
component, block (i, j) of the stiffness is lambda D_ji + mu D_ij, and on the diagonal the trace of
D times mu as well. D is integrated once and serves any Lame constants.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csc_array, eye_array, hstack, kron
from skfem.models.elasticity import lame_parameters

from fem_reference.elements import ELEMENTS, ElementName
from fem_reference.forms import Gradients, gradients, pattern, products
from fem_reference.grid import mapping
from fem_reference.stiffness import Pressure, Stiffness
from study.problem.heterogeneous import Composition, Moduli, barycentric_samples, composition
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]

# Degrees of quadrature. MASS_ORDER integrates squares of quadratic functions exactly. Gradients in
# curved cells are not polynomial.
CURVED_ORDER = 4
MASS_ORDER = 4
ENTRIES = 2**16
"""Matrix blocks per batch."""
ROUNDING = 1e-9
"""Rounding of lambda, a difference of two moduli, relative to mu."""


def elastic(grid: skfem.Mesh, name: ElementName, tissue: Tissue) -> Stiffness:
    """Stiffness without support; Taylor-Hood elements have the volumetric part by the pressure."""
    nodes = skfem.Basis(
        grid, ELEMENTS[name].shapes(), mapping(grid), intorder=gradient_order(grid, name)
    )
    return elastic_stiffness(
        gradients(nodes, pattern(nodes)), nodes, name, tissue, composed(nodes, tissue)
    )


def gradient_order(grid: skfem.Mesh, name: ElementName) -> int:
    """Degree of the quadrature of the stiffness."""
    return CURVED_ORDER if isinstance(grid, skfem.MeshTet2) else ELEMENTS[name].gradient_order


def by_order(nodes: skfem.Basis, order: int) -> skfem.Basis:
    """The basis with quadrature of another order, itself where that is the order of the mass."""
    if order == MASS_ORDER:
        return nodes
    return skfem.Basis(nodes.mesh, nodes.elem, nodes.mapping, intorder=order)


def composed(nodes: skfem.Basis, tissue: Tissue) -> Composition | None:
    """Tissue of the cells of a basis, straight or curved; None for a homogeneous body."""

    def points(cells: slice) -> Floats:
        inside = np.ascontiguousarray(barycentric_samples()[:, 1:].T)
        numbers = np.arange(cells.start, cells.stop)
        return np.moveaxis(np.asarray(nodes.mapping.F(inside, tind=numbers)), 0, -1)

    return composition(tissue, int(nodes.mesh.nelements), points)


def cell_moduli(made: Composition | None, tissue: Tissue) -> Moduli:
    """Lame constants [Pa], of one tissue or per cell (cells, 1)."""
    if made is None:
        return Moduli(*lame_parameters(tissue.youngs_modulus, tissue.poisson_ratio))
    found = made.moduli(tissue)
    return Moduli(found.lame[:, None], found.shear[:, None])


def elastic_stiffness(
    integrals: Gradients,
    nodes: skfem.Basis,
    name: ElementName,
    tissue: Tissue,
    made: Composition | None = None,
    pressure: Pressure | None = None,
) -> Stiffness:
    """Stiffness without support from its integrals, and from those of a known pressure if given."""
    if made is not None:
        return _varied(nodes, name, tissue, made)
    lame, mu = lame_parameters(tissue.youngs_modulus, tissue.poisson_ratio)
    mixed = ELEMENTS[name].mixed and lame > 0.0  # p = lambda div u needs lambda > 0
    matrix = _isotropic(integrals, 0.0 if mixed else lame, mu)
    if not mixed:
        return Stiffness(matrix)
    known = _pressure(nodes, name) if pressure is None else (pressure.divergence, pressure.mass)
    return Stiffness(matrix, Pressure(*known, lame, mu))


def _varied(nodes: skfem.Basis, name: ElementName, tissue: Tissue, made: Composition) -> Stiffness:
    """Stiffness without support of cells with moduli of their own, which weight the integrals.

    The continuous pressure smears the jump of the exact one at an interface over the elements
    there. ValueError for mixed elements with a Poisson ratio of 0.
    """
    where, by_gradient = pattern(nodes), by_order(nodes, gradient_order(nodes.mesh, name))
    lame, mu = made.moduli(tissue)
    by_shear = gradients(by_gradient, where, mu)
    if not ELEMENTS[name].mixed:
        return Stiffness(_isotropic(by_shear, 1.0, 1.0, gradients(by_gradient, where, lame)))
    if not (lame > ROUNDING * mu).all():
        raise ValueError(
            "tissue.inclusion: a Poisson ratio of 0 has no pressure; enlarge its poisson_ratio, or "
            "set reference.element to p2"
        )
    around, shear = lame_parameters(tissue.youngs_modulus, tissue.poisson_ratio)
    coupling, mass = _pressure(nodes, name, around / lame)
    _, schur = _pressure(nodes, name, 1.0 / lame + 1.0 / mu)
    return Stiffness(_isotropic(by_shear, 0.0, 1.0), Pressure(coupling, mass, around, shear, schur))


def _pressure(
    nodes: skfem.Basis, name: ElementName, density: Floats | None = None
) -> tuple[csc_array, csc_array]:
    """Integrals of divergence times pressure, and of pressure times pressure, by one quadrature.

    The second have the factor `density` (cells,), if given.
    """
    grid, order = nodes.mesh, gradient_order(nodes.mesh, name)
    pressure = skfem.Basis(grid, skfem.ElementTetP1(), nodes.mapping, intorder=order)
    basis = by_order(nodes, order)
    forms = [skfem.BilinearForm(lambda u, q, _, d=d: u.grad[d] * q) for d in range(3)]
    parts = [finite(one.assemble(basis, pressure), "the coupling") for one in forms]
    by_node = np.arange(3 * basis.N).reshape(3, -1).T.ravel()
    coupling = csc_array(csc_array(hstack(parts, format="csc"))[:, by_node])
    return coupling, csc_array(products(pressure, pattern(pressure), density))


def _isotropic(
    integrals: Gradients, lame: float, mu: float, by_lame: Gradients | None = None
) -> bsr_array:
    """Blocks lambda D_ij + mu D_ji of the integrals, plus mu tr D for i = j.

    `by_lame`: other integrals for lambda.
    """
    D = integrals.values
    blocks = np.multiply(mu, D.mT, order="C")  # products copy any other memory order
    with_lame = (integrals if by_lame is None else by_lame).values
    for start in range(
        0, len(blocks), ENTRIES
    ):  # in batches, as a product has the size of the matrix
        part = slice(start, start + ENTRIES)
        blocks[part] += lame * with_lame[part]
    diagonal = np.einsum("nii->ni", blocks)
    diagonal += mu * np.einsum("nii->n", D)[:, None]
    if not np.isfinite(blocks).all():
        raise ValueError("the stiffness matrix is not finite: the mesh has a flat tetrahedron")
    size = 3 * (len(integrals.indptr) - 1)
    return bsr_array((blocks, integrals.indices, integrals.indptr), shape=(size, size))


def by_component(matrix: csc_array) -> csc_array:
    """The matrix of all three components from that of one."""
    return csc_array(kron(matrix, eye_array(3), format="csc"))


def finite(matrix: Any, name: str) -> csc_array:
    """ValueError for a matrix that is not finite: scikit-fem does not check the mesh."""
    if not np.isfinite(matrix.data).all():
        raise ValueError(f"{name} matrix is not finite: the mesh has a flat tetrahedron")
    return csc_array(matrix)


def rows(values: Any) -> Floats:
    """Array (3, ...) of scikit-fem as (..., 3)."""
    return np.moveaxis(np.asarray(values), 0, -1)
