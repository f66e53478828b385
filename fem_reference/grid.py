"""Tetrahedral meshes for scikit-fem, straight or curved along a known surface."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import skfem
from numpy.typing import NDArray

from study.mesh.kinds import TetrahedralMesh

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Projection = Callable[[Floats], Floats]

FARTHEST = 0.2
"""Largest displacement of an edge node, relative to its edge; edges beyond stay straight."""
LEAST_JACOBIAN = 0.2
"""Smallest Jacobian relative to the straight tetrahedron, at corners, edge nodes and centre."""
HALVINGS = 4
NEWTON_STEPS = 8
NEWTON_TOLERANCE = 1e-9
"""[m]"""
SETTLED = 1e-9
"""[m]; a Newton step from this distance converges to rounding."""
# Corners, edge nodes and centre of the reference tetrahedron.
_CORNERS = np.vstack([np.zeros(3), np.eye(3)])
_EDGES = 0.5 * (_CORNERS[[0, 0, 0, 1, 1, 2]] + _CORNERS[[1, 2, 3, 2, 3, 3]])
_LOOKED_AT = np.ascontiguousarray(np.vstack([_CORNERS, _EDGES, np.full((1, 3), 0.25)]).T)


class _Derivatives(NamedTuple):
    """Derivatives (3, 3, cells, q) by local coordinates in some cells, and their inverse."""

    local: Floats
    cells: Any
    by_local: Floats
    inverse: Floats | None


class CurvedMapping(skfem.MappingIsoparametric):  # type: ignore[misc] # scikit-fem has no types
    """scikit-fem's quadratic mapping with an inverse that starts in the straight cell.

    scikit-fem's own inverse starts outside the cell and is confined to a cube around it. It fails
    for some points of curved cells and for all points beyond a face.
    """

    _kept: _Derivatives | None = None
    _found: tuple[Floats, Any, Floats] | None = None

    @cached_property
    def bent(self) -> NDArray[np.bool_]:
        """Cells (cells,) with an edge node off the middle of its edge."""
        nodes = self.mesh.doflocs[:, self.mesh.dofs.element_dofs]
        ends = nodes[:, [0, 1, 0, 0, 1, 2]] + nodes[:, [1, 2, 2, 3, 3, 3]]  # scikit-fem's order
        return np.asarray((np.abs(nodes[:, 4:] - 0.5 * ends) > SETTLED).any(axis=(0, 1)))

    def _at(self, X: Floats, tind: Any) -> _Derivatives:
        """Derivatives at points, cached for the last points only.

        scikit-fem caches those of every Newton step for the lifetime of the mesh, and inverts them
        again for every shape function.
        """
        kept = self._kept
        if kept is None or kept.local is not X or kept.cells is not tind:
            kept = self._kept = _Derivatives(X, tind, self._derivatives(X, tind), None)
        return kept

    def clear(self) -> None:
        """Release the cached derivatives."""
        self._kept = None

    def _derivatives(self, X: Floats, tind: Any) -> Floats:
        """Derivatives of coordinate i by local coordinate j, (i, j, cells, q)."""
        nodes, dofs = self.mesh.doflocs, self.mesh.dofs.element_dofs
        dofs = dofs if tind is None else dofs[:, tind]
        found = np.zeros((3, 3, dofs.shape[1], X.shape[-1]))
        for k, cells in enumerate(dofs):
            slopes = self.elem.lbasis(X, k)[1]
            for i, j in np.ndindex(3, 3):
                found[i, j] += nodes[i, cells][:, None] * slopes[j]
        return found

    def J(self, i: int, j: int, X: Floats, tind: Any = None) -> Floats:  # noqa: N802 - as skfem's mappings
        """Derivative of coordinate i by local coordinate j."""
        return np.asarray(self._at(X, tind).by_local[i, j])

    def invDF(self, X: Floats, tind: Any = None) -> Floats:  # noqa: N802 - as skfem's mappings
        """Derivative of local coordinate i by coordinate j (i, j, cells, q)."""
        at = self._at(X, tind)
        if at.inverse is None:
            at = self._kept = at._replace(inverse=super().invDF(X, tind))
        return np.asarray(at.inverse)

    def F(self, X: Floats, tind: Any = None) -> Floats:  # noqa: N802 - as skfem's mappings
        """Points [m] (3, cells, q) at local coordinates."""
        nodes, dofs = self.mesh.doflocs, self.mesh.dofs.element_dofs
        dofs = dofs if tind is None else dofs[:, tind]
        found = np.zeros((3, dofs.shape[1], X.shape[-1]))
        for k, cells in enumerate(dofs):
            share = self.elem.lbasis(X, k)[0]
            for i in range(3):
                found[i] += nodes[i, cells][:, None] * share
        return found

    def invF(self, x: Floats, tind: Any = None, **_: Any) -> Floats:  # noqa: N802 - scikit-fem's
        """Local coordinates (3, cells, q) of points x [m] (3, cells, q), by Newton's method.

        ValueError without convergence. The last result is cached, as scikit-fem asks for it twice.
        """
        if self._found is not None and self._found[0] is x and np.array_equal(self._found[1], tind):
            return self._found[2]
        local, left = self.located(x, tind)
        if left.max() > NEWTON_TOLERANCE:
            raise ValueError("a curved tetrahedron is distorted; enlarge reference.element_size")
        self._found = x, tind, local
        return local

    def located(self, x: Floats, cells: Ints | None) -> tuple[Floats, Floats]:
        """Local coordinates of points that may lie outside their cells, and their error [m]."""
        corners = self.mesh.p[:, self.mesh.t if cells is None else self.mesh.t[:, cells]]
        edges = np.moveaxis(corners[:, 1:] - corners[:, :1], 2, 0)
        offset = np.moveaxis(x - corners[:, 0][:, :, None], 1, 0)
        local = np.moveaxis(np.linalg.solve(edges, offset), 0, 1)
        numbers = np.arange(local.shape[1]) if cells is None else cells
        left = np.arange(len(numbers))
        for _ in range(NEWTON_STEPS):
            near, among = local[:, left], numbers[left]
            off = x[:, left] - self.F(near, among)
            local[:, left] = near + np.einsum("ijqn,jqn->iqn", self.invDF(near, among), off)
            left = left[(np.abs(off) > SETTLED).any(axis=(0, 2))]
        return local, np.abs(x - self.F(local, cells)).max(axis=0)


class _Entities:
    """Edges and facets in the numbering of scikit-fem, found in a fraction of its time.

    scikit-fem sorts rows of vertex numbers, which numpy compares as bytes; here each row is encoded
    as one integer.
    """

    @staticmethod
    def build_entities(t: Any, indices: Any, sort: bool = True) -> Any:
        """Entities (vertices, e) in order, and those of each cell, by local `indices`."""
        count = int(t.max(initial=0)) + 1
        if indices is None or not sort or count ** len(indices[0]) > np.iinfo(np.int64).max:
            return skfem.MeshTet.build_entities(t, indices, sort)
        rows = np.sort(np.hstack([t[one] for one in indices]), axis=0)
        number = np.zeros(rows.shape[1], dtype=np.int64)
        for row in rows:
            number = count * number + row
        found, which = np.unique(number, return_inverse=True)
        ends = np.empty((len(rows), len(found)), dtype=t.dtype)
        for k in reversed(range(len(rows))):
            found, ends[k] = np.divmod(found, count)
        return ends, which.reshape(len(indices), t.shape[1])

    @staticmethod
    def build_inverse(t: Any, mapping: Any) -> Any:
        """First and last cell (2, e) of each entity; the last is -1 for an entity of one cell."""
        cells, entities = np.tile(np.arange(t.shape[1]), len(mapping)), mapping.ravel()
        found = np.zeros((2, mapping.max() + 1), dtype=np.int32)
        found[0, entities[::-1]] = cells[::-1]  # of several the last one stays
        found[1, entities] = cells
        found[1, found[0] == found[1]] = -1
        return found


class StraightGrid(_Entities, skfem.MeshTet):  # type: ignore[misc] # scikit-fem has no types
    """scikit-fem's tetrahedra with flat facets."""


