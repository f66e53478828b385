"""Internal forces of a lattice, compiled: springs, volume term and foundation.

Division by zero follows IEEE 754: a spring of zero length gives NaN, which the caller reports as
divergence.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from msm.hanging import share_out
from msm.kernel import inner_kernel, kernel
from msm.kinematics import gradient_of
from msm.laws import tension
from msm.network import Network

Floats = NDArray[np.float64]


@kernel()
def internal_forces(law: Any, net: Network, u: Floats, force: Floats) -> None:
    """Set the force [N] (n, 3) of springs, cells and foundation at the displacement u."""
    force[:] = 0.0
    if net.linear:
        add_linear_spring_forces(law, net, u, force)
        add_linear_volume_forces(net, u, force)
    else:
        add_spring_forces(law, net, u, force)
        add_volume_forces(net, u, force)
    add_foundation_forces(net, u, force)
    share_out(net, force)
    hold(net.fixed, force)


@inner_kernel()
def hold(fixed: Any, force: Floats) -> None:
    """Set a nodal vector to zero at the constrained components (f, 2)."""
    for f in range(fixed.shape[0]):
        force[fixed[f, 0], fixed[f, 1]] = 0.0


@kernel()
def add_spring_forces(law: Any, net: Network, u: Floats, force: Floats) -> None:
    """Add the force [N] of each spring at its two ends."""
    for s in range(net.ends.shape[0]):
        i, j = net.ends[s, 0], net.ends[s, 1]
        dx = net.rest[s, 0] + u[j, 0] - u[i, 0]
        dy = net.rest[s, 1] + u[j, 1] - u[i, 1]
        dz = net.rest[s, 2] + u[j, 2] - u[i, 2]
        length = np.sqrt(dx * dx + dy * dy + dz * dz)
        pull = net.scale[s] * tension(law, (length - net.length[s]) / net.length[s]) / length
        force[i, 0] += pull * dx
        force[i, 1] += pull * dy
        force[i, 2] += pull * dz
        force[j, 0] -= pull * dx
        force[j, 1] -= pull * dy
        force[j, 2] -= pull * dz


@inner_kernel()
def add_linear_spring_forces(law: Any, net: Network, u: Floats, force: Floats) -> None:
    """Add the spring forces [N] of small displacements, along the undeformed springs."""
    for s in range(net.ends.shape[0]):
        i, j = net.ends[s, 0], net.ends[s, 1]
        rx, ry, rz = net.rest[s, 0], net.rest[s, 1], net.rest[s, 2]
        squared = net.length[s] * net.length[s]
        along = rx * (u[j, 0] - u[i, 0]) + ry * (u[j, 1] - u[i, 1]) + rz * (u[j, 2] - u[i, 2])
        pull = net.scale[s] * tension(law, along / squared) / net.length[s]
        force[i, 0] += pull * rx
        force[i, 1] += pull * ry
        force[i, 2] += pull * rz
        force[j, 0] -= pull * rx
        force[j, 1] -= pull * ry
        force[j, 2] -= pull * rz


@inner_kernel()
def corner_shares(x: Any, y: Any, z: Any) -> Any:
    """Contributions of a stress row (x, y, z) to corners 0 to 3; those of 7 to 4 are opposite."""
    plus, minus = x + y, x - y
    return plus + z, plus - z, minus + z, minus - z


@inner_kernel()
def scatter(cell: Any, force: Floats, d: int, x: float, y: float, z: float) -> None:
    """Subtract the nodal forces along d of a stress with row (x, y, z), weights included."""
    c0, c1, c2, c3 = corner_shares(x, y, z)
    force[cell[0], d] += c0
    force[cell[1], d] += c1
    force[cell[2], d] += c2
    force[cell[3], d] += c3
    force[cell[4], d] -= c3  # and the corners across from them
    force[cell[5], d] -= c2
    force[cell[6], d] -= c1
    force[cell[7], d] -= c0


@inner_kernel()
def volume_change(cell: Any, u: Floats, to_gradient: float) -> Any:
    """J - 1 of a cell, and the rows of its cofactor matrix, J times the transposed inverse of F."""
    a, b, e = gradient_of(cell, u, 0, to_gradient)
    f, g, h = gradient_of(cell, u, 1, to_gradient)
    i, j, k = gradient_of(cell, u, 2, to_gradient)
    return cofactors(a, b, e, f, g, h, i, j, k)


@inner_kernel()
def cofactors(a: Any, b: Any, e: Any, f: Any, g: Any, h: Any, i: Any, j: Any, k: Any) -> Any:
    """J - 1 and the rows of the cofactor matrix of F, from the rows of F - 1."""
    # J - 1 as a difference of numbers near 1 would round to more than a small load where kappa
    # is large; hence the first cofactor without its 1.
    around = g + k + g * k - h * j
    swelling = a + (a + 1.0) * around
    a, g, k = a + 1.0, g + 1.0, k + 1.0
    x = 1.0 + around, h * i - f * k, f * j - g * i
    y = e * j - b * k, a * k - e * i, b * i - a * j
    z = b * h - e * g, e * f - a * h, a * g - b * f
    return swelling + b * x[1] + e * x[2], x, y, z


@inner_kernel()
def scatter_pressure(cell: Any, force: Floats, pressure: float, x: Any, y: Any, z: Any) -> None:
    """Subtract the nodal forces of a pressure on the cofactors of a cell, weights included."""
    scatter(cell, force, 0, pressure * x[0], pressure * x[1], pressure * x[2])
    scatter(cell, force, 1, pressure * y[0], pressure * y[1], pressure * y[2])
    scatter(cell, force, 2, pressure * z[0], pressure * z[1], pressure * z[2])


@inner_kernel()
def add_volume_forces(net: Network, u: Floats, force: Floats) -> None:
    """Add -kappa V (J - 1) cof(F) B_a for each corner a of each cell."""
    for c in range(net.cells.shape[0]):
        to_gradient = 0.25 / net.edges[c]
        swelling, x, y, z = volume_change(net.cells[c], u, to_gradient)
        swelling -= net.swollen[c]
        scatter_pressure(net.cells[c], force, net.bulk[c] * swelling * to_gradient, x, y, z)


@inner_kernel()
def add_linear_volume_forces(net: Network, u: Floats, force: Floats) -> None:
    """Add -kappa V div(u) B_a for each corner a of each cell."""
    for c in range(net.cells.shape[0]):
        to_gradient = 0.25 / net.edges[c]
        cell = net.cells[c]
        x, _, _ = gradient_of(cell, u, 0, to_gradient)
        _, y, _ = gradient_of(cell, u, 1, to_gradient)
        _, _, z = gradient_of(cell, u, 2, to_gradient)
        pressure = net.bulk[c] * (x + y + z) * to_gradient
        scatter(cell, force, 0, pressure, 0.0, 0.0)
        scatter(cell, force, 1, 0.0, pressure, 0.0)
        scatter(cell, force, 2, 0.0, 0.0, pressure)


@inner_kernel()
def add_foundation_forces(net: Network, u: Floats, force: Floats) -> None:
    """Subtract S u.

    The foundation is explicit like the springs: an implicit diagonal in its place would be stable
    at any stiffness, but would hold back motions of cut cells that S itself does not hold.
    """
    for i in range(u.shape[0]):
        x, y, z = 0.0, 0.0, 0.0
        for p in range(net.row[i], net.row[i + 1]):
            j, k = net.column[p], net.value[p]
            x, y, z = x + k * u[j, 0], y + k * u[j, 1], z + k * u[j, 2]
        force[i, 0] -= x
        force[i, 1] -= y
        force[i, 2] -= z


@inner_kernel()
def damping(net: Network, u: Floats, i: int) -> float:
    """Damping [N s/m] of a node, eq. (9), or eq. (2) with gamma_1 = 0."""
    away = np.sqrt(u[i, 0] ** 2 + u[i, 1] ** 2 + u[i, 2] ** 2)
    return net.gamma_0[i] + net.gamma_1[i] * away  # type: ignore[no-any-return] # numpy scalars
