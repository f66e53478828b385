"""Discretisation of the surface that a rigid tool may touch, and of the contact pressure.

The pressure is piecewise linear on the facets of quadratic elements. Non-penetration holds in the
mean, weighted by the linear shape function of each vertex. This pair of spaces is inf-sup stable
and as accurate as the elements: Hueeber and Wohlmuth (2005), Comput. Methods Appl. Mech. Eng.
194:3147.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, diags_array

from fem_reference.assembly import rows
from fem_reference.elasticity import Body
from study.problem.rigid import SPHERE, RigidTool

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]

PARTS = 4
"""Parts per facet edge in the quadrature, since the edge of a punch may cross a facet anywhere."""
LEAST_SHARE = 0.02
"""Share of a vertex's shape function under the tool below which the vertex has no pressure."""
ROUNDING, TINY = 1e-12, 1e-300
# Three interior points of a triangle (Strang and Fix), exact for quadratic functions.
_INSIDE = np.array([[1.0, 1.0, 4.0], [1.0, 4.0, 1.0], [4.0, 1.0, 1.0]]) / 6.0


class Gaps(NamedTuple):
    """Weighted mean gap [m] (v,) at the vertices, and the tool normals (v, 3).

    The gap is infinite where no part of the tool is opposite.
    """

    distance: Floats
    normal: Floats


@dataclass(frozen=True, eq=False)
class Patch:
    """Integration points [m] (q, 3) under a tool, and the vertices with contact pressure.

    `shapes` (q, nodes): shape functions of the body; `shares` (v, q): weights of the points in the
    mean at each vertex, which sum to one. `along` [1/m] (q, nodes) each: derivatives of the shape
    functions along the two surface `tangents` (2, q, 3), whose cross product is the outward normal.
    """

    tool: RigidTool
    points: Floats
    shapes: csr_array
    shares: csr_array
    tangents: Floats
    along: tuple[csr_array, csr_array]

    @property
    def count(self) -> int:
        """Number of vertices."""
        return int(self.shares.shape[0])

    @property
    def spread(self) -> csr_array:
        """Nodal forces (nodes, v) of a unit force at each vertex; transposed, weighted means."""
        return csr_array((self.shares @ self.shapes).T)

    def restricted_to(self, nodes: Ints) -> Patch:
        """The patch restricted to these nodes, which include all with support on the surface."""
        first, second = (csr_array(one[:, nodes]) for one in self.along)
        return replace(self, shapes=csr_array(self.shapes[:, nodes]), along=(first, second))

    def gaps(self, displacement: Floats, time: float) -> Gaps:
        """Gaps at a nodal displacement [m] (nodes, 3) and a time [s]."""
        distance, normal = self.tool.gap(self._moved(displacement), time)
        opposite = np.isfinite(distance)
        seen = self.shares @ opposite.astype(np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            mean = (self.shares @ np.where(opposite, distance, 0.0)) / seen
        direction = self.shares @ normal
        direction /= np.maximum(np.linalg.norm(direction, axis=1), TINY)[:, None]
        return Gaps(np.where(seen > LEAST_SHARE, mean, np.inf), direction)

    def _moved(self, displacement: Floats) -> Floats:
        """Current positions [m] (q, 3); under a flat tool, displaced along its axis only.

        Otherwise points would cross its edge. At small strain the lateral displacement is small
        relative to the radius.
        """
        moved = self.shapes @ displacement
        if self.tool.shape != SPHERE:
            moved = np.outer(moved @ self.tool.axis, self.tool.axis)
        return np.asarray(self.points + moved)

    def outward(self, displacement: Floats) -> Floats:
        """Outward normals (q, 3) of the deformed surface at a displacement [m] (nodes, 3)."""
        first, second = (
            tangent + slope @ displacement
            for tangent, slope in zip(self.tangents, self.along, strict=True)
        )
        normal = np.cross(first, second)
        return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1), TINY)[:, None])

    def penetration(self, displacement: Floats, time: float) -> float:
        """Largest penetration [m] of an integration point."""
        distance, _ = self.tool.gap(self._moved(displacement), time)
        return float(max(0.0, -distance.min()))


def patch(body: Body, tool: RigidTool, times: Floats, margin: float) -> Patch:
    """Surface of a body within a `margin` [m] of a tool at any of the times [s].

    ValueError if there is none.
    """
    surface = _surface(body, np.asarray(body.nodes.mesh.boundary_facets()))
    facing = _under(surface, tool, times, margin)
    facets = surface.find[facing.any(axis=1)]
    if not len(facets):
        raise ValueError(
            f"{tool.name}: never comes near the surface on a mesh of {body.nodes.mesh.nelements} "
            f"tetrahedra; move {tool.name}.place, enlarge {tool.name}.displacement or radius, or "
            "reduce reference.element_size"
        )
    fine = _surface(body, facets)
    linear = skfem.FacetBasis(
        fine.mesh, skfem.ElementTetP1(), fine.mapping, facets=facets, quadrature=_rule()
    )
    inside = _under(fine, tool, times, margin).ravel()
    hats, weights = _values(linear), fine.dx.ravel()
    under = csr_array(hats.T @ diags_array(np.where(inside, weights, 0.0)))
    whole, part = hats.T @ weights, under.sum(axis=1)
    kept = np.flatnonzero(part > LEAST_SHARE * whole)
    shares = csr_array(diags_array(1.0 / part[kept]) @ under[kept])
    points = rows(fine.global_coordinates()).reshape(-1, 3)[inside]
    tangents = _tangents(rows(fine.normals).reshape(-1, 3)[inside])
    first, second = (_slopes(fine, inside, one) for one in tangents)
    known = _values(fine)[inside], shares[:, np.flatnonzero(inside)]
    return Patch(tool, points, *known, tangents, (first, second))


