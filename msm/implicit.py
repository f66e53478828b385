"""Implicit Euler and midpoint integrators, compiled, by Newton's method with conjugate gradients.

Both solve for the velocity w with

    m (w - v) = h [f(u + h w) + load - c w]

where h = dt for Euler and dt/2 for midpoint, which then extrapolates to u + dt w and 2 w - v. The
nodal damping c is evaluated at u + h v, which keeps the order and leaves the equations symmetric
and solvable for any c. A step that does not converge to TOLERANCE sets the velocity to NaN, which
is reported as divergence.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from msm.external_loads import add_external_forces
from msm.forces import damping, internal_forces
from msm.kernel import kernel
from msm.network import Network
from msm.tangent import (
    Tangent,
    add_diagonal,
    add_product,
    empty_tangent,
    linearise,
    make_definite,
)

Floats = NDArray[np.float64]

TOLERANCE = 1e-9
"""Residual momentum of a step relative to the momenta and impulses in it."""
FORCING = 1e-2
"""Reduction of the residual by conjugate gradients per Newton iteration."""
NEWTON_STEPS = 100
HALVINGS = 8
SOLVER_STEPS = 3000


class Workspace(NamedTuple):
    """The unknown velocity `w` and work arrays, each (n, 3) but `inertia` [kg] (n,)."""

    w: Floats
    at: Floats
    residual: Floats
    correction: Floats
    remainder: Floats
    direction: Floats
    product: Floats
    diagonal: Floats
    inertia: Floats


@kernel(nogil=True)
def implicit_euler(
    law: Any, net: Network, factors: Floats, dt: float, u: Floats, v: Floats
) -> None:
    """Forces and load at the end of the step."""
    work, tangent = empty_workspace(u), empty_tangent(net)
    for n in range(factors.shape[0]):
        if not solve_step(law, net, dt, factors[n], u, v, work, tangent):
            work.w[:] = np.nan
        v[:] = work.w
        set_sum(u, dt, v, u)


@kernel(nogil=True)
def implicit_midpoint(
    law: Any, net: Network, factors: Floats, dt: float, u: Floats, v: Floats
) -> None:
    """Forces and load at the middle of the step."""
    work, tangent = empty_workspace(u), empty_tangent(net)
    for n in range(factors.shape[0]):
        if not solve_step(law, net, 0.5 * dt, factors[n], u, v, work, tangent):
            work.w[:] = np.nan
        set_sum(u, dt, work.w, u)
        v[:] = 2.0 * work.w - v


@kernel()
def empty_workspace(u: Floats) -> Workspace:
    """Arrays for a displacement of the shape of u."""
    a = np.empty((8, *u.shape))
    return Workspace(a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7], np.empty(u.shape[0]))


@kernel()
def solve_step(
    law: Any,
    net: Network,
    h: float,
    row: Floats,
    u: Floats,
    v: Floats,
    work: Workspace,
    tangent: Tangent,
) -> bool:
    """Set work.w to the velocity of the step; False without convergence."""
    work.w[:] = v
    set_sum(u, h, v, work.at)
    for i in range(u.shape[0]):
        work.inertia[i] = net.mass[i] + h * damping(net, work.at, i)
    size, scale = set_residual(law, net, h, row, u, v, work)
    for _ in range(NEWTON_STEPS):
        if size <= TOLERANCE * scale or not np.isfinite(size):
            break
        linearise(law, net, work.at, tangent)
        enough = max(0.5 * TOLERANCE * scale, 0.0 if net.linear else FORCING * size)
        if not correct(net, h, work, tangent, enough):
            make_definite(tangent)
            correct(net, h, work, tangent, enough)
        size, scale = search(law, net, h, row, u, v, work)
    return bool(size <= TOLERANCE * scale)


@kernel()
def set_residual(
    law: Any, net: Network, h: float, row: Floats, u: Floats, v: Floats, work: Workspace
) -> tuple[float, float]:
    """Set the residual momentum [N s] of w; return its norm and that of all its terms."""
    residual = work.residual
    set_sum(u, h, work.w, work.at)
    internal_forces(law, net, work.at, residual)
    add_external_forces(net.external, row, 0, residual.T)
    size, scale = 0.0, 0.0
    for i in range(u.shape[0]):
        for d in range(3):
            after, before = work.inertia[i] * work.w[i, d], net.mass[i] * v[i, d]
            internal, external = h * residual[i, d], h * row[0] * net.load[i, d]
            residual[i, d] = after - before - internal - external
            size += residual[i, d] ** 2
            scale += after**2 + before**2 + internal**2 + external**2
    return np.sqrt(size), np.sqrt(scale)


@kernel()
def search(
    law: Any, net: Network, h: float, row: Floats, u: Floats, v: Floats, work: Workspace
) -> tuple[float, float]:
    """Line search along the correction by halving; norm and scale of the residual at its end.

    The residual is the gradient of the incremental energy: its work along the correction is
    negative, and positive beyond the minimum (after Matthies and Strang 1979).
    """
    limit = -0.5 * dot(work.residual, work.correction)
    share = 1.0
    set_sum(work.w, 1.0, work.correction, work.w)
    size, scale = set_residual(law, net, h, row, u, v, work)
    for _ in range(HALVINGS):
        if dot(work.residual, work.correction) <= limit:  # false for NaN
            break
        share *= 0.5
        set_sum(work.w, -share, work.correction, work.w)
        size, scale = set_residual(law, net, h, row, u, v, work)
    return size, scale


@kernel()
def correct(net: Network, h: float, work: Workspace, tangent: Tangent, enough: float) -> bool:
    """Newton correction by conjugate gradients, to a residual norm of `enough`.

    False for a direction of zero or negative curvature. A residual that is too large after
    SOLVER_STEPS is left to the Newton iteration.
    """
    x, r, p, ap = work.correction, work.remainder, work.direction, work.product
    set_diagonal(net, h, work, tangent)
    x[:], p[:] = 0.0, 0.0
    r[:] = -work.residual
    along = next_direction(r, work.diagonal, np.inf, p)
    for _ in range(SOLVER_STEPS):
        if dot(r, r) <= enough * enough:
            break
        multiply(net, h, work, tangent)
        curvature = dot(p, ap)
        if curvature <= 0.0:
            return False
        step = along / curvature
        set_sum(x, step, p, x)
        set_sum(r, -step, ap, r)
        along = next_direction(r, work.diagonal, along, p)
    return True


@kernel()
def set_diagonal(net: Network, h: float, work: Workspace, tangent: Tangent) -> None:
    """Set the diagonal of the matrix of `multiply`, with indefinite parts left out."""
    for i in range(work.diagonal.shape[0]):
        work.diagonal[i] = work.inertia[i]
    add_diagonal(net, tangent, h * h, work.diagonal)


@kernel()
def multiply(net: Network, h: float, work: Workspace, tangent: Tangent) -> None:
    """Set product to (m + h c + h^2 K) direction."""
    for i in range(work.direction.shape[0]):
        for d in range(3):
            work.product[i, d] = work.inertia[i] * work.direction[i, d]
    add_product(net, tangent, work.direction, h * h, work.product)


@kernel()
def dot(a: Floats, b: Floats) -> float:
    """Sum of the products of the entries of a and b (n, 3)."""
    total = 0.0
    for i in range(a.shape[0]):
        total += a[i, 0] * b[i, 0] + a[i, 1] * b[i, 1] + a[i, 2] * b[i, 2]
    return total


@kernel()
def set_sum(x: Floats, share: float, y: Floats, out: Floats) -> None:
    """Set out (n, 3) to x + share y; it may be one of them."""
    for i in range(x.shape[0]):
        for d in range(3):
            out[i, d] = x[i, d] + share * y[i, d]


@kernel()
def next_direction(r: Floats, diagonal: Floats, before: float, p: Floats) -> float:
    """Set p to the next conjugate direction; return r^T D^-1 r."""
    along = 0.0
    for i in range(r.shape[0]):
        for d in range(3):
            along += r[i, d] ** 2 / diagonal[i, d]
    for i in range(r.shape[0]):
        for d in range(3):
            p[i, d] = r[i, d] / diagonal[i, d] + along / before * p[i, d]
    return along
