"""Tetrahedra for scikit-fem, straight or with the curved boundary of a shape that is known."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import skfem
from numpy.typing import NDArray

from study.mesh.kinds import TetrahedralMesh

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Projection = Callable[[Floats], Floats]

FARTHEST = 0.2
"""Share of its edge that a node may move: beyond, the mesh does not follow the surface there."""
LEAST_JACOBIAN = 0.2
"""Of that of the straight tetrahedron, at its corners, edge nodes and centre."""
HALVINGS = 4
NEWTON_STEPS = 8
NEWTON_TOLERANCE = 1e-9
"""[m]"""
SETTLED = 1e-9
"""[m]; from so far off, a step of Newton's method goes as near as numbers do."""
# Corners, edge nodes and centre of the reference tetrahedron.
_CORNERS = np.vstack([np.zeros(3), np.eye(3)])
_EDGES = 0.5 * (_CORNERS[[0, 0, 0, 1, 1, 2]] + _CORNERS[[1, 2, 3, 2, 3, 3]])
_LOOKED_AT = np.ascontiguousarray(np.vstack([_CORNERS, _EDGES, np.full((1, 3), 0.25)]).T)


class CurvedMapping(skfem.MappingIsoparametric):  # type: ignore[misc] # scikit-fem has no types
    """scikit-fem's quadratic mapping with an inverse that starts in the straight cell.

    scikit-fem's own starts outside the cell and is held to a cube round it, so that it fails for
    some points of curved cells and for all beyond a face.
    """

    _kept: tuple[Any, Any, dict[tuple[int, int], Floats]] = (None, None, {})

    def J(self, i: int, j: int, X: Floats, tind: Any = None) -> Floats:  # noqa: N802 - its name
        """Derivative of coordinate i by local coordinate j, kept for the last points alone.

        scikit-fem keeps those of every step of Newton's method, as long as there is a mesh.
        """
        if self._kept[0] is not X or self._kept[1] is not tind:
            self._kept = (X, tind, {})
        known = self._kept[2]
        if (i, j) not in known:
            known[i, j] = self._J(i, j, X, tind)
        return known[i, j]

    def invF(self, x: Floats, tind: Any = None, **_: Any) -> Floats:  # noqa: N802 - scikit-fem's
        """Local coordinates (3, cells, q) of points x [m] (3, cells, q), by Newton's method.

        ValueError if a point has none.
        """
        local, left = self.located(x, tind)
        if left.max() > NEWTON_TOLERANCE:
            raise ValueError("a curved tetrahedron is distorted; enlarge reference.element_size")
        return local

    def located(self, x: Floats, cells: Ints | None) -> tuple[Floats, Floats]:
        """The same for cells and points that may not belong together, and how far off [m]."""
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


def mapping(grid: Any) -> Any:
    """What takes the reference cell to a grid's cells."""
    if isinstance(grid, skfem.MeshTet2):
        return CurvedMapping(grid, grid.elem(), grid.bndelem)
    return grid.mapping()


def straight(mesh: TetrahedralMesh) -> Any:
    """The mesh with flat facets."""
    return skfem.MeshTet(
        np.ascontiguousarray(mesh.points.T), np.ascontiguousarray(mesh.tetrahedra.T)
    )


def curved(mesh: TetrahedralMesh, project: Projection) -> Any:
    """The mesh with the middle nodes of its boundary edges on the surface: quadratic geometry.

    `project` takes points [m] (n, 3) to the surface. Where a tetrahedron would be distorted, as in
    a groove that the mesh is too coarse for, its edges stay straight, or half-way.
    """
    flat = straight(mesh)
    edges = flat.boundary_edges()
    first, last = flat.p[:, flat.edges[0, edges]].T, flat.p[:, flat.edges[1, edges]].T
    middle = 0.5 * (first + last)
    move = project(middle) - middle
    far = np.linalg.norm(move, axis=1) > FARTHEST * np.linalg.norm(last - first, axis=1)
    share = np.where(far, 0.0, 1.0)
    volumes = np.abs(
        np.linalg.det(np.moveaxis(flat.p[:, flat.t[1:]] - flat.p[:, flat.t[:1]], 2, 0))
    )
    for attempt in range(HALVINGS + 1):
        bent = _bent(flat, edges, middle + share[:, None] * move)
        distorted = mapping(bent).detDF(_LOOKED_AT).min(axis=1) < LEAST_JACOBIAN * volumes
        if not distorted.any():
            return bent
        share[np.isin(edges, flat.t2e[:, distorted])] *= 0.5 if attempt < HALVINGS - 1 else 0.0
    return bent


def _bent(flat: Any, edges: Ints, middle: Floats) -> Any:
    quadratic = skfem.MeshTet2.from_mesh(flat)
    nodes = quadratic.doflocs.copy()
    nodes[:, flat.p.shape[1] + edges] = middle.T
    return skfem.MeshTet2(nodes, quadratic.t)
