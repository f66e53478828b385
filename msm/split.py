"""Semi-implicit Euler with an implicit volume term, for nearly incompressible tissue.

Near nu = 1/2 the volume term alone limits the explicit step. Here springs, foundation and load act
as in symplectic Euler, which gives v*; then the pressures act on the volume at the end of the step:

    m (v - v*) = -dt G^T p,   p = kappa V [J(u) - 1 + dt G v],   G = dJ/du

Substituting v in p leaves one equation per cell, symmetric and positive definite for every kappa,
which conjugate gradients solve. Springs and foundation alone limit the step. As in every implicit
Euler method, fast changes of volume are damped. J is linearised once per step.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from msm.external_loads import add_external_forces, apply_tool_contact
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
from msm.tangent import Tangent, corner_slope, empty_tangent, linearise_cells

Floats = NDArray[np.float64]

TOLERANCE = 1e-4
"""Relative residual of the pressures in a step. The remaining volume error enters the next step and
does not accumulate: a tighter tolerance changed displacements by less than 1e-5, for up to four
times the cost."""
SOLVER_STEPS = 3000


@kernel(nogil=True)
def split_volume(law: Any, net: Network, factors: Floats, dt: float, u: Floats, v: Floats) -> None:
    """Explicit springs, implicit nodal damping and pressure, then u += dt v."""
    force, inertia = np.empty_like(u), np.empty(u.shape[0])
    at, pressure = empty_tangent(net), np.empty((6, net.cells.shape[0]))
    for n in range(factors.shape[0]):
        other_forces(law, net, u, force)
        add_external_forces(net.external, factors[n], 0, force.T)
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
        apply_tool_contact(net.external, factors[n], dt, u.T, v.T)


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
    """Set work[0] to q (c,), the pressure over s = sqrt(kappa V); False without convergence.

    Scaled by s, the equation (1 + s dt^2 G M^-1 G^T s) q = s (J - 1 + dt G v) is regular for
    kappa = 0 too. The start value is the pressure of the volume at the start of the step.
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
    """Set out (c,) to the diagonal of the matrix of `multiply`."""
    for c in range(net.cells.shape[0]):
        out[c] = 1.0
        for a in range(8):
            share = dt * dt * net.bulk[c] / (inertia[net.cells[c, a]] * net.edges[c] ** 2)
            for d in range(3):
                out[c] += share * corner_slope(at.cofactor[c], a, d) ** 2
