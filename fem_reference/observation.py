"""Observed quantities of a body: displacement at points, largest strain and rotation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from fem_reference.elasticity import Body, Outline
from fem_reference.grid import NEWTON_TOLERANCE, CurvedMapping
from study.mesh.locate import locate

Floats = NDArray[np.float64]

LEAST_SHARE = 0.3
"""Share of the largest squared strain norm below which a strain cannot have the largest
principal value."""

CELLS = 4096
"""Cells per batch, which avoids a second field of the size of the gradients."""


def evaluation(body: Body | Outline, points: Floats) -> csr_array:
    """Interpolation matrix (q, nodes) from nodal values to points [m] (q, 3)."""
    basis = body.nodes
    cells, barycentric = locate(body.mesh, points)
    local = np.ascontiguousarray(barycentric[:, 1:].T)[:, :, None]
    if isinstance(basis.mapping, CurvedMapping):
        bent = np.flatnonzero(basis.mapping.bent[cells])
        found, off = basis.mapping.located(points[bent].T[:, :, None], cells[bent])
        # The few points outside a strongly curved face keep the coordinates of the straight cell.
        local[:, bent] = np.where(off < NEWTON_TOLERANCE, found, local[:, bent])
    values = [np.asarray(basis.elem.lbasis(local, k)[0])[..., 0] for k in range(basis.Nbfun)]
    columns = basis.element_dofs[:, cells]
    rows = np.broadcast_to(np.arange(len(points)), columns.shape)
    entries = (np.concatenate(values), (rows.ravel(), columns.ravel()))
    return csr_array(coo_array(entries, shape=(len(points), basis.N)))


def at_points(matrix: csr_array, u: Floats) -> Floats:
    """Displacement [m] (q, 3) at the points of an interpolation matrix."""
    return np.asarray(matrix @ u.reshape(-1, 3))


def carried(vectors: Floats, body: Body | Outline, other: Body) -> Floats:
    """Nodal vectors (n, k) of a body, interpolated to another mesh of the same organ."""
    matrix = evaluation(body, other.points)
    by_node = vectors.reshape(matrix.shape[1], -1)
    return np.asarray(matrix @ by_node).reshape(-1, vectors.shape[1])


def largest_strain(body: Body, u: Floats) -> float:
    """Largest absolute principal strain at the integration points."""
    return strain_and_rotation(body, u)[0]


def largest_rotation(body: Body, u: Floats) -> float:
    """Largest infinitesimal rotation [rad] at the integration points."""
    return strain_and_rotation(body, u)[1]


def strain_and_rotation(body: Body, u: Floats) -> tuple[float, float]:
    """Largest absolute principal strain, and largest infinitesimal rotation [rad]."""
    gradient = _gradient(body, u)
    parts = [gradient[start : start + CELLS] for start in range(0, len(gradient), CELLS)]
    found = np.max([(_largest_strain(one), _largest_rotation(one)) for one in parts], axis=0)
    return float(found[0]), float(found[1])


def _largest_strain(gradient: Floats) -> float:
    strain = 0.5 * (gradient + np.swapaxes(gradient, -2, -1))
    size = np.einsum("...ij,...ij->...", strain, strain)
    # A principal strain is at most the norm, and the square of the largest at least a third of
    # the squared norm.
    large = ~(size < LEAST_SHARE * size.max())
    return float(np.abs(np.linalg.eigvalsh(strain[large])).max())


def _largest_rotation(gradient: Floats) -> float:
    turn = gradient - np.swapaxes(gradient, -2, -1)
    return float(np.sqrt((turn**2).sum(axis=(-2, -1)).max() / 8.0))


def _gradient(body: Body, u: Floats) -> Floats:
    """Displacement gradient (cells, points, 3, 3)."""
    parts = [np.asarray(body.nodes.interpolate(u[d::3]).grad) for d in range(3)]
    return np.moveaxis(np.stack(parts), (0, 1), (-2, -1))
