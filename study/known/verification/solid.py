"""An unsupported body for problems with prescribed boundary, and its solution at rest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse import csc_array, eye_array, kron
from skfem.models.poisson import mass as product

from fem_reference.assembly import elastic, rows
from fem_reference.direct import factorised
from fem_reference.elasticity import FACET_ORDER
from fem_reference.elements import ELEMENTS, ElementName
from fem_reference.stiffness import Stiffness
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]
Field = Callable[[Floats], Floats]
"""Vectors (..., 3) at points [m] (..., 3)."""

FIELD_ORDER = 6
"""Quadrature degree for given fields, which are smooth within an element."""


@dataclass(frozen=True)
class Solid:
    """`nodes`: scikit-fem's basis of one component; `stiffness` without support [N/m]."""

    nodes: Any
    stiffness: Stiffness

    @property
    def points(self) -> Floats:
        """Positions [m] (nodes, 3)."""
        return np.ascontiguousarray(self.nodes.doflocs.T)


def solid(grid: Any, name: ElementName, tissue: Tissue) -> Solid:
    """The body on a mesh of scikit-fem's."""
    nodes = skfem.Basis(grid, ELEMENTS[name].shapes(), intorder=FIELD_ORDER)
    return Solid(nodes, elastic(grid, name, tissue))


def mass_matrix(body: Solid, density: float) -> csc_array:
    """Consistent mass [kg] (n, n)."""
    return csc_array(kron(product.assemble(body.nodes), density * eye_array(3)))


def weighed(basis: Any, density: Callable[[Any], Floats]) -> Floats:
    """Nodal forces [N] (n,) of a force density (..., 3) per volume or area of the basis."""
    parts = [
        skfem.LinearForm(lambda v, w, d=d: density(w)[..., d] * v).assemble(basis) for d in range(3)
    ]
    return np.stack(parts, axis=1).ravel()


def body_force(body: Solid, force: Field) -> Floats:
    """Nodal forces [N] (n,) of a force per volume [N/m^3]."""
    return weighed(body.nodes, lambda w: force(rows(w.x)))


def surface_force(body: Solid, traction: Callable[[Floats, Floats], Floats]) -> Floats:
    """Nodal forces [N] (n,) of a traction [Pa] (..., 3) at points with outward normals."""
    surface = skfem.FacetBasis(body.nodes.mesh, body.nodes.elem, intorder=FACET_ORDER)
    return weighed(surface, lambda w: traction(rows(w.x), rows(w.n)))


def restricted(stiffness: Stiffness, free: NDArray[np.bool_]) -> Stiffness:
    """Stiffness among the free displacements, the others held still."""
    matrix, pressure = csc_array(stiffness.matrix)[free][:, free], stiffness.pressure
    if pressure is None:
        return Stiffness(matrix)
    return Stiffness(matrix, replace(pressure, divergence=pressure.divergence[:, free]))


def at_rest(stiffness: Stiffness, load: Floats, prescribed: Floats) -> Floats:
    """Displacement [m] (n,) under a load; `prescribed` [m] (nodes, 3) is nan where it is free."""
    free = np.isnan(prescribed.ravel())
    u = np.where(free, 0.0, prescribed.ravel())
    among = restricted(stiffness, free)
    right = np.zeros(among.unknowns)
    right[: among.size] = (load - stiffness @ u)[free]
    u[free] = factorised(among.system())(right)[: among.size]
    return u


def free_everywhere(points: Floats) -> Floats:
    """Displacements (nodes, 3) without any prescribed component, to be filled in."""
    return np.full_like(points, np.nan)


def l2_error(nodes: Any, u: Floats, exact: Field) -> float:
    """Relative L2 error of a displacement [m] (n,) over the body."""
    there = exact(rows(nodes.global_coordinates()))
    ours = np.stack([np.asarray(nodes.interpolate(u[d::3])) for d in range(3)], axis=-1)
    squares = [float(((f**2).sum(axis=-1) * nodes.dx).sum()) for f in (ours - there, there)]
    return float(np.sqrt(squares[0] / squares[1]))


def largest_error(u: Floats, exact: Floats) -> float:
    """Largest distance of nodal displacements, over the largest displacement."""
    off, size = (np.linalg.norm(f.reshape(-1, 3), axis=1).max() for f in (u - exact.ravel(), exact))
    return float(off / size)
