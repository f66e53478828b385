"""The part of a body's surface that a rigid tool may touch, and the pressure there.

The pressure is linear on the facets of quadratic elements, and the body may not enter the tool in
the mean over the shape function of each vertex. Such a pair of spaces is stable, and as accurate as
the elements are: Hueeber and Wohlmuth (2005), Comput. Methods Appl. Mech. Eng. 194:3147.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, diags_array

from fem_reference.elasticity import Body, rows
from study.problem.rigid import SPHERE, RigidTool

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]

PARTS = 4
"""Of each edge of a facet, for the edge of a punch may run anywhere across it."""
LEAST_SHARE = 0.02
"""Of a vertex's shape function, that lies under the tool; one with less bears no pressure."""
ROUNDING, TINY = 1e-12, 1e-300
# Strang and Fix, three points inside a triangle, exact for squares of linear functions.
_INSIDE = np.array([[1.0, 1.0, 4.0], [1.0, 4.0, 1.0], [4.0, 1.0, 1.0]]) / 6.0


class Gaps(NamedTuple):
    """Mean distance [m] (v,) from the tool at vertices, and the directions (v, 3) away from it.

    Infinite where a vertex has nothing of the tool opposite.
    """

    distance: Floats
    normal: Floats


@dataclass(frozen=True, eq=False)
class Patch:
    """Integration points [m] (q, 3) under a tool, and the vertices that bear its pressure.

    `shapes` (q, nodes): shape functions of the body; `shares` (v, q): of the points in the mean at
    a vertex, each row of which adds up to one. `along` [1/m] (q, nodes): derivatives of the shape
    functions along two directions in the surface, `tangents` (2, q, 3), whose vector product points
    out of the body.
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
        """Nodal forces (nodes, v) of a unit force at each vertex, or means of displacements."""
        return csr_array((self.shares @ self.shapes).T)

    def seeing(self, nodes: Ints) -> Patch:
        """With shape functions of these nodes alone, beside which none reaches the surface."""
        first, second = (csr_array(one[:, nodes]) for one in self.along)
        return replace(self, shapes=csr_array(self.shapes[:, nodes]), along=(first, second))

    def gaps(self, displacement: Floats, time: float) -> Gaps:
        """Where the nodes have moved by a displacement [m] (nodes, 3), at a time [s]."""
        distance, normal = self.tool.gap(self._moved(displacement), time)
        opposite = np.isfinite(distance)
        seen = self.shares @ opposite.astype(np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            mean = (self.shares @ np.where(opposite, distance, 0.0)) / seen
        direction = self.shares @ normal
        direction /= np.maximum(np.linalg.norm(direction, axis=1), TINY)[:, None]
        return Gaps(np.where(seen > LEAST_SHARE, mean, np.inf), direction)

    def _moved(self, displacement: Floats) -> Floats:
        """Points (q, 3) where they are; of a flat tool, whose edge they would cross, along it only.

        By how far they move across it is small beside its radius where strains are small.
        """
        moved = self.shapes @ displacement
        if self.tool.shape != SPHERE:
            moved = np.outer(moved @ self.tool.axis, self.tool.axis)
        return np.asarray(self.points + moved)

    def outward(self, displacement: Floats) -> Floats:
        """Normals (q, 3) out of the body at the points, where the nodes (nodes, 3) have moved."""
        first, second = (
            tangent + slope @ displacement
            for tangent, slope in zip(self.tangents, self.along, strict=True)
        )
        normal = np.cross(first, second)
        return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1), TINY)[:, None])

    def penetration(self, displacement: Floats, time: float) -> float:
        """How deep [m] the deepest integration point is inside the tool."""
        distance, _ = self.tool.gap(self._moved(displacement), time)
        return float(max(0.0, -distance.min()))


def patch(body: Body, tool: RigidTool, times: Floats, margin: float) -> Patch:
    """What a tool may touch of a body at times [s], with a `margin` [m] round it.

    ValueError if there is nothing.
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


def _tangents(normals: Floats) -> Floats:
    """Two unit vectors (2, q, 3) square to each of the normals (q, 3), of which they are right."""
    least = np.eye(3)[np.abs(normals).argmin(axis=1)]
    first = np.cross(normals, least)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(normals, first)])


def _slopes(basis: Any, chosen: Bools, direction: Floats) -> csr_array:
    """Derivatives [1/m] (q, dofs) of shape functions at the chosen points along directions."""
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
    values[np.abs(values) < ROUNDING * longest] = 0.0  # likewise
    return _sparse(basis, values)[chosen]


def _surface(body: Body, facets: NDArray[np.int64]) -> Any:
    nodes = body.nodes
    return skfem.FacetBasis(
        nodes.mesh, nodes.elem, nodes.mapping, facets=facets, quadrature=_rule()
    )


def _rule() -> tuple[Floats, Floats]:
    """Points (2, q) and weights (q,) over a reference triangle that is cut into parts."""
    corners, n = [], PARTS
    for i in range(n):
        for j in range(n - i):
            corners.append([(i, j), (i + 1, j), (i, j + 1)])
            if i + j < n - 1:
                corners.append([(i + 1, j), (i + 1, j + 1), (i, j + 1)])
    points = _INSIDE @ (np.array(corners, dtype=np.float64) / n)
    flat = points.reshape(-1, 2).T
    return np.ascontiguousarray(flat), np.full(flat.shape[1], 0.5 / flat.shape[1])


def _values(basis: Any) -> csr_array:
    """Shape functions of a basis at its integration points (q, dofs)."""
    values = np.stack([np.asarray(one[0]) for one in basis.basis])
    values[np.abs(values) < ROUNDING] = 0.0  # of nodes that are not on the facet
    return _sparse(basis, values)


def _sparse(basis: Any, values: Floats) -> csr_array:
    """Values (functions, facets, points) as a matrix (q, dofs)."""
    columns = np.broadcast_to(basis.element_dofs[:, :, None], values.shape)
    points = np.broadcast_to(np.arange(values[0].size).reshape(values[0].shape), values.shape)
    entries = (values.ravel(), (points.ravel(), columns.ravel()))
    found = csr_array(coo_array(entries, shape=(values[0].size, basis.N)))
    found.eliminate_zeros()
    return found


def _under(surface: Any, tool: RigidTool, times: Floats, margin: float) -> Bools:
    """Which integration points (facets, q) a tool may touch, or holds from the start."""
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
    """Directions (d, 3) in which a tool may push: its axis alone where that cannot change."""
    if tool.shape == SPHERE or tool.bonded or tool.friction > 0.0:
        return np.eye(3)
    return tool.axis[None]
