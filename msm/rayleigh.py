"""Stiffness part beta K of Rayleigh damping: a dashpot on each spring, cell and foundation.

Each dashpot resists the rate of the deformation that stores energy: the length of a spring, the
volume ratio J of a cell. At rest the damping is beta K v exactly. In a deformed state it is beta
times the material part of the tangent; the geometric part would resist rigid rotation. The mass
part alpha M is nodal: gamma_0 of `msm.damping`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from msm.forces import (
    add_foundation_forces,
    add_linear_volume_forces,
    hold,
    scatter_pressure,
    volume_change,
)
from msm.hanging import share_out
from msm.kernel import kernel
from msm.kinematics import dot, gradient_of
from msm.laws import stiffness
from msm.network import Network

Floats = NDArray[np.float64]


@kernel()
def add_stiffness_damping(law: Any, net: Network, u: Floats, ahead: Floats, force: Floats) -> None:
    """Add the damping [N] (n, 3) of nodes at u with velocities v, `ahead` = beta v [m]."""
    add_spring_damping(law, net, u, ahead, force)
    if net.linear:
        add_linear_volume_forces(net, ahead, force)
    else:
        add_volume_damping(net, u, ahead, force)
    add_foundation_forces(net, ahead, force)
    share_out(net, force)
    hold(net.fixed, force)


@kernel()
def add_spring_damping(law: Any, net: Network, u: Floats, ahead: Floats, force: Floats) -> None:
    """Add a dashpot along each spring, of beta times its stiffness at the current strain."""
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


@kernel()
def add_volume_damping(net: Network, u: Floats, ahead: Floats, force: Floats) -> None:
    """Add -beta kappa V (dJ/dt) cof(F) B_a for each corner a of a cell; dJ/dt = cof(F) : dF/dt."""
    for c in range(net.cells.shape[0]):
        to_gradient = 0.25 / net.edges[c]
        cell = net.cells[c]
        _, x, y, z = volume_change(cell, u, to_gradient)
        growth = (
            dot(x, gradient_of(cell, ahead, 0, to_gradient))
            + dot(y, gradient_of(cell, ahead, 1, to_gradient))
            + dot(z, gradient_of(cell, ahead, 2, to_gradient))
        )
        scatter_pressure(cell, force, net.bulk[c] * growth * to_gradient, x, y, z)
