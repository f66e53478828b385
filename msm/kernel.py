"""The hot loop: symplectic Euler with all nodal damping implicit.

    f = factor(t) load - springs(u_n) - S u_n
    v_(n+1) = (v_n + dt f / m) / (1 + dt c(u_n) / m)
    u_(n+1) = u_n + dt v_(n+1)

c = gamma_0 + gamma_1 |u| is the nodal damping of eq. (9) (of eq. (2) with gamma_1 = 0). S is the
elastic foundation, explicit like the springs: an implicit diagonal in its place would be stable at
any stiffness, but would hold back motions of cut cells that S itself does not hold. First order in
dt.

Division by zero follows IEEE (`error_model`): a spring pressed to a point gives NaN, which the
caller reports as divergence, and not an exception.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numba
import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from msm.laws import TENSIONS, tension

Floats = NDArray[np.float64]
ORDER = 1


class Network(NamedTuple):
    """Arrays of the kernel: springs, nodes, foundation.

    `ends` (s, 2) int32; `rest` [m] (s, 3); `length` [m] (s,); `scale` [m] (s,), weight times rest
    length; `mass` [kg], `gamma_0` [N s/m], `gamma_1` [N s/m^2], each (n,);
    `row`, `column`, `value` [N/m]: compressed rows of the foundation; `load` [N] (n, 3).
    """

    ends: NDArray[np.int32]
    rest: Floats
    length: Floats
    scale: Floats
    mass: Floats
    gamma_0: Floats
    gamma_1: Floats
    row: NDArray[np.int32]
    column: NDArray[np.int32]
    value: Floats
    load: Floats


@overload(tension)
def _compiled_tension(law: Any, strain: Any) -> Callable[..., Any] | None:  # noqa: ARG001 - typed by law alone
    """Choose the tension by the type of the law, when the kernel is compiled."""
    return TENSIONS.get(getattr(law, "instance_class", type(None)))


@numba.njit(cache=True, error_model="numpy")
def advance(law: Any, net: Network, factors: Floats, dt: float, u: Floats, v: Floats) -> None:
    """Take one step of `dt` [s] per load factor, in place."""
    force = np.empty_like(u)
    for n in range(factors.size):
        for i in range(u.shape[0]):
            for d in range(3):
                force[i, d] = factors[n] * net.load[i, d]
        add_spring_forces(law, net, u, force)
        add_foundation_forces(net, u, force)
        move(net, dt, force, u, v)


@numba.njit(cache=True, error_model="numpy")
def add_spring_forces(law: Any, net: Network, u: Floats, force: Floats) -> None:
    """Add the force [N] of each spring to its two ends."""
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


@numba.njit(cache=True, error_model="numpy")
def add_foundation_forces(net: Network, u: Floats, force: Floats) -> None:
    """Subtract S u."""
    for i in range(u.shape[0]):
        for p in range(net.row[i], net.row[i + 1]):
            j = net.column[p]
            for d in range(3):
                force[i, d] -= net.value[p] * u[j, d]


@numba.njit(cache=True, error_model="numpy")
def move(net: Network, dt: float, force: Floats, u: Floats, v: Floats) -> None:
    """Update velocity, then position."""
    for i in range(u.shape[0]):
        away = np.sqrt(u[i, 0] ** 2 + u[i, 1] ** 2 + u[i, 2] ** 2)
        c = net.gamma_0[i] + net.gamma_1[i] * away  # Eq. (9)
        share = dt / net.mass[i]
        hold = 1.0 + share * c
        for d in range(3):
            v[i, d] = (v[i, d] + share * force[i, d]) / hold
            u[i, d] += dt * v[i, d]
