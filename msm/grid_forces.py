"""Forces of a network over a regular grid, compiled: those of `msm.forces`, a block at a time.

Each loop takes the nodes or cells of one block at once, whatever the number of lanes. All add to
the force of a grid, of which integrators set to zero what they have used. Entries beyond the organ
are touched but have no weight. As in `msm.forces`, a spring pressed to a point gives NaN.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from msm.forces import cofactors, corner_shares
from msm.grid import Grid
from msm.kernel import kernel
from msm.kinematics import dot, slopes
from msm.laws import law_of_kind, stiffness, tension
from msm.simd import every, inverse_root, load, root, store, where_not_zero

Floats = NDArray[np.float64]


@kernel()
def add_internal_forces(law: Any, grid: Grid, u: Floats, force: Floats) -> None:
    """Add the force [N] (3, m) of springs, cells and foundation on the nodes displaced by u."""
    add_stored_forces(law, grid, grid.linear, u, force)
    add_foundation_forces(grid, u, 1.0, force)


@kernel()
def add_stored_forces(
    law: Any, grid: Grid, linear: Literal[True] | None, u: Floats, force: Floats
) -> None:
    """Add the force [N] (3, m) of springs and cells."""
    if linear is None:  # decided by the compiler
        add_spring_forces(law, grid, u, force)
        add_volume_forces(grid, u, force)
    else:
        add_linear_spring_forces(law, grid, u, force)
        add_linear_volume_forces(grid, u, 1.0, force)


@kernel(inline="always")
def vectors(grid: Grid, a: Floats, i: int) -> Any:
    """The three components of vectors at the nodes from i on."""
    return load(a, 0, i, grid.lanes), load(a, 1, i, grid.lanes), load(a, 2, i, grid.lanes)


@kernel(inline="always")
def add(grid: Grid, a: Floats, i: int, x: Any, y: Any, z: Any) -> None:
    """Add vectors at the nodes from i on."""
    store(a, 0, i, load(a, 0, i, grid.lanes) + x)
    store(a, 1, i, load(a, 1, i, grid.lanes) + y)
    store(a, 2, i, load(a, 2, i, grid.lanes) + z)


@kernel(inline="always")
def subtract(grid: Grid, a: Floats, i: int, x: Any, y: Any, z: Any) -> None:
    """Subtract vectors at the nodes from i on."""
    store(a, 0, i, load(a, 0, i, grid.lanes) - x)
    store(a, 1, i, load(a, 1, i, grid.lanes) - y)
    store(a, 2, i, load(a, 2, i, grid.lanes) - z)


def pull(law: Any, length: float, per_length: float, squared: Any) -> Any:
    """Force [N/m] over the spring's vector and weight, from rest length and squared length."""
    raise NotImplementedError(law, length, per_length, squared)


@overload(pull)
def _pull(law: Any, length: Any, per_length: Any, squared: Any) -> Callable[..., Any] | None:  # noqa: ARG001 - typed by law alone
    """T(X) L_0 / L; of a tension proportional to the strain that is T(1 - L_0 / L)."""
    found = law_of_kind(law)
    if found is None:
        return None
    if found.linear:

        def proportional(law: Any, length: Any, per_length: Any, squared: Any) -> Any:  # noqa: ARG001 - numba matches names
            return tension(law, 1.0 - length * inverse_root(squared))

        return proportional

    def general(law: Any, length: Any, per_length: Any, squared: Any) -> Any:
        inverse = inverse_root(squared)
        return length * inverse * tension(law, squared * inverse * per_length - 1.0)

    return general


