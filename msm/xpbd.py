"""Extended position-based dynamics (XPBD), compiled: one sweep over the constraints per step.

After Macklin et al. (2016; in small steps 2019, doi 10.1145/3309486.3340247). The nodes move
freely; then each spring, each cell and each node on the foundation in turn is moved to its
position at the end of a step of implicit Euler with all others absent:

    C = length - rest length,  compliance 1 / (w k);   C = J - 1,  compliance 1 / (kappa V)

No unstable step of a linear lattice was found. The material softens with the step, in statics too,
and most in its stiffest parts: each constraint returns only 1 / (1 + (omega dt)^2) of its force,
where omega is its own frequency. Nodal damping enters as inertia m + dt c, as in implicit Euler.
Linear springs only.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from msm.external_loads import add_external_forces
from msm.forces import damping
from msm.kernel import kernel
from msm.laws import stiffness
from msm.network import Network
from msm.tangent import corner_slope, deform

Floats = NDArray[np.float64]


@kernel(nogil=True)
def xpbd(law: Any, net: Network, factors: Floats, dt: float, u: Floats, v: Floats) -> None:
    """One sweep over springs, cells and foundation per step; load at the end of the step."""
    inertia, before = np.empty(u.shape[0]), np.empty_like(u)
    work, external = np.empty((3, 8, 3)), np.empty_like(u)
    for n in range(factors.shape[0]):
        before[:], external[:] = u, 0.0
        add_external_forces(net.external, factors[n], 0, external.T)
        for i in range(u.shape[0]):
            inertia[i] = net.mass[i] + dt * damping(net, u, i)
            for d in range(3):
                momentum = net.mass[i] * v[i, d] + dt * factors[n, 0] * net.load[i, d]
                momentum += dt * external[i, d]
                u[i, d] += dt * momentum / inertia[i]
        project_springs(law, net, inertia, dt, u)
        project_cells(net, inertia, dt, u, work)
        project_foundation(net, inertia, dt, u)
        v[:] = (u - before) / dt


@kernel()
def project_springs(law: Any, net: Network, inertia: Floats, dt: float, u: Floats) -> None:
    """Project each spring."""
    k = stiffness(law, 0.0)
    for s in range(net.ends.shape[0]):
        i, j = net.ends[s, 0], net.ends[s, 1]
        rx, ry, rz = net.rest[s, 0], net.rest[s, 1], net.rest[s, 2]
        rest = net.length[s]
        dx, dy, dz = u[j, 0] - u[i, 0], u[j, 1] - u[i, 1], u[j, 2] - u[i, 2]
        if net.linear:
            length = rest
            stretch = (rx * dx + ry * dy + rz * dz) / rest
            dx, dy, dz = rx, ry, rz
        else:
            dx, dy, dz = rx + dx, ry + dy, rz + dz
            length = np.sqrt(dx * dx + dy * dy + dz * dz)
            stretch = length - rest
        compliance = rest / (net.scale[s] * k * dt * dt)
        pull = stretch / ((1.0 / inertia[i] + 1.0 / inertia[j] + compliance) * length)
        to_i, to_j = pull / inertia[i], pull / inertia[j]
        u[i, 0] += to_i * dx
        u[i, 1] += to_i * dy
        u[i, 2] += to_i * dz
        u[j, 0] -= to_j * dx
        u[j, 1] -= to_j * dy
        u[j, 2] -= to_j * dz


@kernel()
def project_cells(net: Network, inertia: Floats, dt: float, u: Floats, work: Floats) -> None:
    """Project the volume constraint of each cell."""
    f, g, slope = work[0, :3], work[1, :3], work[2]
    for c in range(net.cells.shape[0]):
        swelling = deform(net, c, u, f, g)
        give = 1.0 / (net.bulk[c] * dt * dt)
        for a in range(8):
            for d in range(3):
                slope[a, d] = corner_slope(g, a, d) / net.edges[c]
                give += slope[a, d] ** 2 / inertia[net.cells[c, a]]
        for a in range(8):
            i = net.cells[c, a]
            for d in range(3):
                u[i, d] -= swelling / give * slope[a, d] / inertia[i]


@kernel()
def project_foundation(net: Network, inertia: Floats, dt: float, u: Floats) -> None:
    """Project the foundation at each node in turn, with its neighbours fixed."""
    for i in range(u.shape[0]):
        for d in range(3):
            hold, own = 0.0, 0.0
            for e in range(net.row[i], net.row[i + 1]):
                hold += net.value[e] * u[net.column[e], d]
                own += net.value[e] if net.column[e] == i else 0.0
            u[i, d] -= dt * dt * hold / (inertia[i] + dt * dt * own)
