"""The explicit integrators of `msm.explicit` over regular grids, compiled.

Each takes the motion (n, 3) of the nodes into the grids, takes its steps there and gives it back.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from msm.external_loads import add_external_forces, apply_tool_contact
from msm.forces import hold
from msm.grid import Grid, Grids
from msm.grid_forces import add_internal_forces, add_stiffness_damping, add_to, damping
from msm.grid_joints import add_joint_foundation, follow, share_out
from msm.kernel import inner_kernel, kernel
from msm.simd import every, load, store

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@kernel(nogil=True, makes_arrays=False)
def symplectic_euler(law: Any, of: Grids, factors: Floats, dt: float, u: Floats, v: Floats) -> None:
    """V += dt a(u), damped at the end; then u += dt v. Load at the end of the step."""
    moving = of.grids[0]
    take_in(moving, of.place, u, v)
    follow_all(of)
    for grid in of.grids:
        set_shares(grid, dt)
    for n in range(factors.shape[0]):
        add_forces(law, of, factors[n], 0, moving.u)
        add_damping(law, of, of.beta)
        for grid in of.grids:
            if grid.uneven:
                set_shares(grid, dt)
            kick_and_drift(grid, factors[n, 0], dt)
        apply_tool_contact(of.external, factors[n], dt, moving.u, moving.v)
        hold(of.fixed, moving.u)
        hold(of.fixed, moving.v)
        follow_all(of)
    give_back(moving, of.place, u, v)


@kernel(nogil=True, makes_arrays=False)
def velocity_verlet(law: Any, of: Grids, factors: Floats, dt: float, u: Floats, v: Floats) -> None:
    """Half a kick, a drift, half a kick; damping implicit in the first half, explicit after."""
    moving = of.grids[0]
    take_in(moving, of.place, u, v)
    follow_all(of)
    for grid in of.grids:
        set_shares(grid, 0.5 * dt)
    if factors.shape[0] > 0:
        add_forces(law, of, factors[0], 0, moving.u)
    for n in range(factors.shape[0]):
        for grid in of.grids:
            if grid.uneven:
                set_shares(grid, 0.5 * dt)
            kick_and_drift(grid, factors[n, 0], dt)
        follow_all(of)
        add_forces(law, of, factors[n], 1, moving.u)
        for grid in of.grids:
            kick_again(grid, factors[n, 1], 0.5 * dt)
        follow(of.joints, moving.v)
    give_back(moving, of.place, u, v)


@kernel(nogil=True)
def runge_kutta_4(law: Any, of: Grids, factors: Floats, dt: float, u: Floats, v: Floats) -> None:
    """The classical four stages."""
    moving = of.grids[0]
    take_in(moving, of.place, u, v)
    follow_all(of)
    at, speed = moving.u.copy(), moving.v.copy()
    du, dv = np.zeros_like(at), np.zeros_like(at)
    for n in range(factors.shape[0]):
        for stage in range(4):
            weight = dt / 6.0 if stage in (0, 3) else dt / 3.0
            ahead = 0.5 * dt if stage < 2 else dt
            add_forces(law, of, factors[n], (stage + 1) // 2, at)
            for grid in of.grids:
                factor = factors[n, (stage + 1) // 2]
                take_stage(grid, factor, weight, ahead, at, speed, du, dv)
            follow(of.joints, at)
            follow(of.joints, speed)
        for grid in of.grids:
            finish(grid, du, dv)
        follow_all(of)
        at[:], speed[:] = moving.u, moving.v
    give_back(moving, of.place, u, v)


@inner_kernel()
def add_forces(law: Any, of: Grids, row: Floats, stage: int, u: Floats) -> None:
    """Add all forces [N] on the nodes displaced by u (3, m), but those of the first load."""
    force = of.grids[0].force
    for grid in of.grids:
        add_internal_forces(law, grid, of.linear, u, force)
    add_joint_foundation(of.joints, u, 1.0, force)
    add_external_forces(of.external, row, stage, force)
    share_out(of.joints, force)
    hold(of.fixed, force)


@inner_kernel()
def add_damping(law: Any, of: Grids, beta: float | None) -> None:
    """Add the stiffness part of Rayleigh damping [N], if there is one."""
    if beta is None:
        return
    moving = of.grids[0]
    for grid in of.grids:
        add_stiffness_damping(law, grid, of.linear, beta, moving.u, moving.v, moving.force)
    add_joint_foundation(of.joints, moving.v, beta, moving.force)
    share_out(of.joints, moving.force)
    hold(of.fixed, moving.force)


@inner_kernel()
def follow_all(of: Grids) -> None:
    """Set the motion of what follows others."""
    follow(of.joints, of.grids[0].u)
    follow(of.joints, of.grids[0].v)


@inner_kernel()
def take_in(moving: Grid, place: Ints, u: Floats, v: Floats) -> None:
    """Set the motion in the grids to that of the nodes, beyond them to rest, forces to zero."""
    for d in range(3):
        for p in range(moving.u.shape[1]):
            moving.u[d, p] = moving.v[d, p] = moving.force[d, p] = 0.0
    for n in range(place.shape[0]):
        for d in range(3):
            moving.u[d, place[n]] = u[n, d]
            moving.v[d, place[n]] = v[n, d]


@inner_kernel()
def give_back(moving: Grid, place: Ints, u: Floats, v: Floats) -> None:
    """Set the motion of the nodes to that in the grids."""
    for n in range(place.shape[0]):
        for d in range(3):
            u[n, d] = moving.u[d, place[n]]
            v[n, d] = moving.v[d, place[n]]


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
def kick_and_drift(grid: Grid, factor: float, dt: float) -> None:
    """Velocities by the shares set before, then displacements by dt; the forces are used up."""
    for b in range(grid.start.shape[0]):
        i = grid.start[b]
        kept, share = load(grid.kept, b, 0, grid.lanes), load(grid.share, b, 0, grid.lanes)
        for d in range(3):
            moving = kept * load(grid.v, d, i, grid.lanes) + share * pushes(grid, b, d, factor)
            store(grid.v, d, i, moving)
            add_to(grid.lanes, grid.u, d, i, dt * moving)
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
            add_to(grid.lanes, grid.v, d, i, share * (pushes(grid, b, d, factor) - c * moving))


@inner_kernel()
def take_stage(
    grid: Grid,
    factor: float,
    weight: float,
    ahead: float,
    at: Floats,
    speed: Floats,
    du: Floats,
    dv: Floats,
) -> None:
    """Add a stage of Runge-Kutta to the sums, and go to where the next one is; forces are used up.

    Velocities first move the displacement and are then moved themselves.
    """
    for b in range(grid.start.shape[0]):
        c, i = damping(grid, at, b), grid.start[b]
        for d in range(3):
            moving = load(speed, d, i, grid.lanes)
            pushed = pushes(grid, b, d, factor) - c * moving
            rate = pushed / load(grid.mass, b, 0, grid.lanes)
            add_to(grid.lanes, du, d, i, weight * moving)
            add_to(grid.lanes, dv, d, i, weight * rate)
            store(at, d, i, load(grid.u, d, i, grid.lanes) + ahead * moving)
            store(speed, d, i, load(grid.v, d, i, grid.lanes) + ahead * rate)
            store(grid.force, d, i, every(0.0, grid.lanes))


@inner_kernel()
def finish(grid: Grid, du: Floats, dv: Floats) -> None:
    """End a step of Runge-Kutta: move on by the sums, which begin anew."""
    none = every(0.0, grid.lanes)
    for b in range(grid.start.shape[0]):
        i = grid.start[b]
        for d in range(3):
            add_to(grid.lanes, grid.u, d, i, load(du, d, i, grid.lanes))
            add_to(grid.lanes, grid.v, d, i, load(dv, d, i, grid.lanes))
            store(du, d, i, none)
            store(dv, d, i, none)