@kernel()
def add_spring_forces(law: Any, grid: Grid, u: Floats, force: Floats) -> None:
    """Add the force [N] of each spring to its two ends."""
    directions = grid.offset.shape[0]
    none = every(0.0, grid.lanes)
    for b in range(grid.start.shape[0]):
        i = grid.start[b]
        x, y, z = vectors(grid, u, i)
        sum_x, sum_y, sum_z = none, none, none
        for d in range(directions):
            j = i + grid.offset[d]
            xj, yj, zj = vectors(grid, u, j)
            dx = grid.rest[d, 0] + (xj - x)
            dy = grid.rest[d, 1] + (yj - y)
            dz = grid.rest[d, 2] + (zj - z)
            squared = dx * dx + dy * dy + dz * dz
            weight = load(grid.weight, b * directions + d, 0, grid.lanes)
            relative = pull(law, grid.length[d], grid.per_length[d], squared)
            share = where_not_zero(weight, weight * relative, none)
            dx, dy, dz = share * dx, share * dy, share * dz
            sum_x, sum_y, sum_z = sum_x + dx, sum_y + dy, sum_z + dz
            subtract(grid, force, j, dx, dy, dz)
        add(grid, force, i, sum_x, sum_y, sum_z)


@kernel()
def add_linear_spring_forces(law: Any, grid: Grid, u: Floats, force: Floats) -> None:
    """Add the spring forces [N] of small displacements, along the springs at rest."""
    directions = grid.offset.shape[0]
    none = every(0.0, grid.lanes)
    for b in range(grid.start.shape[0]):
        i = grid.start[b]
        x, y, z = vectors(grid, u, i)
        sum_x, sum_y, sum_z = none, none, none
        for d in range(directions):
            j = i + grid.offset[d]
            xj, yj, zj = vectors(grid, u, j)
            rx, ry, rz = grid.rest[d, 0], grid.rest[d, 1], grid.rest[d, 2]
            along = rx * (xj - x) + ry * (yj - y) + rz * (zj - z)
            strain = along * (grid.per_length[d] * grid.per_length[d])
            share = load(grid.weight, b * directions + d, 0, grid.lanes) * tension(law, strain)
            dx, dy, dz = share * rx, share * ry, share * rz
            sum_x, sum_y, sum_z = sum_x + dx, sum_y + dy, sum_z + dz
            subtract(grid, force, j, dx, dy, dz)
        add(grid, force, i, sum_x, sum_y, sum_z)


@kernel(inline="always")
def gradient(grid: Grid, a: Floats, d: int, i: int, to_gradient: float) -> Any:
    """Mean gradients of component d over the cells from the corners i on."""
    lanes, at = grid.lanes, grid.corner
    return slopes(
        load(a, d, i, lanes),
        load(a, d, i + at[1], lanes),
        load(a, d, i + at[2], lanes),
        load(a, d, i + at[3], lanes),
        load(a, d, i + at[4], lanes),
        load(a, d, i + at[5], lanes),
        load(a, d, i + at[6], lanes),
        load(a, d, i + at[7], lanes),
        to_gradient,
    )


@kernel(inline="always")
def scatter(grid: Grid, force: Floats, d: int, i: int, x: Any, y: Any, z: Any) -> None:
    """Subtract the nodal forces along d of stresses with rows (x, y, z), weights included."""
    c0, c1, c2, c3 = corner_shares(x, y, z)
    lanes, at = grid.lanes, grid.corner
    store(force, d, i, load(force, d, i, lanes) + c0)
    store(force, d, i + at[1], load(force, d, i + at[1], lanes) + c1)
    store(force, d, i + at[2], load(force, d, i + at[2], lanes) + c2)
    store(force, d, i + at[3], load(force, d, i + at[3], lanes) + c3)
    store(force, d, i + at[4], load(force, d, i + at[4], lanes) - c3)
    store(force, d, i + at[5], load(force, d, i + at[5], lanes) - c2)
    store(force, d, i + at[6], load(force, d, i + at[6], lanes) - c1)
    store(force, d, i + at[7], load(force, d, i + at[7], lanes) - c0)


