"""The explicit integrators of `msm.explicit` over a regular grid, compiled.

Each takes the motion (n, 3) of the nodes into the grid, takes its steps there and gives it back.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from msm.forces import hold
from msm.grid import Grid
from msm.grid_forces import add_internal_forces, add_stiffness_damping, damping
from msm.kernel import inner_kernel, kernel
from msm.outer import add_outer_forces, stop_at_tools
from msm.simd import every, load, store

Floats = NDArray[np.float64]


@kernel(nogil=True)
def symplectic_euler(
    law: Any, grid: Grid, factors: Floats, dt: float, u: Floats, v: Floats
) -> None:
    """V += dt a(u), damped at the end; then u += dt v. Load at the end of the step."""
    take_in(grid, u, v)
    set_shares(grid, dt)
    for n in range(factors.shape[0]):
        add_internal_forces(law, grid, grid.u, grid.force)
        add_outer_forces(grid.outer, factors[n], 0, grid.force)
        add_stiffness_damping(law, grid, grid.beta, grid.u, grid.v, grid.force)
        if grid.uneven:
            set_shares(grid, dt)
        kick_and_drift(grid, factors[n, 0], dt)
        stop_at_tools(grid.outer, factors[n], dt, grid.u, grid.v)
        hold(grid.fixed, grid.u)
        hold(grid.fixed, grid.v)
    give_back(grid, u, v)


@kernel(nogil=True)
def velocity_verlet(law: Any, grid: Grid, factors: Floats, dt: float, u: Floats, v: Floats) -> None:
    """Half a kick, a drift, half a kick; damping implicit in the first half, explicit after."""
    take_in(grid, u, v)
    set_shares(grid, 0.5 * dt)
    add_internal_forces(law, grid, grid.u, grid.force)
    for n in range(factors.shape[0]):
        if n == 0:
            add_outer_forces(grid.outer, factors[n], 0, grid.force)
        if grid.uneven:
            set_shares(grid, 0.5 * dt)
        kick_and_drift(grid, factors[n, 0], dt)
        add_internal_forces(law, grid, grid.u, grid.force)
        add_outer_forces(grid.outer, factors[n], 1, grid.force)
        kick_again(grid, factors[n, 1], 0.5 * dt)
    give_back(grid, u, v)


@kernel(nogil=True)
def runge_kutta_4(law: Any, grid: Grid, factors: Floats, dt: float, u: Floats, v: Floats) -> None:
    """The classical four stages."""
    take_in(grid, u, v)
    at, speed = grid.u.copy(), grid.v.copy()
    du, dv = np.zeros_like(at), np.zeros_like(at)
    for n in range(factors.shape[0]):
        for stage in range(4):
            weight = dt / 6.0 if stage in (0, 3) else dt / 3.0
            ahead = 0.5 * dt if stage < 2 else dt
            add_internal_forces(law, grid, at, grid.force)
            add_outer_forces(grid.outer, factors[n], (stage + 1) // 2, grid.force)
            for b in range(grid.start.shape[0]):
                c, i = damping(grid, at, b), grid.start[b]
                for d in range(3):
                    moving = load(speed, d, i, grid.lanes)
                    pushed = pushes(grid, b, d, factors[n, (stage + 1) // 2]) - c * moving
                    rate = pushed / load(grid.mass, b, 0, grid.lanes)
                    add_to(grid, du, d, i, weight * moving)
                    add_to(grid, dv, d, i, weight * rate)
                    store(at, d, i, load(grid.u, d, i, grid.lanes) + ahead * moving)
                    store(speed, d, i, load(grid.v, d, i, grid.lanes) + ahead * rate)
                    store(grid.force, d, i, every(0.0, grid.lanes))
        finish(grid, at, speed, du, dv)
    give_back(grid, u, v)


@inner_kernel()
def take_in(grid: Grid, u: Floats, v: Floats) -> None:
    """Set the motion in the grid to that of the nodes, beyond them to rest, forces to zero."""
    none = every(0.0, grid.lanes)
    for b in range(grid.start.shape[0]):
        for d in range(3):
            store(grid.u, d, grid.start[b], none)
            store(grid.v, d, grid.start[b], none)
            store(grid.force, d, grid.start[b], none)
    for n in range(grid.place.shape[0]):
        for d in range(3):
            grid.u[d, grid.place[n]] = u[n, d]
            grid.v[d, grid.place[n]] = v[n, d]


@inner_kernel()
def give_back(grid: Grid, u: Floats, v: Floats) -> None:
    """Set the motion of the nodes to that in the grid."""
    for n in range(grid.place.shape[0]):
        for d in range(3):
            u[n, d] = grid.u[d, grid.place[n]]
            v[n, d] = grid.v[d, grid.place[n]]


@inner_kernel()
def set_shares(grid: Grid, dt: float) -> None:
    """Set what of a velocity is kept after dt, and what a force adds, nodal damping implicit."""
    for b in range(grid.start.shape[0]):
        mass = load(grid.mass, b, 0, grid.lanes)
        inertia = mass + dt * damping(grid, grid.u, b)
        store(grid.kept, b, 0, mass / inertia)
        store(grid.share, b, 0, dt / inertia)


@inner_kernel()
def pushes(grid: Grid, b: int, d: int, factor: float) -> Any:
    """Force and load [N] along d on the nodes of a block."""
    load_now = factor * load(grid.load, 3 * b + d, 0, grid.lanes)
    return load(grid.force, d, grid.start[b], grid.lanes) + load_now


@inner_kernel()
def add_to(grid: Grid, a: Floats, d: int, i: int, x: Any) -> None:
    """Add to component d of vectors at the nodes from i on."""
    store(a, d, i, load(a, d, i, grid.lanes) + x)


@inner_kernel()
def kick_and_drift(grid: Grid, factor: float, dt: float) -> None:
    """Velocities by the shares set before, then displacements by dt; the forces are used up."""
    for b in range(grid.start.shape[0]):
        i = grid.start[b]
        kept, share = load(grid.kept, b, 0, grid.lanes), load(grid.share, b, 0, grid.lanes)
        for d in range(3):
            moving = kept * load(grid.v, d, i, grid.lanes) + share * pushes(grid, b, d, factor)
            store(grid.v, d, i, moving)
            add_to(grid, grid.u, d, i, dt * moving)
            store(grid.force, d, i, every(0.0, grid.lanes))


@inner_kernel()
def kick_again(grid: Grid, factor: float, half: float) -> None:
    """Velocities by half a step, damping explicit; the forces are kept for the next half."""
    for b in range(grid.start.shape[0]):
        i = grid.start[b]
        share = half / load(grid.mass, b, 0, grid.lanes)
        c = damping(grid, grid.u, b)
        for d in range(3):
            moving = load(grid.v, d, i, grid.lanes)
            add_to(grid, grid.v, d, i, share * (pushes(grid, b, d, factor) - c * moving))


@inner_kernel()
def finish(grid: Grid, at: Floats, speed: Floats, du: Floats, dv: Floats) -> None:
    """End a step of Runge-Kutta: move on, and set the first stage of the next one."""
    none = every(0.0, grid.lanes)
    for b in range(grid.start.shape[0]):
        i = grid.start[b]
        for d in range(3):
            add_to(grid, grid.u, d, i, load(du, d, i, grid.lanes))
            add_to(grid, grid.v, d, i, load(dv, d, i, grid.lanes))
            store(at, d, i, load(grid.u, d, i, grid.lanes))
            store(speed, d, i, load(grid.v, d, i, grid.lanes))
            store(du, d, i, none)
            store(dv, d, i, none)
