"""Linear elasticity on tetrahedra: the stiffness, mass, support and load of a body."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse import (
    coo_array,
    csc_array,
    csr_array,
    diags_array,
)

from fem_reference.assembly import (
    MASS_ORDER,
    by_component,
    by_order,
    composed,
    elastic_stiffness,
    finite,
    gradient_order,
    rows,
)
from fem_reference.elements import AUTO, ELEMENTS, ElementName, chosen_element
from fem_reference.forms import Gradients, Pattern, gradients, pattern, products
from fem_reference.grid import CurvedMapping, Projection, curved, mapping, straight
from fem_reference.stiffness import Stiffness
from study.mesh.kinds import TetrahedralMesh
from study.mesh.tetrahedra import volumes
from study.problem.contact import ToolPatch
from study.problem.heterogeneous import Composition
from study.problem.supports import Support
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]
FACET_ORDER = 10
"""Degree of quadrature on facets, inside which load and support vary."""


class Loaded(NamedTuple):
    """The chosen element, and scikit-fem's basis of one component on the boundary facets."""

    element: ElementName
    surface: skfem.FacetBasis


class Outline(NamedTuple):
    """Mesh and shape functions of a body, without its matrices, for the evaluation of fields.

    `nodes`: scikit-fem's basis of one component, with a single quadrature point per cell.
    """

    mesh: TetrahedralMesh
    element: ElementName
    nodes: skfem.Basis
    unknowns: int


@dataclass(frozen=True)
class Body:
    """The discretised body, with unknowns u [m] (n,) = (3 nodes,), the components node by node.

    `nodes`: scikit-fem's basis of one component, vertices first, then edge nodes. `stiffness`
    [N/m]: tissue and foundation; `support` [N/m]: foundation alone; `mass` [kg]: consistent mass;
    `load` [N]: nodal forces of the tool, which sum to its force; `gradients`: integrals from which
    the stiffness follows for any elastic constants; `composition`: tissue of each cell, None for a
    homogeneous body. `fixed` (n,): constrained unknowns, None without any; they are decoupled and
    without load, but keep their diagonal stiffness and mass. `nodal_mass` [kg] (n,): row sums of
    the mass, including the coupling to constrained unknowns. `others` [N] (n,) each: further loads;
    `dead` [N] (n,): dead load, under which the motion starts in equilibrium. `full` (loads,):
    factor of each load in the static solution under all loads, None for 1 each.
    """

    mesh: TetrahedralMesh
    element: ElementName
    nodes: skfem.Basis
    stiffness: Stiffness
    mass: csc_array
    nodal_mass: Floats
    support: csc_array
    load: Floats
    gradients: Gradients
    composition: Composition | None = None
    fixed: Booleans | None = None
    others: tuple[Floats, ...] = ()
    dead: Floats | None = None
    full: Floats | None = None

    @property
    def loads(self) -> Floats:
        """Nodal forces [N] (n, loads) of all loads with a history, each in full."""
        return np.column_stack([self.load, *self.others])

    @property
    def full_load(self) -> Floats:
        """Nodal forces [N] (n,) of all loads in full; a travelling load acts at one place."""
        loads = self.loads
        return np.asarray(loads.sum(axis=1) if self.full is None else loads @ self.full)

    @property
    def whole_load(self) -> Floats:
        """Nodal forces [N] (n,) of all loads in full, dead load included."""
        load = self.full_load
        return np.asarray(load if self.dead is None else load + self.dead)

    @property
    def node_count(self) -> int:
        """Number of vertices and edge nodes."""
        return int(self.nodes.N)

    @property
    def unknowns(self) -> int:
        """Number of displacements and pressures."""
        return self.stiffness.unknowns

    @property
    def outline(self) -> Outline:
        """Mesh and shape functions of the body, for the evaluation of fields."""
        cells, centre = self.nodes, (np.full((3, 1), 0.25), np.ones(1))
        nodes = skfem.Basis(cells.mesh, cells.elem, cells.mapping, quadrature=centre)
        return Outline(self.mesh, self.element, nodes, self.unknowns)

    @cached_property
    def points(self) -> Floats:
        """Positions [m] (nodes, 3)."""
        return np.ascontiguousarray(self.nodes.doflocs.T)

    @cached_property
    def nodal_volume(self) -> csr_array:
        """Integrals [m^3] (nodes, nodes) of products of shape functions, constraints aside."""
        return products(self.nodes, pattern(self.nodes))

    def inertia(self, acceleration: Floats) -> Floats:
        """Mass times an acceleration [m/s^2] (n,): nodal forces [N] (n,)."""
        if self._nodal is None:
            return np.asarray(self.mass @ acceleration)
        return np.asarray(self._nodal @ acceleration.reshape(-1, 3)).ravel()

    @cached_property
    def _nodal(self) -> csr_array | None:
        """Mass matrix of one component; None where the components differ."""
        if self.fixed is not None:
            held = self.fixed.reshape(-1, 3)
            if (held != held[:, :1]).any():
                return None
        own, found = self.mass.diagonal().reshape(-1, 3), csr_array(self.mass[::3, ::3])
        alike = self.mass.nnz == 3 * found.nnz and bool((own == own[:, :1]).all())
        return found if alike else None

    @cached_property
    def basis(self) -> skfem.Basis:
        """scikit-fem's vector basis of displacements, with the order of unknowns of the body."""
        element = skfem.ElementVector(ELEMENTS[self.element].shapes())
        return skfem.Basis(self.nodes.mesh, element, self.nodes.mapping, intorder=MASS_ORDER)


