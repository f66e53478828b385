"""Linear elasticity on tetrahedra: the stiffness, mass, support and load of a body.

Isotropic elasticity is a sum of scalar forms: with D_ij the integral of d_i u d_j v for one
component, block (i, j) of the stiffness is lambda D_ji + mu D_ij, and on the diagonal the trace of
D times mu as well. D is integrated once and serves any Lame constants.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse import (
    bsr_array,
    coo_array,
    csc_array,
    csr_array,
    diags_array,
    eye_array,
    hstack,
    kron,
)
from skfem.models.elasticity import lame_parameters

from fem_reference.elements import AUTO, ELEMENTS, ElementName, chosen_element
from fem_reference.forms import Gradients, Pattern, gradients, pattern, products
from fem_reference.grid import CurvedMapping, Projection, curved, mapping, straight
from fem_reference.stiffness import Pressure, Stiffness
from study.mesh.kinds import TetrahedralMesh
from study.mesh.tetrahedra import volumes
from study.problem.contact import ToolPatch
from study.problem.heterogeneous import Composition, Moduli, barycentric_samples, composition
from study.problem.supports import Support
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]
# Degrees that the quadrature integrates: squares of quadratic functions; the load and the support
# vary inside a facet, so more there. Gradients in curved cells are no polynomials at all.
CURVED_ORDER = 4
MASS_ORDER = 4
FACET_ORDER = 10
ENTRIES = 2**16
"""Of a matrix that are made at once."""
ROUNDING = 1e-9
"""Of lambda over mu, the difference of two moduli."""


class Loaded(NamedTuple):
    """The element that is meant, and scikit-fem's basis of one component on the facets."""

    element: ElementName
    surface: Any


class Outline(NamedTuple):
    """A body's mesh and shape functions, by which fields on it are seen, without its matrices.

    `nodes`: scikit-fem's basis of one component, at a single point of every cell.
    """

    mesh: TetrahedralMesh
    element: ElementName
    nodes: Any
    unknowns: int


@dataclass(frozen=True)
class Body:
    """The discretised body; unknowns u [m] (3 nodes,), component by component of each node.

    `nodes`: scikit-fem's basis of one component, vertices first, then edges; `stiffness` [N/m] has
    the foundation in it, `support` [N/m] is the foundation alone; `mass` [kg], consistent; `load`
    [N], the tool's force spread over the surface, its sum `force` along the tool; `gradients`: what
    the stiffness is made of by the tissue's constants; `composition`: what each cell is made of,
    None where all are of one tissue. `fixed` (3 nodes,): unknowns that do not move, None where all
    do; they are coupled to nothing and without load, but keep a stiffness and a mass of their own.
    `nodal_mass` [kg] (n,): the mass at each unknown, with what is coupled to fixed ones. `others`:
    [N] (n,) each, of further loads; `dead` [N] (n,): what acts at all times, and has taken the body
    to where its motion starts. `full` (loads,): share of each load in the rest under all of them,
    None for all of each.
    """

    mesh: TetrahedralMesh
    element: ElementName
    nodes: Any
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
        """Nodal forces [N] (n, loads) of all that have a history, each in full."""
        return np.column_stack([self.load, *self.others])

    @property
    def full_load(self) -> Floats:
        """Nodal forces [N] (n,) of all loads in full: of one that travels, at one place."""
        loads = self.loads
        return np.asarray(loads.sum(axis=1) if self.full is None else loads @ self.full)

    @property
    def whole_load(self) -> Floats:
        """Nodal forces [N] (n,) of all loads in full and of what acts at all times."""
        whole = self.full_load
        return np.asarray(whole if self.dead is None else whole + self.dead)

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
        """What fields on it are seen by."""
        cells, centre = self.nodes, (np.full((3, 1), 0.25), np.ones(1))
        nodes = skfem.Basis(cells.mesh, cells.elem, cells.mapping, quadrature=centre)
        return Outline(self.mesh, self.element, nodes, self.unknowns)

    @cached_property
    def points(self) -> Floats:
        """Positions [m] (nodes, 3)."""
        return np.ascontiguousarray(self.nodes.doflocs.T)

    def inertia(self, acceleration: Floats) -> Floats:
        """Nodal forces [N] (n,) of an acceleration [m/s^2] (n,), the mass times it."""
        if self._nodal is None:
            return np.asarray(self.mass @ acceleration)
        return np.asarray(self._nodal @ acceleration.reshape(-1, 3)).ravel()

    @cached_property
    def _nodal(self) -> csr_array | None:
        """Mass of one component, a third of the whole; None where they are not alike."""
        own, found = self.mass.diagonal().reshape(-1, 3), csr_array(self.mass[::3, ::3])
        alike = self.mass.nnz == 3 * found.nnz and bool((own == own[:, :1]).all())
        return found if alike else None

    @cached_property
    def basis(self) -> Any:
        """scikit-fem's basis of displacements, whose unknowns are ordered as those here."""
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

    With `project`, which takes points [m] (n, 3) to the exact surface, quadratic elements are
    curved along it. `loaded`: what `loaded_surface` gave of the same, if it is known. ValueError if
    the tool or the support touches no surface, for a Poisson ratio that no solid has, and for a
    tetrahedron without volume.
    """
    given = (mesh, tissue, foundation, tool, element, project)
    name, surface = loaded or loaded_surface(*given)
    grid, one = surface.mesh, surface.elem
    support = by_component(_finite(_foundation_form(foundation).assemble(surface), "the support"))
    nodes = skfem.Basis(grid, one, mapping(grid), intorder=MASS_ORDER)
    where, by_gradient = pattern(nodes), _by_order(nodes, _order(grid, name))
    made = composed(nodes, tissue)
    if isinstance(nodes.mapping, CurvedMapping):
        nodes.mapping.forget()
    whole = by_component(_finite(_mass(nodes, where, tissue, made), "the mass"))
    integrals = gradients(by_gradient, where)
    fixed = _fixed(surface, foundation)
    mass = decoupled(whole, fixed)
    stiffness = _held(_elastic(integrals, nodes, name, tissue, made), support, fixed)
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
    """Nodal forces [N] (n,) but for those on what does not move."""
    return force if fixed is None else np.where(fixed, 0.0, force)


def _fixed(surface: Any, foundation: Support) -> Booleans | None:
    """Unknowns (3 nodes,) of all facets whose middle does not move; None if all may move."""
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
    """Without the entries that couple fixed unknowns to any other."""
    if fixed is None:
        return matrix
    found = matrix.tocoo()
    kept = ~(fixed[found.row] | fixed[found.col]) | (found.row == found.col)
    entries = (found.data[kept], (found.row[kept], found.col[kept]))
    return csc_array(coo_array(entries, shape=found.shape))


def composed(nodes: Any, tissue: Tissue) -> Composition | None:
    """What the cells of a basis are made of, curved ones as they are; None for one tissue."""

    def points(cells: slice) -> Floats:
        inside = np.ascontiguousarray(barycentric_samples()[:, 1:].T)
        numbers = np.arange(cells.start, cells.stop)
        return np.moveaxis(np.asarray(nodes.mapping.F(inside, tind=numbers)), 0, -1)

    return composition(tissue, int(nodes.mesh.nelements), points)


def _mass(nodes: Any, where: Pattern, tissue: Tissue, made: Composition | None) -> csr_array:
    """Of one component [kg]."""
    if made is None:
        return tissue.density * products(nodes, where)
    return products(nodes, where, made.density(tissue.density))


def cell_moduli(made: Composition | None, tissue: Tissue) -> Moduli:
    """Lame's constants [Pa] to go with values (cells, q): of one tissue, or of each cell."""
    if made is None:
        return Moduli(*lame_parameters(tissue.youngs_modulus, tissue.poisson_ratio))
    found = made.moduli(tissue)
    return Moduli(found.lame[:, None], found.shear[:, None])


