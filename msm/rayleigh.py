"""The stiffness part of Rayleigh damping, b K: a dashpot on each spring, cell and foundation.

Each resists the rate of what it stores energy in: the length of a spring, the volume ratio J of a
cell. At rest that is b K v exactly. Away from rest it is b times the tangent without the part
that turns forces: that part would resist rotation, which must stay free. The mass part a M is
nodal: gamma_0 of `msm.damping`.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from msm.forces import (
    add_foundation_forces,
    add_linear_volume_forces,
    damping,
    gradient_of,
    internal_forces,
    scatter,
)
from msm.laws import stiffness
from msm.network import Network

Floats = NDArray[np.float64]


def step_limit(omega: float, mass_damping: float, stiffness_damping: float) -> float:
    """Largest stable step [s] of `symplectic_euler_rayleigh` at the largest frequency [rad/s].

    The stiffness part b [s] is explicit and shortens the step of 2 / omega; the mass part a [1/s]
    is implicit and lengthens it: (2 / omega) (sqrt(1 + d^2) - d), d = (b omega - a / omega) / 2.
    """
    d = 0.5 * (stiffness_damping * omega - mass_damping / omega)
    return 2.0 / omega * float(np.hypot(1.0, d) - d)


@numba.njit(cache=True, error_model="numpy", nogil=True)
def symplectic_euler_rayleigh(
    law: Any,
    net: Network,
    stiffness_damping: float,
    factors: Floats,
    dt: float,
    u: Floats,
    v: Floats,
) -> None:
    """`msm.explicit.symplectic_euler` with the stiffness part b [s], at the start of the step."""
    force = np.empty_like(u)
    for n in range(factors.shape[0]):
        internal_forces(law, net, u, force)
        add_stiffness_damping(law, net, u, stiffness_damping * v, force)
        for i in range(u.shape[0]):
            share = dt / net.mass[i]
            hold = 1.0 + share * damping(net, u, i)
            for d in range(3):
                pushed = force[i, d] + factors[n, 0] * net.load[i, d]
                v[i, d] = (v[i, d] + share * pushed) / hold
                u[i, d] += dt * v[i, d]


@numba.njit(cache=True, error_model="numpy")
def add_stiffness_damping(law: Any, net: Network, u: Floats, ahead: Floats, force: Floats) -> None:
    """Add the damping [N] (n, 3) of nodes at u with velocities v, `ahead` = b v [m]."""
    add_spring_damping(law, net, u, ahead, force)
    if net.linear:
        add_linear_volume_forces(net, ahead, force)
    else:
        add_volume_damping(net, u, ahead, force)
    add_foundation_forces(net, ahead, force)


@numba.njit(cache=True, error_model="numpy")
def add_spring_damping(law: Any, net: Network, u: Floats, ahead: Floats, force: Floats) -> None:
    """Add a dashpot along each spring, of b times its stiffness at the present strain."""
    for s in range(net.ends.shape[0]):
        i, j = net.ends[s, 0], net.ends[s, 1]
        x, y, z = net.rest[s, 0], net.rest[s, 1], net.rest[s, 2]
        dx, dy, dz = u[j, 0] - u[i, 0], u[j, 1] - u[i, 1], u[j, 2] - u[i, 2]
        if net.linear:
            strain = (x * dx + y * dy + z * dz) / net.length[s] ** 2
        else:
            x, y, z = x + dx, y + dy, z + dz
            strain = np.sqrt(x * x + y * y + z * z) / net.length[s] - 1.0
        growth = (
            x * (ahead[j, 0] - ahead[i, 0])
            + y * (ahead[j, 1] - ahead[i, 1])
            + z * (ahead[j, 2] - ahead[i, 2])
        ) / (x * x + y * y + z * z)
        pull = net.scale[s] / net.length[s] * stiffness(law, strain) * growth
        force[i, 0] += pull * x
        force[i, 1] += pull * y
        force[i, 2] += pull * z
        force[j, 0] -= pull * x
        force[j, 1] -= pull * y
        force[j, 2] -= pull * z


@numba.njit(cache=True, error_model="numpy")
def add_volume_damping(net: Network, u: Floats, ahead: Floats, force: Floats) -> None:
    """Add -kappa V b (dJ/dt) cof(F) B_a for each corner a of each cell; dJ/dt = cof(F) : dF/dt."""
    to_gradient = 0.25 / net.spacing
    for c in range(net.cells.shape[0]):
        cell = net.cells[c]
        a, b, e = gradient_of(cell, u, 0, to_gradient)
        f, g, h = gradient_of(cell, u, 1, to_gradient)
        i, j, k = gradient_of(cell, u, 2, to_gradient)
        a, g, k = a + 1.0, g + 1.0, k + 1.0
        xx, xy, xz = g * k - h * j, h * i - f * k, f * j - g * i
        yx, yy, yz = e * j - b * k, a * k - e * i, b * i - a * j
        zx, zy, zz = b * h - e * g, e * f - a * h, a * g - b * f
        a, b, e = gradient_of(cell, ahead, 0, to_gradient)
        f, g, h = gradient_of(cell, ahead, 1, to_gradient)
        i, j, k = gradient_of(cell, ahead, 2, to_gradient)
        growth = a * xx + b * xy + e * xz + f * yx + g * yy + h * yz + i * zx + j * zy + k * zz
        pressure = net.bulk[c] * growth * to_gradient
        scatter(cell, force, 0, pressure * xx, pressure * xy, pressure * xz)
        scatter(cell, force, 1, pressure * yx, pressure * yy, pressure * yz)
        scatter(cell, force, 2, pressure * zx, pressure * zy, pressure * zz)