@kernel(inline="always")
def scatter_pressure(
    grid: Grid, force: Floats, i: int, pressure: Any, x: Any, y: Any, z: Any
) -> None:
    """Subtract the nodal forces of pressures on the cofactors of cells, weights included."""
    scatter(grid, force, 0, i, pressure * x[0], pressure * x[1], pressure * x[2])
    scatter(grid, force, 1, i, pressure * y[0], pressure * y[1], pressure * y[2])
    scatter(grid, force, 2, i, pressure * z[0], pressure * z[1], pressure * z[2])


@kernel(inline="always")
def volume_change(grid: Grid, u: Floats, i: int, to_gradient: float) -> Any:
    """J - 1 of the cells from the corners i on, and the rows of their cofactor matrices."""
    a, b, e = gradient(grid, u, 0, i, to_gradient)
    f, g, h = gradient(grid, u, 1, i, to_gradient)
    p, q, r = gradient(grid, u, 2, i, to_gradient)
    return cofactors(a, b, e, f, g, h, p, q, r)


@kernel()
def add_volume_forces(grid: Grid, u: Floats, force: Floats) -> None:
    """Add -kappa V (J - 1) cof(F) B_a for each corner a of each cell."""
    to_gradient = 0.25 / grid.spacing
    for c in range(grid.cell_start.shape[0]):
        i = grid.cell_start[c]
        swelling, x, y, z = volume_change(grid, u, i, to_gradient)
        pressure = load(grid.bulk, c, 0, grid.lanes) * swelling * to_gradient
        scatter_pressure(grid, force, i, pressure, x, y, z)


@kernel()
def add_linear_volume_forces(grid: Grid, u: Floats, times: float, force: Floats) -> None:
    """Add -kappa V div(u) B_a for each corner a of each cell, so many times."""
    to_gradient = 0.25 / grid.spacing
    none = every(0.0, grid.lanes)
    for c in range(grid.cell_start.shape[0]):
        i = grid.cell_start[c]
        x, _, _ = gradient(grid, u, 0, i, to_gradient)
        _, y, _ = gradient(grid, u, 1, i, to_gradient)
        _, _, z = gradient(grid, u, 2, i, to_gradient)
        pressure = load(grid.bulk, c, 0, grid.lanes) * (x + y + z) * (times * to_gradient)
        scatter(grid, force, 0, i, pressure, none, none)
        scatter(grid, force, 1, i, none, pressure, none)
        scatter(grid, force, 2, i, none, none, pressure)


@kernel()
def add_foundation_forces(grid: Grid, u: Floats, times: float, force: Floats) -> None:
    """Subtract S u, so many times."""
    couplings = grid.held_offset.shape[0]
    none = every(0.0, grid.lanes)
    for b in range(grid.held_start.shape[0]):
        i = grid.held_start[b]
        sum_x, sum_y, sum_z = none, none, none
        for d in range(couplings):
            x, y, z = vectors(grid, u, i + grid.held_offset[d])
            k = load(grid.held, b * couplings + d, 0, grid.lanes)
            sum_x, sum_y, sum_z = sum_x + k * x, sum_y + k * y, sum_z + k * z
        subtract(grid, force, i, times * sum_x, times * sum_y, times * sum_z)


@kernel()
def add_stiffness_damping(
    law: Any,
    grid: Grid,
    beta: float | None,
    linear: Literal[True] | None,
    u: Floats,
    v: Floats,
    force: Floats,
) -> None:
    """Add the stiffness part of Rayleigh damping [N], if there is one, see `msm.rayleigh`."""
    if beta is None:
        return
    if linear is None:
        add_spring_damping(law, grid, beta, u, v, force)
        add_volume_damping(grid, beta, u, v, force)
    else:
        add_linear_spring_damping(law, grid, beta, u, v, force)
        add_linear_volume_forces(grid, v, beta, force)
    add_foundation_forces(grid, v, beta, force)