def on_free_nodes(found: Patch, fixed: Bools | None) -> Patch:
    """The patch without vertices whose nodes the support holds against the tool.

    They have no compliance. Their penetration is reported as that of any other point. ValueError
    for a patch without other vertices.
    """
    if fixed is None:
        return found
    held = (fixed.reshape(-1, 3) & (found.tool.axis != 0.0)).any(axis=1)
    free = np.asarray(abs(found.spread)[~held].sum(axis=0)) > LEAST_SHARE
    if not free.any():
        raise ValueError(
            f"{found.tool.name}: touches only what the support fixes; move "
            f"{found.tool.name}.place, or reduce support.depth"
        )
    return replace(found, shares=found.shares[np.flatnonzero(free)])


def _tangents(normals: Floats) -> Floats:
    """Two tangent unit vectors (2, q, 3) whose cross product is the normal (q, 3)."""
    least = np.eye(3)[np.abs(normals).argmin(axis=1)]
    first = np.cross(normals, least)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(normals, first)])


def _slopes(basis: skfem.FacetBasis, chosen: Bools, direction: Floats) -> csr_array:
    """Directional derivatives [1/m] (q, dofs) of the shape functions at the chosen points."""
    whole = np.zeros((len(chosen), 3))
    whole[chosen] = direction
    size = basis.dx.shape
    values = np.stack(
        [
            np.einsum("i...,i...", np.asarray(one[0].grad), whole.T.reshape(3, *size))
            for one in basis.basis
        ]
    )
    longest = np.abs(values).max(initial=0.0)
    values[np.abs(values) < ROUNDING * longest] = 0.0  # of nodes off the facet
    return _sparse(basis, values)[chosen]


def _surface(body: Body, facets: NDArray[np.int64]) -> skfem.FacetBasis:
    nodes = body.nodes
    return skfem.FacetBasis(
        nodes.mesh, nodes.elem, nodes.mapping, facets=facets, quadrature=_rule()
    )


def _rule() -> tuple[Floats, Floats]:
    """Composite quadrature of the reference triangle: points (2, q) and weights (q,)."""
    corners, n = [], PARTS
    for i in range(n):
        for j in range(n - i):
            corners.append([(i, j), (i + 1, j), (i, j + 1)])
            if i + j < n - 1:
                corners.append([(i + 1, j), (i + 1, j + 1), (i, j + 1)])
    points = _INSIDE @ (np.array(corners, dtype=np.float64) / n)
    flat = points.reshape(-1, 2).T
    return np.ascontiguousarray(flat), np.full(flat.shape[1], 0.5 / flat.shape[1])


def _values(basis: skfem.FacetBasis) -> csr_array:
    """Shape functions of a basis at its integration points (q, dofs)."""
    values = np.stack([np.asarray(one[0]) for one in basis.basis])
    values[np.abs(values) < ROUNDING] = 0.0  # of nodes off the facet
    return _sparse(basis, values)


def _sparse(basis: skfem.FacetBasis, values: Floats) -> csr_array:
    """Values (functions, facets, points) as a matrix (q, dofs)."""
    columns = np.broadcast_to(basis.element_dofs[:, :, None], values.shape)
    points = np.broadcast_to(np.arange(values[0].size).reshape(values[0].shape), values.shape)
    entries = (values.ravel(), (points.ravel(), columns.ravel()))
    found = csr_array(coo_array(entries, shape=(values[0].size, basis.N)))
    found.eliminate_zeros()
    return found


def _under(surface: skfem.FacetBasis, tool: RigidTool, times: Floats, margin: float) -> Bools:
    """Integration points (facets, q) that a tool may touch, or is bonded to."""
    points, normals = rows(surface.global_coordinates()), rows(surface.normals)
    facing = (normals @ tool.axis) < 0.0
    flat = points.reshape(-1, 3)
    if tool.bonded:
        return np.asarray(tool.holds(flat, normals.reshape(-1, 3)).reshape(facing.shape))
    near = np.full(len(flat), np.inf)
    for time in times:
        near = np.minimum(near, tool.gap(flat, float(time))[0])
    return np.asarray(facing & (near.reshape(facing.shape) < margin))


def directions(tool: RigidTool) -> Floats:
    """Directions (d, 3) of contact force: the axis alone for a frictionless flat tool."""
    if tool.shape == SPHERE or tool.bonded or tool.friction > 0.0:
        return np.eye(3)
    return tool.axis[None]
