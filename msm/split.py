"""Symplectic Euler with the volume term implicit, for tissue that is nearly incompressible.

Near nu = 1/2 only the volume term makes the explicit step short. Here springs, foundation and load
act as in symplectic Euler, and the cells then push back on the volume that they would have:

    m (v - v*) = -dt G^T p,   p = kappa V [J(u) - 1 + dt G v],   G = dJ/du

With v put into p, one equation per cell is left, symmetric and positive definite for every kappa,
solved by conjugate gradients. The step is bounded by springs and foundation alone. The price, as
with every implicit Euler: fast changes of volume are damped. J is linearised once per step.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from msm.forces import (
    add_foundation_forces,
    add_linear_spring_forces,
    add_spring_forces,
    damping,
    hold,
    scatter,
)
from msm.kernel import kernel
from msm.kinematics import gradient_of
from msm.network import Network
from msm.outer import add_outer_forces, stop_at_tools
from msm.tangent import Tangent, corner_slope, empty_tangent, linearise_cells

Floats = NDArray[np.float64]

TOLERANCE = 1e-4
"""Of the pressures in a step, relative. The volume that it leaves is seen by the next step and does
not add up: a tighter one changed displacements by less than 1e-5, for up to four times the cost."""
SOLVER_STEPS = 3000


@kernel(nogil=True)
def split_volume(law: Any, net: Network, factors: Floats, dt: float, u: Floats, v: Floats) -> None:
    """Springs kick, nodal damping and pressure act at the end of the step, then u += dt v."""
    force, inertia = np.empty_like(u), np.empty(u.shape[0])
    at, pressure = empty_tangent(net), np.empty((6, net.cells.shape[0]))
    for n in range(factors.shape[0]):
        other_forces(law, net, u, force)
        add_outer_forces(net.outer, factors[n], 0, force.T)
        for i in range(u.shape[0]):
            inertia[i] = net.mass[i] + dt * damping(net, u, i)
            for d in range(3):
                pushed = force[i, d] + factors[n, 0] * net.load[i, d]
                v[i, d] = (net.mass[i] * v[i, d] + dt * pushed) / inertia[i]
        linearise_cells(net, u, at)
        if not solve_pressure(net, at, inertia, dt, v, pressure, force):
            v[:] = np.nan
        spread_pressure(net, at, pressure[0], inertia, -dt, force)
        v += force
        u += dt * v
        stop_at_tools(net.outer, factors[n], dt, u.T, v.T)


@kernel()
def other_forces(law: Any, net: Network, u: Floats, force: Floats) -> None:
    """Set the forces [N] (n, 3) of springs and foundation."""
    force[:] = 0.0
    if net.linear:
        add_linear_spring_forces(law, net, u, force)
    else:
        add_spring_forces(law, net, u, force)
    add_foundation_forces(net, u, force)
    hold(net.fixed, force)


@kernel()
def solve_pressure(
    net: Network,
    at: Tangent,
    inertia: Floats,
    dt: float,
    v: Floats,
    work: Floats,
    nodal: Floats,
) -> bool:
    """Set work[0] to q (c,), the pressure over the root of kappa V; False if it was not found.

    In q the equation is (1 + s dt^2 G M^-1 G^T s) q = s (J - 1 + dt G v), with s the root of
    kappa V: fit for kappa = 0 too. The first guess is the pressure of the volume as it is.
    """
    q, r, p = work[0], work[1], work[2]
    ap, diagonal, rates = work[3], work[4], work[5]
    set_diagonal(net, at, inertia, dt, diagonal)
    set_rates(net, at, v, dt, rates)
    size = 0.0
    for c in range(q.shape[0]):
        root = np.sqrt(net.bulk[c])
        q[c] = root * at.swelling[c]
        r[c] = q[c] + root * rates[c]
        size += r[c] ** 2
    multiply(net, at, q, inertia, dt, nodal, rates, ap)
    r -= ap
    p[:] = r / diagonal
    along = np.dot(r, p)
    for _ in range(SOLVER_STEPS):
        if np.dot(r, r) <= TOLERANCE**2 * size:
            return True
        multiply(net, at, p, inertia, dt, nodal, rates, ap)
        step = along / np.dot(p, ap)
        q += step * p
        r -= step * ap
        before = along
        along = np.dot(r, r / diagonal)
        p[:] = r / diagonal + along / before * p
    return False


@kernel()
def multiply(
    net: Network,
    at: Tangent,
    q: Floats,
    inertia: Floats,
    dt: float,
    nodal: Floats,
    rates: Floats,
    out: Floats,
) -> None:
    """Set out to (1 + s dt^2 G M^-1 G^T s) q."""
    spread_pressure(net, at, q, inertia, dt, nodal)
    set_rates(net, at, nodal, dt, rates)
    for c in range(q.shape[0]):
        out[c] = q[c] + np.sqrt(net.bulk[c]) * rates[c]


@kernel()
def spread_pressure(
    net: Network, at: Tangent, q: Floats, inertia: Floats, share: float, out: Floats
) -> None:
    """Set out (n, 3) to share M^-1 G^T s q, the velocities [m/s] that the pressures give."""
    out[:] = 0.0
    for c in range(net.cells.shape[0]):
        to_gradient = 0.25 / net.edges[c]
        g = at.cofactor[c]
        push = -to_gradient * np.sqrt(net.bulk[c]) * q[c]
        for d in range(3):
            scatter(net.cells[c], out, d, push * g[d, 0], push * g[d, 1], push * g[d, 2])
    for i in range(out.shape[0]):
        for d in range(3):
            out[i, d] *= share / inertia[i]
    hold(net.fixed, out)


@kernel()
def set_rates(net: Network, at: Tangent, v: Floats, share: float, rates: Floats) -> None:
    """Set rates (c,) to share G v."""
    for c in range(net.cells.shape[0]):
        to_gradient = 0.25 / net.edges[c]
        rates[c] = 0.0
        for d in range(3):
            g = at.cofactor[c, d]
            x, y, z = gradient_of(net.cells[c], v, d, to_gradient)
            rates[c] += share * (x * g[0] + y * g[1] + z * g[2])


@kernel()
def set_diagonal(net: Network, at: Tangent, inertia: Floats, dt: float, out: Floats) -> None:
    """Set out (c,) to the diagonal of what `multiply` multiplies with."""
    for c in range(net.cells.shape[0]):
        out[c] = 1.0
        for a in range(8):
            share = dt * dt * net.bulk[c] / (inertia[net.cells[c, a]] * net.edges[c] ** 2)
            for d in range(3):
                out[c] += share * corner_slope(at.cofactor[c], a, d) ** 2