def discretise(
    mesh: TetrahedralMesh,
    tissue: Tissue,
    foundation: Support,
    tool: ToolPatch,
    element: str = AUTO,
    project: Projection | None = None,
    loaded: Loaded | None = None,
) -> Body:
    """Assemble the body.

    With `project`, which maps points [m] (n, 3) onto the exact surface, quadratic elements are
    curved along it. `loaded`: result of `loaded_surface` for the same arguments, if known.
    ValueError if the tool or the support touches no surface, for a Poisson ratio outside (-1, 0.5),
    and for a tetrahedron without volume.
    """
    given = (mesh, tissue, foundation, tool, element, project)
    name, surface = loaded or loaded_surface(*given)
    grid, one = surface.mesh, surface.elem
    support = by_component(finite(_foundation_form(foundation).assemble(surface), "the support"))
    nodes = skfem.Basis(grid, one, mapping(grid), intorder=MASS_ORDER)
    where, by_gradient = pattern(nodes), by_order(nodes, gradient_order(grid, name))
    made = composed(nodes, tissue)
    if isinstance(nodes.mapping, CurvedMapping):
        nodes.mapping.clear()
    whole = by_component(finite(_mass(nodes, where, tissue, made), "the mass"))
    integrals = gradients(by_gradient, where)
    fixed = _fixed(surface, foundation)
    mass = decoupled(whole, fixed)
    stiffness = _with_support(
        elastic_stiffness(integrals, nodes, name, tissue, made), support, fixed
    )
    load = without_fixed(patch_load(surface, tool), fixed)
    return Body(
        mesh,
        name,
        nodes,
        stiffness,
        mass,
        np.asarray(whole.sum(axis=1)),
        support,
        load,
        integrals,
        made,
        fixed,
    )


def without_fixed(force: Floats, fixed: Booleans | None) -> Floats:
    """Nodal forces [N] (n,) with zeros at constrained unknowns."""
    return force if fixed is None else np.where(fixed, 0.0, force)


def _fixed(surface: skfem.FacetBasis, foundation: Support) -> Booleans | None:
    """Unknowns (3 nodes,) on facets whose centre is fixed; None without any."""
    points = rows(surface.global_coordinates()).mean(axis=1)
    held = foundation.fixed(points, rows(surface.normals).mean(axis=1))
    if not held.any():
        return None
    found = np.zeros((surface.N, 3), dtype=np.bool_)
    for d in range(3):
        facets = surface.find[held[:, d]]
        if len(facets):
            found[surface.get_dofs(facets=facets).flatten(), d] = True
    return found.ravel()


def decoupled(matrix: csc_array, fixed: Booleans | None) -> csc_array:
    """The matrix without entries that couple constrained unknowns to others."""
    if fixed is None:
        return matrix
    found = matrix.tocoo()
    kept = ~(fixed[found.row] | fixed[found.col]) | (found.row == found.col)
    entries = (found.data[kept], (found.row[kept], found.col[kept]))
    return csc_array(coo_array(entries, shape=found.shape))


def _mass(
    nodes: skfem.Basis, where: Pattern, tissue: Tissue, made: Composition | None
) -> csr_array:
    """Mass matrix [kg] of one component."""
    if made is None:
        return tissue.density * products(nodes, where)
    return products(nodes, where, made.density(tissue.density))


