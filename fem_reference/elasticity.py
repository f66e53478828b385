"""Linear elasticity on tetrahedra: the stiffness, mass, support and load of a body.

Isotropic elasticity is a sum of scalar forms: with D_ij the integral of d_i u d_j v for one
component, block (i, j) of the stiffness is lambda D_ji + mu D_ij, and on the diagonal the trace of
D times mu as well. scikit-fem assembles the six scalar matrices ten times faster than one form on
vectors.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse import block_array, csc_array, csr_array, eye_array, kron
from skfem.models.elasticity import lame_parameters

from fem_reference.elements import AUTO, ELEMENTS, ElementName, chosen_element
from fem_reference.grid import Projection, curved, mapping, straight
from fem_reference.stiffness import Pressure, Stiffness
from study.mesh.kinds import TetrahedralMesh
from study.mesh.tetrahedra import volumes
from study.problem.contact import Foundation, ToolPatch
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]
# Degrees that the quadrature integrates: squares of quadratic functions; the load and the support
# vary inside a facet, so more there. Gradients in curved cells are no polynomials at all.
CURVED_ORDER = 4
MASS_ORDER = 4
FACET_ORDER = 10


@dataclass(frozen=True)
class Body:
    """The discretised body; unknowns u [m] (3 nodes,), component by component of each node.

    `nodes`: scikit-fem's basis of one component, vertices first, then edges; `stiffness` [N/m] has
    the foundation in it, `support` [N/m] is the foundation alone; `mass` [kg], consistent; `load`
    [N], the tool's force spread over the surface, its sum `force` along the tool.
    """

    mesh: TetrahedralMesh
    element: ElementName
    nodes: Any
    stiffness: Stiffness
    mass: csc_array
    support: csc_array
    load: Floats

    @property
    def node_count(self) -> int:
        """Number of vertices and edge nodes."""
        return int(self.nodes.N)

    @property
    def unknowns(self) -> int:
        """Number of displacements and pressures."""
        return self.stiffness.unknowns

    @cached_property
    def points(self) -> Floats:
        """Positions [m] (nodes, 3)."""
        return np.ascontiguousarray(self.nodes.doflocs.T)

    @cached_property
    def basis(self) -> Any:
        """scikit-fem's basis of displacements, whose unknowns are ordered as those here."""
        element = skfem.ElementVector(ELEMENTS[self.element].shapes())
        return skfem.Basis(self.nodes.mesh, element, self.nodes.mapping, intorder=MASS_ORDER)


def discretise(
    mesh: TetrahedralMesh,
    tissue: Tissue,
    foundation: Foundation,
    tool: ToolPatch,
    element: str = AUTO,
    project: Projection | None = None,
) -> Body:
    """Assemble the body.

    With `project`, which takes points [m] (n, 3) to the exact surface, quadratic elements are
    curved along it. ValueError if the tool or the support touches no surface, for a Poisson ratio
    that no solid has, and for a tetrahedron without volume.
    """
    name, surface = loaded_surface(mesh, tissue, foundation, tool, element, project)
    grid, one = surface.mesh, surface.elem
    support = _by_component(_finite(_foundation_form(foundation).assemble(surface), "the support"))
    nodes = skfem.Basis(grid, one, mapping(grid), intorder=MASS_ORDER)
    mass = tissue.density * _finite(_product_form().assemble(nodes), "the mass")
    own = elastic(grid, name, tissue)
    stiffness = Stiffness(csc_array(own.matrix + support), own.pressure)
    load = _load(surface, tool)
    return Body(mesh, name, nodes, stiffness, _by_component(mass), support, load)


def loaded_surface(
    mesh: TetrahedralMesh,
    tissue: Tissue,
    foundation: Foundation,
    tool: ToolPatch,
    element: str = AUTO,
    project: Projection | None = None,
) -> tuple[ElementName, Any]:
    """The element that is meant, and scikit-fem's basis of one component on the facets.

    All that `discretise` refuses is refused here, where next to nothing is computed.
    """
    name = chosen_element(element, tissue.poisson_ratio)
    _check_poisson_ratio(tissue.poisson_ratio)
    _refuse_flat(mesh)
    kind = ELEMENTS[name]
    bent = project if kind.quadratic else None
    grid = straight(mesh) if bent is None else curved(mesh, bent)
    surface = skfem.FacetBasis(grid, kind.shapes(), mapping(grid), intorder=FACET_ORDER)
    _refuse_untouched(surface, foundation, tool)
    return name, surface


def _refuse_untouched(surface: Any, foundation: Foundation, tool: ToolPatch) -> None:
    """ValueError if no integration point of the facets is held, or pushed."""
    points, normals = rows(surface.global_coordinates()), rows(surface.normals)
    coarse = f"on a mesh of {surface.mesh.nelements} tetrahedra"
    if not foundation.density(points, normals).any():
        raise ValueError(
            f"support: holds no surface {coarse}; enlarge support.depth, or reduce "
            "reference.element_size"
        )
    if not tool.profile(points, normals).any():
        raise ValueError(
            f"tool: touches no surface {coarse}; enlarge tool.radius, move tool.place or reduce "
            "reference.element_size"
        )


