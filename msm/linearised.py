"""Tangent stiffness of single springs and cells at a displacement, and bounds of frequencies.

A spring of length l under tension T has its tangent stiffness along its axis and the geometric
stiffness T / l across it, which is negative under compression. The force of a cell changes by
kappa V [(cof F : G) cof F + (J - 1) dcof F[G]] for a displacement gradient G. `msm.tangent` stores
them for a whole lattice.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from msm.hanging import share_out_values
from msm.kernel import inner_kernel, kernel
from msm.kinematics import cross, deformation, dot
from msm.laws import stiffness, tension
from msm.network import Network

Floats = NDArray[np.float64]


@inner_kernel()
def spring_state(law: Any, net: Network, u: Floats, s: int) -> Any:
    """Direction, axial and transverse stiffness [N/m] of a spring at the displacement u."""
    i, j = net.ends[s, 0], net.ends[s, 1]
    rx, ry, rz = net.rest[s, 0], net.rest[s, 1], net.rest[s, 2]
    dx, dy, dz = u[j, 0] - u[i, 0], u[j, 1] - u[i, 1], u[j, 2] - u[i, 2]
    weight = net.scale[s] / net.length[s]
    if net.linear:
        inverse = 1.0 / net.length[s]
        strain = (rx * dx + ry * dy + rz * dz) * inverse * inverse
        return rx * inverse, ry * inverse, rz * inverse, weight * stiffness(law, strain), 0.0
    rx, ry, rz = rx + dx, ry + dy, rz + dz
    length = np.sqrt(rx * rx + ry * ry + rz * rz)
    strain = (length - net.length[s]) / net.length[s]
    across = net.scale[s] * tension(law, strain) / length
    along = weight * stiffness(law, strain)
    return rx / length, ry / length, rz / length, along, across


@kernel()
def nodal_bounds(law: Any, net: Network, u: Floats, bound: Floats) -> None:
    """Set nodal values [1/s^2] (n,) whose maximum is an upper bound of omega_max^2 at u.

    Each term of the energy is bounded by squares of the nodal displacements: a spring by
    sigma |x_i - x_j|^2 <= 2 sigma (|x_i|^2 + |x_j|^2), sigma its larger stiffness; a cell by
    kappa V (|cof F|^2 + sqrt(3) |J - 1| |F|) |G|^2 with |G|^2 <= sum |x_a|^2 / (2 h^2); the
    foundation by its row sums; the square at a hanging node by the mean of its masters'.
    """
    bound[:] = 0.0
    for s in range(net.ends.shape[0]):
        _, _, _, along, across = spring_state(law, net, u, s)
        stiffer = 2.0 * max(along, across, 0.0)
        bound[net.ends[s, 0]] += stiffer
        bound[net.ends[s, 1]] += stiffer
    for c in range(net.cells.shape[0]):
        stiffer = net.bulk[c] * cell_growth(net, c, u) / (2.0 * net.edges[c] ** 2)
        for a in range(8):
            bound[net.cells[c, a]] += stiffer
    for i in range(u.shape[0]):
        for p in range(net.row[i], net.row[i + 1]):
            bound[i] += abs(net.value[p])
    share_out_values(net, bound)
    for i in range(u.shape[0]):
        bound[i] /= net.mass[i]


@inner_kernel()
def cell_growth(net: Network, c: int, u: Floats) -> Any:
    """Bound of the derivative of a cell's stress by F, over kappa: 3 at rest."""
    if net.linear:
        return 3.0
    f, g, h = deformation(net.cells[c], net.edges[c], u)
    gh, hf, fg = cross(g, h), cross(h, f), cross(f, g)
    cofactor = dot(gh, gh) + dot(hf, hf) + dot(fg, fg)
    size = np.sqrt(dot(f, f) + dot(g, g) + dot(h, h))
    return cofactor + np.sqrt(3.0) * abs(dot(f, gh) - 1.0 - net.swollen[c]) * size


@kernel()
def farthest(u: Floats) -> tuple[float, int]:
    """Largest absolute component [m] of u (n, 3) and its node; NaN counts as infinite."""
    size, node = 0.0, 0
    for i in range(u.shape[0]):
        for d in range(3):
            if not np.isfinite(u[i, d]):
                return np.inf, i
            if abs(u[i, d]) > size:
                size, node = abs(u[i, d]), i
    return size, node


@kernel()
def largest_vector_change(net: Network, u: Floats, before: Floats) -> float:
    """Largest change of a spring vector between two displacements [m], over its rest length."""
    largest = 0.0
    for s in range(net.ends.shape[0]):
        i, j = net.ends[s, 0], net.ends[s, 1]
        squared = 0.0
        for d in range(3):
            squared += (u[j, d] - u[i, d] - before[j, d] + before[i, d]) ** 2
        largest = max(largest, squared / net.length[s] ** 2)
    return float(np.sqrt(largest))


@kernel()
def largest_strain(net: Network, u: Floats) -> float:
    """Largest absolute strain of a spring at the displacement u [m] (n, 3)."""
    largest = 0.0
    for s in range(net.ends.shape[0]):
        i, j = net.ends[s, 0], net.ends[s, 1]
        squared = 0.0
        for d in range(3):
            squared += (net.rest[s, d] + u[j, d] - u[i, d]) ** 2
        largest = max(largest, abs(np.sqrt(squared) / net.length[s] - 1.0))
    return largest
