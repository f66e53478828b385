"""Explicit integrators, compiled: symplectic Euler, velocity Verlet, Runge-Kutta of order 4.

Each takes one step per row of `factors`, whose columns are the load factors at the stages of the
integrator. Nodal damping is diagonal and treated implicitly where that keeps the order: at the end
of the step in symplectic Euler, in the first half of the step in velocity Verlet. Runge-Kutta
treats it explicitly, which limits its step. The stiffness part of Rayleigh damping is not diagonal;
symplectic Euler evaluates it at the start of the step.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from msm.external_loads import add_external_forces, apply_tool_contact
from msm.forces import damping, hold, internal_forces
from msm.hanging import interpolate, interpolate_both
from msm.kernel import kernel
from msm.network import Network
from msm.rayleigh import add_stiffness_damping

Floats = NDArray[np.float64]


@kernel(nogil=True)
def symplectic_euler(
    law: Any, net: Network, factors: Floats, dt: float, u: Floats, v: Floats
) -> None:
    """Step v += dt a(u) with implicit damping, then u += dt v; load at the end of the step."""
    force = np.empty_like(u)
    for n in range(factors.shape[0]):
        internal_forces(law, net, u, force)
        add_external_forces(net.external, factors[n], 0, force.T)
        if net.beta > 0.0:
            add_stiffness_damping(law, net, u, net.beta * v, force)
        for i in range(u.shape[0]):
            inertia = net.mass[i] + dt * damping(net, u, i)
            kept, share = net.mass[i] / inertia, dt / inertia
            for d in range(3):
                pushed = force[i, d] + factors[n, 0] * net.load[i, d]
                v[i, d] = kept * v[i, d] + share * pushed
                u[i, d] += dt * v[i, d]
        apply_tool_contact(net.external, factors[n], dt, u.T, v.T)
        hold(net.fixed, u)
        hold(net.fixed, v)
        interpolate_both(net, u, v)


@kernel(nogil=True)
def velocity_verlet(
    law: Any, net: Network, factors: Floats, dt: float, u: Floats, v: Floats
) -> None:
    """Half-step of v, step of u, half-step of v; damping implicit first, then explicit."""
    force = np.empty_like(u)
    internal_forces(law, net, u, force)
    for n in range(factors.shape[0]):
        if n == 0:
            add_external_forces(net.external, factors[n], 0, force.T)
        for i in range(u.shape[0]):
            inertia = net.mass[i] + 0.5 * dt * damping(net, u, i)
            kept, share = net.mass[i] / inertia, 0.5 * dt / inertia
            for d in range(3):
                pushed = force[i, d] + factors[n, 0] * net.load[i, d]
                v[i, d] = kept * v[i, d] + share * pushed
                u[i, d] += dt * v[i, d]
        interpolate_both(net, u, v)
        internal_forces(law, net, u, force)
        add_external_forces(net.external, factors[n], 1, force.T)
        for i in range(u.shape[0]):
            share = 0.5 * dt / net.mass[i]
            c = damping(net, u, i)
            for d in range(3):
                pushed = force[i, d] + factors[n, 1] * net.load[i, d]
                v[i, d] += share * (pushed - c * v[i, d])
        interpolate(net, v)


@kernel(nogil=True)
def runge_kutta_4(law: Any, net: Network, factors: Floats, dt: float, u: Floats, v: Floats) -> None:
    """The classical four stages."""
    force = np.empty_like(u)
    at, speed = np.empty_like(u), np.empty_like(u)
    du, dv = np.empty_like(u), np.empty_like(u)
    for n in range(factors.shape[0]):
        at[:], speed[:] = u, v
        du[:], dv[:] = 0.0, 0.0
        for stage in range(4):
            weight = dt / 6.0 if stage in (0, 3) else dt / 3.0
            ahead = 0.5 * dt if stage < 2 else dt
            factor = factors[n, (stage + 1) // 2]
            internal_forces(law, net, at, force)
            add_external_forces(net.external, factors[n], (stage + 1) // 2, force.T)
            for i in range(u.shape[0]):
                c = damping(net, at, i)
                for d in range(3):
                    rate = (force[i, d] + factor * net.load[i, d] - c * speed[i, d]) / net.mass[i]
                    du[i, d] += weight * speed[i, d]
                    dv[i, d] += weight * rate
                    if stage < 3:
                        at[i, d] = u[i, d] + ahead * speed[i, d]
                        speed[i, d] = v[i, d] + ahead * rate
            interpolate_both(net, at, speed)
        u += du
        v += dv
        interpolate_both(net, u, v)