@kernel()
def add_spring_damping(
    law: Any, grid: Grid, beta: float, u: Floats, v: Floats, force: Floats
) -> None:
    """Add a dashpot along each spring, of beta times its stiffness at the present strain."""
    directions = grid.offset.shape[0]
    none = every(0.0, grid.lanes)
    for b in range(grid.start.shape[0]):
        i = grid.start[b]
        for d in range(directions):
            j = i + grid.offset[d]
            (x, y, z), (xj, yj, zj) = vectors(grid, u, i), vectors(grid, u, j)
            (vx, vy, vz), (wx, wy, wz) = vectors(grid, v, i), vectors(grid, v, j)
            dx = grid.rest[d, 0] + (xj - x)
            dy = grid.rest[d, 1] + (yj - y)
            dz = grid.rest[d, 2] + (zj - z)
            squared = dx * dx + dy * dy + dz * dz
            strain = root(squared) * grid.per_length[d] - 1.0
            growth = (dx * (wx - vx) + dy * (wy - vy) + dz * (wz - vz)) / squared
            weight = load(grid.weight, b * directions + d, 0, grid.lanes)
            resisted = weight * (stiffness(law, strain) * (beta * growth))
            share = where_not_zero(weight, resisted, none)
            add(grid, force, i, share * dx, share * dy, share * dz)
            subtract(grid, force, j, share * dx, share * dy, share * dz)


@kernel()
def add_linear_spring_damping(
    law: Any, grid: Grid, beta: float, u: Floats, v: Floats, force: Floats
) -> None:
    """Add the dashpots along the springs at rest."""
    directions = grid.offset.shape[0]
    for b in range(grid.start.shape[0]):
        i = grid.start[b]
        for d in range(directions):
            j = i + grid.offset[d]
            (x, y, z), (xj, yj, zj) = vectors(grid, u, i), vectors(grid, u, j)
            (vx, vy, vz), (wx, wy, wz) = vectors(grid, v, i), vectors(grid, v, j)
            rx, ry, rz = grid.rest[d, 0], grid.rest[d, 1], grid.rest[d, 2]
            per_square = grid.per_length[d] * grid.per_length[d]
            strain = (rx * (xj - x) + ry * (yj - y) + rz * (zj - z)) * per_square
            growth = (rx * (wx - vx) + ry * (wy - vy) + rz * (wz - vz)) * (beta * per_square)
            weight = load(grid.weight, b * directions + d, 0, grid.lanes)
            share = weight * (stiffness(law, strain) * growth)
            add(grid, force, i, share * rx, share * ry, share * rz)
            subtract(grid, force, j, share * rx, share * ry, share * rz)


@kernel()
def add_volume_damping(grid: Grid, beta: float, u: Floats, v: Floats, force: Floats) -> None:
    """Add -beta kappa V (dJ/dt) cof(F) B_a for each corner a of a cell; dJ/dt = cof(F) : dF/dt."""
    to_gradient = 0.25 / grid.spacing
    for c in range(grid.cell_start.shape[0]):
        i = grid.cell_start[c]
        _, x, y, z = volume_change(grid, u, i, to_gradient)
        growth = (
            dot(x, gradient(grid, v, 0, i, to_gradient))
            + dot(y, gradient(grid, v, 1, i, to_gradient))
            + dot(z, gradient(grid, v, 2, i, to_gradient))
        )
        pressure = load(grid.bulk, c, 0, grid.lanes) * growth * (beta * to_gradient)
        scatter_pressure(grid, force, i, pressure, x, y, z)


@kernel(inline="always")
def damping(grid: Grid, u: Floats, b: int) -> Any:
    """Damping [N s/m] of the nodes of a block, eq. (9), or eq. (2) with gamma_1 = 0."""
    c = load(grid.gamma_0, b, 0, grid.lanes)
    if grid.uneven:
        x, y, z = vectors(grid, u, grid.start[b])
        c = c + load(grid.gamma_1, b, 0, grid.lanes) * root(x * x + y * y + z * z)
    return c