def of_tissue(body: Body, tissue: Tissue, element: str = AUTO) -> Body:
    """The same body with the elastic constants of another tissue, on its nodes and their integrals.

    Mass, support and load stay. ValueError for a Poisson ratio that no solid has, and for an
    element with other nodes.
    """
    name = chosen_element(element, tissue.highest_poisson_ratio)
    _check_poisson_ratio(tissue.poisson_ratio)
    if ELEMENTS[name].shapes is not ELEMENTS[body.element].shapes:
        raise ValueError(f"reference.element: {name} has other nodes than {body.element}")
    pressure = body.stiffness.pressure
    own = _elastic(body.gradients, body.nodes, name, tissue, body.composition, pressure)
    return replace(body, element=name, stiffness=_held(own, body.support, body.fixed))


def bare(body: Body) -> Body:
    """The body without the matrix of its stiffness, of which `of_tissue` makes another."""
    size = body.stiffness.size
    return replace(body, stiffness=replace(body.stiffness, matrix=csr_array((size, size))))


def _held(own: Stiffness, support: csc_array, fixed: Booleans | None) -> Stiffness:
    """With the support in it, whose nodes are of cells too, and fixed unknowns coupled to nothing.

    The matrix is changed, not copied.
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
    """What a body is loaded on.

    All that `discretise` refuses is refused here, where little is computed.
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


def _refuse_untouched(surface: Any, foundation: Support, tool: ToolPatch) -> None:
    """ValueError if no integration point of the facets is held, or pushed."""
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


def elastic(grid: Any, name: ElementName, tissue: Tissue) -> Stiffness:
    """Stiffness without support; with Taylor-Hood the volume's part goes by the pressure."""
    nodes = skfem.Basis(grid, ELEMENTS[name].shapes(), mapping(grid), intorder=_order(grid, name))
    return _elastic(gradients(nodes, pattern(nodes)), nodes, name, tissue, composed(nodes, tissue))


