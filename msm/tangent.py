"""Tangent stiffness stored at one displacement, for iterative solvers.

The stiffness of each spring and cell (`msm.linearised`) is stored, so that a product needs neither
square roots nor divisions, and terms that can make the tangent indefinite can be left out.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from msm.forces import hold, scatter
from msm.hanging import share_out
from msm.kernel import inner_kernel, kernel
from msm.kinematics import cross, dot, gradient_of
from msm.linearised import spring_state
from msm.network import Network

Floats = NDArray[np.float64]

SIGNS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
"""B_a of corner a, times 4 h; in the order of msm.lattice.CORNERS."""


class Tangent(NamedTuple):
    """Tangent of springs and cells at a displacement.

    Springs: `direction` (s, 3), axial stiffness `along` and transverse stiffness `across` [N/m]
    (s,). Cells: `deformation` F and its `cofactor` (c, 3, 3); `swelling` (c,), J - 1 minus its
    stress-free value; `pressure` [J] (c,), kappa V times the swelling.
    """

    direction: Floats
    along: Floats
    across: Floats
    deformation: Floats
    cofactor: Floats
    swelling: Floats
    pressure: Floats


@kernel()
def empty_tangent(net: Network) -> Tangent:
    """Uninitialised arrays for the tangent of a lattice."""
    springs, cells = net.ends.shape[0], net.cells.shape[0]
    return Tangent(
        np.empty((springs, 3)),
        np.empty(springs),
        np.empty(springs),
        np.empty((cells, 3, 3)),
        np.empty((cells, 3, 3)),
        np.empty(cells),
        np.empty(cells),
    )


@kernel()
def linearise(law: Any, net: Network, u: Floats, at: Tangent) -> None:
    """Set the tangent at the displacement u [m] (n, 3)."""
    for s in range(net.ends.shape[0]):
        x, y, z, at.along[s], at.across[s] = spring_state(law, net, u, s)
        at.direction[s, 0], at.direction[s, 1], at.direction[s, 2] = x, y, z
    linearise_cells(net, u, at)


@inner_kernel()
def linearise_cells(net: Network, u: Floats, at: Tangent) -> None:
    """Set F, its cofactor matrix, the swelling and the pressure of each cell."""
    for c in range(net.cells.shape[0]):
        at.swelling[c] = deform(net, c, u, at.deformation[c], at.cofactor[c])
        at.pressure[c] = 0.0 if net.linear else net.bulk[c] * at.swelling[c]


@inner_kernel()
def deform(net: Network, c: int, u: Floats, f: Floats, g: Floats) -> Any:
    """Set F and its cofactor matrix (3, 3) of a cell; return the swelling.

    For a linear lattice these are F = 1 and div u.
    """
    for d in range(3):
        f[d, 0], f[d, 1], f[d, 2] = gradient_of(net.cells[c], u, d, 0.25 / net.edges[c])
    swelling = f[0, 0] + f[1, 1] + f[2, 2]
    if net.linear:
        f[:] = 0.0
    else:  # J - 1 without cancellation, as in `msm.forces`
        around = f[1, 1] * f[2, 2] - f[1, 2] * f[2, 1]
        swelling += f[0, 0] * (f[1, 1] + f[2, 2]) + (1.0 + f[0, 0]) * around
    for d in range(3):
        f[d, d] += 1.0
    for d in range(3):
        g[d, 0], g[d, 1], g[d, 2] = cross(f[(d + 1) % 3], f[(d + 2) % 3])
    if not net.linear:
        swelling += f[0, 1] * g[0, 1] + f[0, 2] * g[0, 2]
    return swelling - net.swollen[c]


@kernel()
def make_definite(at: Tangent) -> None:
    """Drop the terms that can make the tangent indefinite.

    These are the negative transverse stiffness of compressed springs, and the geometric stiffness
    of pressures. The remaining quadratic form is a sum of squares.
    """
    for s in range(at.across.shape[0]):
        at.across[s] = max(at.across[s], 0.0)
    at.pressure[:] = 0.0


@kernel()
def add_product(net: Network, at: Tangent, p: Floats, share: float, out: Floats) -> None:
    """Add `share` times the tangent times p (n, 3), with zeros at constrained components."""
    add_spring_product(net, at, p, share, out)
    add_cell_product(net, at, p, share, out)
    for i in range(p.shape[0]):
        for e in range(net.row[i], net.row[i + 1]):
            for d in range(3):
                out[i, d] += share * net.value[e] * p[net.column[e], d]
    share_out(net, out)
    hold(net.fixed, out)


@inner_kernel()
def add_spring_product(net: Network, at: Tangent, p: Floats, share: float, out: Floats) -> None:
    """Add the product of the springs."""
    for s in range(net.ends.shape[0]):
        i, j = net.ends[s, 0], net.ends[s, 1]
        nx, ny, nz = at.direction[s, 0], at.direction[s, 1], at.direction[s, 2]
        dx, dy, dz = p[j, 0] - p[i, 0], p[j, 1] - p[i, 1], p[j, 2] - p[i, 2]
        across = share * at.across[s]
        along = (share * at.along[s] - across) * (nx * dx + ny * dy + nz * dz)
        fx, fy, fz = across * dx + along * nx, across * dy + along * ny, across * dz + along * nz
        out[i, 0] -= fx
        out[i, 1] -= fy
        out[i, 2] -= fz
        out[j, 0] += fx
        out[j, 1] += fy
        out[j, 2] += fz


@inner_kernel()
def add_cell_product(net: Network, at: Tangent, p: Floats, share: float, out: Floats) -> None:
    """Add the product of the cells."""
    for c in range(net.cells.shape[0]):
        to_gradient = 0.25 / net.edges[c]
        cell, f, g = net.cells[c], at.deformation[c], at.cofactor[c]
        swelling = 0.0
        rate = (
            gradient_of(cell, p, 0, to_gradient),
            gradient_of(cell, p, 1, to_gradient),
            gradient_of(cell, p, 2, to_gradient),
        )
        for d in range(3):
            swelling += dot(rate[d], g[d])
        bulk = -share * to_gradient * net.bulk[c] * swelling
        turned = -share * to_gradient * at.pressure[c]
        for d in range(3):
            e, k = (d + 1) % 3, (d + 2) % 3
            a, b = cross(rate[e], f[k]), cross(f[e], rate[k])
            x = bulk * g[d, 0] + turned * (a[0] + b[0])
            y = bulk * g[d, 1] + turned * (a[1] + b[1])
            z = bulk * g[d, 2] + turned * (a[2] + b[2])
            scatter(cell, out, d, x, y, z)


@kernel()
def add_diagonal(net: Network, at: Tangent, share: float, out: Floats) -> None:
    """Add `share` times the diagonal (n, 3) of the tangent after `make_definite`."""
    for s in range(net.ends.shape[0]):
        across = max(at.across[s], 0.0)
        for d in range(3):
            k = across + (at.along[s] - across) * at.direction[s, d] ** 2
            out[net.ends[s, 0], d] += share * k
            out[net.ends[s, 1], d] += share * k
    for c in range(net.cells.shape[0]):
        for a in range(8):
            for d in range(3):
                slope = corner_slope(at.cofactor[c], a, d) / net.edges[c]
                out[net.cells[c, a], d] += share * net.bulk[c] * slope * slope
    for i in range(out.shape[0]):
        for e in range(net.row[i], net.row[i + 1]):
            if net.column[e] == i:
                for d in range(3):
                    out[i, d] += share * net.value[e]


@inner_kernel()
def corner_slope(cofactor: Floats, a: int, d: int) -> Any:
    """Derivative of J by the displacement of corner a along d, times h."""
    g = cofactor[d]
    return 0.25 * (SIGNS[a, 0] * g[0] + SIGNS[a, 1] * g[1] + SIGNS[a, 2] * g[2])
