"""Energies of a lattice of linear springs, by array operations instead of the lattice's kernels.

`k` [N/m] is the stiffness of a spring of weight 1, that of `msm.laws.Hooke`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from msm.lattice import CORNERS
from msm.network import Network

Floats = NDArray[np.float64]


def kinetic(net: Network, v: Floats) -> float:
    """Kinetic energy [J] at velocities v [m/s] (n, 3)."""
    return float(0.5 * (net.mass[:, None] * v**2).sum())


def potential(k: float, net: Network, u: Floats) -> float:
    """Energy [J] of springs, cells and support at u [m] (n, 3), minus the work of the full load."""
    return springs(k, net, u) + cells(net, u) + support(net, u) - float((net.load * u).sum())


def springs(k: float, net: Network, u: Floats) -> float:
    """Strain energy [J] of the springs."""
    i, j = net.ends.T.astype(int)
    apart = u[j] - u[i]
    if net.linear:
        strain = (net.rest * apart).sum(axis=1) / net.length**2
    else:
        strain = np.linalg.norm(net.rest + apart, axis=1) / net.length - 1.0
    return float(0.5 * k * (net.scale * net.length * strain**2).sum())


def cells(net: Network, u: Floats) -> float:
    """Energy [J] of the volume term: (J - 1)^2 with J of the mean deformation gradient."""
    if not len(net.cells):
        return 0.0
    slopes = (2.0 * CORNERS - 1.0) / (4.0 * net.spacing)
    gradient = np.einsum("cad,ae->cde", u[net.cells.astype(int)], slopes)
    if net.linear:
        swelling = np.trace(gradient, axis1=1, axis2=2)
    else:
        swelling = np.linalg.det(np.eye(3) + gradient) - 1.0
    return float(0.5 * (net.bulk * swelling**2).sum())


def support(net: Network, u: Floats) -> float:
    """Strain energy [J] of the foundation."""
    entries = (net.value, net.column.astype(int), net.row.astype(int))
    matrix = csr_array(entries, shape=(len(u), len(u)))
    return float(0.5 * (u * (matrix @ u)).sum())