def _check_poisson_ratio(nu: float) -> None:
    if not -1.0 < nu < 0.5:
        raise ValueError(
            f"tissue.poisson_ratio: {nu:g} is not between -1 and 0.5, where a solid has a finite "
            "and positive stiffness; for tissue that keeps its volume give 0.4999"
        )


def _refuse_flat(mesh: TetrahedralMesh) -> None:
    flat = np.flatnonzero(volumes(mesh) == 0.0)
    if len(flat):
        raise ValueError(
            f"organ.mesh: {len(flat)} flat tetrahedra, the first number {flat[0]} (0-based); "
            "remove slivers in the mesher"
        )


def elastic(grid: Any, name: ElementName, tissue: Tissue) -> Stiffness:
    """Stiffness without support; with Taylor-Hood the volume's part goes by the pressure."""
    kind = ELEMENTS[name]
    order = CURVED_ORDER if isinstance(grid, skfem.MeshTet2) else kind.gradient_order
    basis = skfem.Basis(grid, kind.shapes(), mapping(grid), intorder=order)
    lame, mu = lame_parameters(tissue.youngs_modulus, tissue.poisson_ratio)
    mixed = kind.mixed and lame > 0.0  # p = lambda div u says nothing where lambda is 0
    matrix = _interleaved(_blocks(basis, 0.0 if mixed else lame, mu))
    if not mixed:
        return Stiffness(matrix)
    # One rule for both: the product of a gradient and a pressure, and of two pressures.
    pressure = skfem.Basis(grid, skfem.ElementTetP1(), basis.mapping, intorder=order)
    divergence = [
        skfem.BilinearForm(lambda u, q, _, d=d: u.grad[d] * q).assemble(basis, pressure)
        for d in range(3)
    ]
    coupling = _interleaved([[_finite(one, "the coupling") for one in divergence]])
    products = csc_array(_product_form().assemble(pressure))
    return Stiffness(matrix, Pressure(coupling, products, lame, mu))


def _blocks(basis: Any, lame: float, mu: float) -> list[list[csr_array]]:
    """Blocks by component of the stiffness, rows those of the test function."""
    D: dict[tuple[int, int], csr_array] = {}
    for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)):
        form = skfem.BilinearForm(lambda u, v, _, i=i, j=j: u.grad[i] * v.grad[j])
        D[i, j] = csr_array(_finite(form.assemble(basis), "the stiffness"))
        D[j, i] = D[i, j].T
    trace = D[0, 0] + D[1, 1] + D[2, 2]

    def block(i: int, j: int) -> csr_array:
        return lame * D[j, i] + mu * D[i, j] + (mu * trace if i == j else 0.0 * trace)

    return [[block(i, j) for j in range(3)] for i in range(3)]


def _interleaved(blocks: list[list[csr_array]]) -> csc_array:
    """Blocks of components as one matrix whose unknowns go node by node."""
    whole = csr_array(block_array(blocks, format="csr"))
    rows, columns = (
        _node_by_node(n, len(b)) for n, b in zip(whole.shape, (blocks, blocks[0]), strict=True)
    )
    return csc_array(whole[rows][:, columns])


def _node_by_node(size: int, components: int) -> NDArray[np.int64]:
    return np.arange(size).reshape(components, -1).T.ravel()


def _by_component(matrix: csc_array) -> csc_array:
    """A matrix of one component for all three."""
    return csc_array(kron(matrix, eye_array(3), format="csc"))


def _finite(matrix: Any, name: str) -> csc_array:
    """scikit-fem assembles broken meshes without complaint; the matrix tells."""
    if not np.isfinite(matrix.data).all():
        raise ValueError(f"{name} matrix is not finite: the mesh has a flat tetrahedron")
    return csc_array(matrix)


def _product_form() -> Any:
    return skfem.BilinearForm(lambda u, v, _: u * v)


def _foundation_form(foundation: Foundation) -> Any:
    return skfem.BilinearForm(lambda u, v, w: foundation.density(rows(w.x), rows(w.n)) * u * v)


def _load(surface: Any, tool: ToolPatch) -> Floats:
    """Nodal forces [N] of the tool's traction, scaled so that they add up to its force."""
    form = skfem.LinearForm(lambda v, w: tool.profile(rows(w.x), rows(w.n)) * v)
    nodal = np.asarray(form.assemble(surface))
    total = float(nodal.sum())
    return np.outer(nodal * (tool.force / total), tool.direction).ravel()


def rows(values: Any) -> Floats:
    """scikit-fem's (3, ...) as (..., 3)."""
    return np.moveaxis(np.asarray(values), 0, -1)