def of_tissue(body: Body, tissue: Tissue, element: str = AUTO) -> Body:
    """The same body with the elastic constants of another tissue, reusing its integrals.

    Mass, support and load are unchanged. ValueError for a Poisson ratio outside (-1, 0.5), and for
    an element with other nodes.
    """
    name = chosen_element(element, tissue.highest_poisson_ratio)
    _check_poisson_ratio(tissue.poisson_ratio)
    if ELEMENTS[name].shapes is not ELEMENTS[body.element].shapes:
        raise ValueError(f"reference.element: {name} has other nodes than {body.element}")
    pressure = body.stiffness.pressure
    own = elastic_stiffness(body.gradients, body.nodes, name, tissue, body.composition, pressure)
    return replace(body, element=name, stiffness=_with_support(own, body.support, body.fixed))


def bare(body: Body) -> Body:
    """The body without its stiffness matrix, for `of_tissue` to make another."""
    size = body.stiffness.size
    return replace(body, stiffness=replace(body.stiffness, matrix=csr_array((size, size))))


def _with_support(own: Stiffness, support: csc_array, fixed: Booleans | None) -> Stiffness:
    """The stiffness plus the support, whose pattern it contains, with fixed unknowns decoupled.

    The matrix is changed in place.
    """
    matrix, nodal = own.matrix, coo_array(support[::3, ::3])
    rows = np.repeat(np.arange(nodal.shape[0]), np.diff(matrix.indptr))
    places, wanted = (
        np.ravel_multi_index(pair, nodal.shape)
        for pair in ((rows, matrix.indices), (nodal.row, nodal.col))
    )
    entries = np.searchsorted(places, wanted)
    matrix.data[entries] += nodal.data[:, None, None] * np.eye(3)
    if fixed is None:
        return own
    free = ~fixed.reshape(-1, 3)
    of_nodes = np.flatnonzero(rows == matrix.indices)
    own_stiffness = np.einsum("nii->ni", matrix.data[of_nodes])
    matrix.data *= free[rows][:, :, None] & free[matrix.indices][:, None, :]
    for d in range(3):
        matrix.data[of_nodes, d, d] = own_stiffness[:, d]
    if own.pressure is None:
        return own
    divergence = csc_array(own.pressure.divergence @ diags_array(free.ravel().astype(float)))
    return Stiffness(matrix, replace(own.pressure, divergence=divergence))


def loaded_surface(
    mesh: TetrahedralMesh,
    tissue: Tissue,
    foundation: Support,
    tool: ToolPatch,
    element: str = AUTO,
    project: Projection | None = None,
) -> Loaded:
    """The element and the boundary facets of a body.

    It raises every ValueError of `discretise`, before anything expensive.
    """
    name = chosen_element(element, tissue.highest_poisson_ratio)
    _check_poisson_ratio(tissue.poisson_ratio)
    _refuse_flat(mesh)
    kind = ELEMENTS[name]
    bent = project if kind.quadratic else None
    grid = straight(mesh) if bent is None else curved(mesh, bent)
    surface = skfem.FacetBasis(grid, kind.shapes(), mapping(grid), intorder=FACET_ORDER)
    _refuse_untouched(surface, foundation, tool)
    return Loaded(name, surface)


def _refuse_untouched(surface: skfem.FacetBasis, foundation: Support, tool: ToolPatch) -> None:
    """ValueError if no integration point of the facets is supported, or none is loaded."""
    points, normals = rows(surface.global_coordinates()), rows(surface.normals)
    coarse = f"on a mesh of {surface.mesh.nelements} tetrahedra"
    if not (
        foundation.density(points, normals).any()
        or foundation.fixed(points.mean(axis=1), normals.mean(axis=1)).any()
    ):
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


def _foundation_form(foundation: Support) -> skfem.BilinearForm:
    return skfem.BilinearForm(lambda u, v, w: foundation.density(rows(w.x), rows(w.n)) * u * v)


def patch_load(surface: skfem.FacetBasis, tool: ToolPatch) -> Floats:
    """Nodal forces [N] of the tool's traction, scaled so that they sum to its force."""
    form = skfem.LinearForm(lambda v, w: tool.profile(rows(w.x), rows(w.n)) * v)
    nodal = np.asarray(form.assemble(surface))
    total = float(nodal.sum())
    return np.outer(nodal * (tool.force / total), tool.direction).ravel()