def _order(grid: Any, name: ElementName) -> int:
    """Degree that the quadrature of the stiffness integrates."""
    return CURVED_ORDER if isinstance(grid, skfem.MeshTet2) else ELEMENTS[name].gradient_order


def _by_order(nodes: Any, order: int) -> Any:
    """The same basis with the quadrature of an order, where it is another than the mass's."""
    if order == MASS_ORDER:
        return nodes
    return skfem.Basis(nodes.mesh, nodes.elem, nodes.mapping, intorder=order)


def _elastic(
    integrals: Gradients,
    nodes: Any,
    name: ElementName,
    tissue: Tissue,
    made: Composition | None = None,
    pressure: Pressure | None = None,
) -> Stiffness:
    """Stiffness without support from its integrals, and from those of a pressure if there are."""
    if made is not None:
        return _varied(nodes, name, tissue, made)
    lame, mu = lame_parameters(tissue.youngs_modulus, tissue.poisson_ratio)
    mixed = ELEMENTS[name].mixed and lame > 0.0  # p = lambda div u says nothing where lambda is 0
    matrix = _isotropic(integrals, 0.0 if mixed else lame, mu)
    if not mixed:
        return Stiffness(matrix)
    known = _pressure(nodes, name) if pressure is None else (pressure.divergence, pressure.mass)
    return Stiffness(matrix, Pressure(*known, lame, mu))


def _varied(nodes: Any, name: ElementName, tissue: Tissue, made: Composition) -> Stiffness:
    """The same of cells with moduli of their own, by which the integrals are weighed.

    A continuous pressure does not follow one that jumps where tissue changes, and is smeared over
    the elements there. ValueError beside a pressure for tissue that it says nothing of.
    """
    where, by_gradient = pattern(nodes), _by_order(nodes, _order(nodes.mesh, name))
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
    nodes: Any, name: ElementName, density: Floats | None = None
) -> tuple[csc_array, csc_array]:
    """One rule for both: the product of a divergence and a pressure, and of two pressures.

    The second times a density (cells,), where one is given.
    """
    grid, order = nodes.mesh, _order(nodes.mesh, name)
    pressure = skfem.Basis(grid, skfem.ElementTetP1(), nodes.mapping, intorder=order)
    basis = _by_order(nodes, order)
    forms = [skfem.BilinearForm(lambda u, q, _, d=d: u.grad[d] * q) for d in range(3)]
    parts = [_finite(one.assemble(basis, pressure), "the coupling") for one in forms]
    by_node = np.arange(3 * basis.N).reshape(3, -1).T.ravel()
    coupling = csc_array(csc_array(hstack(parts, format="csc"))[:, by_node])
    return coupling, csc_array(products(pressure, pattern(pressure), density))


def _isotropic(
    integrals: Gradients, lame: float, mu: float, by_lame: Gradients | None = None
) -> bsr_array:
    """Block (i, j) is lambda D_ij + mu D_ji of the integrals, on the diagonal mu tr D as well.

    `by_lame`: other integrals to go with lambda.
    """
    D = integrals.values
    blocks = np.multiply(mu, D.mT, order="C")  # any other order is copied by every product
    with_lame = (integrals if by_lame is None else by_lame).values
    for start in range(0, len(blocks), ENTRIES):  # a whole product would be as large as the matrix
        part = slice(start, start + ENTRIES)
        blocks[part] += lame * with_lame[part]
    diagonal = np.einsum("nii->ni", blocks)
    diagonal += mu * np.einsum("nii->n", D)[:, None]
    if not np.isfinite(blocks).all():
        raise ValueError("the stiffness matrix is not finite: the mesh has a flat tetrahedron")
    size = 3 * (len(integrals.indptr) - 1)
    return bsr_array((blocks, integrals.indices, integrals.indptr), shape=(size, size))


def by_component(matrix: csc_array) -> csc_array:
    """A matrix of one component for all three."""
    return csc_array(kron(matrix, eye_array(3), format="csc"))


def _finite(matrix: Any, name: str) -> csc_array:
    """scikit-fem assembles broken meshes without complaint; the matrix tells."""
    if not np.isfinite(matrix.data).all():
        raise ValueError(f"{name} matrix is not finite: the mesh has a flat tetrahedron")
    return csc_array(matrix)


def _foundation_form(foundation: Support) -> Any:
    return skfem.BilinearForm(lambda u, v, w: foundation.density(rows(w.x), rows(w.n)) * u * v)


def patch_load(surface: Any, tool: ToolPatch) -> Floats:
    """Nodal forces [N] of the tool's traction, scaled so that they add up to its force."""
    form = skfem.LinearForm(lambda v, w: tool.profile(rows(w.x), rows(w.n)) * v)
    nodal = np.asarray(form.assemble(surface))
    total = float(nodal.sum())
    return np.outer(nodal * (tool.force / total), tool.direction).ravel()


def rows(values: Any) -> Floats:
    """scikit-fem's (3, ...) as (..., 3)."""
    return np.moveaxis(np.asarray(values), 0, -1)