class CurvedGrid(_Entities, skfem.MeshTet2):  # type: ignore[misc] # scikit-fem has no types
    """scikit-fem's tetrahedra with quadratic edges."""

    def on(self, nodes: Floats) -> CurvedGrid:
        """The same cells with other nodes [m] (3, n), reusing edges and facets."""
        found = CurvedGrid(nodes, self.t)
        _share(self, found)
        found._dofs = self.dofs
        return found


def _share(known: Any, other: Any) -> None:
    """Copy the edges and facets of a mesh to another with the same cells."""
    for name in ("_edges", "_t2e", "_facets", "_t2f", "_f2t"):
        if hasattr(known, name):
            setattr(other, name, getattr(known, name))


def mapping(grid: skfem.Mesh) -> skfem.mapping.Mapping:
    """Mapping from the reference cell to the cells of a grid."""
    if isinstance(grid, skfem.MeshTet2):
        return CurvedMapping(grid, grid.elem(), grid.bndelem)
    return grid.mapping()


def straight(mesh: TetrahedralMesh) -> skfem.MeshTet:
    """The mesh with flat facets."""
    return StraightGrid(
        np.ascontiguousarray(mesh.points.T), np.ascontiguousarray(mesh.tetrahedra.T)
    )


def curved(mesh: TetrahedralMesh, project: Projection) -> skfem.MeshTet2:
    """The mesh with quadratic geometry, its boundary edge nodes on the surface.

    `project` maps points [m] (n, 3) onto the surface. Where a tetrahedron would be distorted, as in
    a groove that the mesh does not resolve, its edge nodes move part of the way or not at all.
    """
    flat = straight(mesh)
    edges = flat.boundary_edges()
    first, last = flat.p[:, flat.edges[0, edges]].T, flat.p[:, flat.edges[1, edges]].T
    middle = 0.5 * (first + last)
    move = project(middle) - middle
    far = np.linalg.norm(move, axis=1) > FARTHEST * np.linalg.norm(last - first, axis=1)
    share = np.where(far, 0.0, 1.0)
    cells = np.flatnonzero(np.isin(flat.t2e, edges).any(axis=0))  # the others are straight
    corners = flat.p[:, flat.t[:, cells]]
    volumes = np.abs(np.linalg.det(np.moveaxis(corners[:, 1:] - corners[:, :1], 2, 0)))
    quadratic = CurvedGrid.from_mesh(flat)
    _share(flat, quadratic)
    for attempt in range(HALVINGS + 1):
        nodes = quadratic.doflocs.copy()
        nodes[:, flat.p.shape[1] + edges] = (middle + share[:, None] * move).T
        bent = quadratic.on(nodes)
        least = mapping(bent).detDF(_LOOKED_AT, cells).min(axis=1)
        distorted = cells[least < LEAST_JACOBIAN * volumes]
        if not len(distorted):
            return bent
        share[np.isin(edges, flat.t2e[:, distorted])] *= 0.5 if attempt < HALVINGS - 1 else 0.0
    return bent
