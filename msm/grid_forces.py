"""Forces of `msm.forces` over a regular grid, compiled, one vector block at a time.

Each loop iteration processes the nodes or cells of one block. All functions add to the force of a
grid; integrators reset it to zero after use. Entries outside the organ are read but have no weight.
As in `msm.forces`, a spring of zero length gives NaN.

The law, the precision and the choice of small displacements (`linear`) are resolved at compilation.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from numba.core import types
from numba.extending import overload
from numpy.typing import NDArray

from msm.forces import cofactors, corner_shares
from msm.grid import Grid
from msm.kernel import inner_kernel
from msm.kinematics import dot, slopes
from msm.laws import law_of_kind, stiffness, tension
from msm.simd import Lanes, every, inverse_root, load, one_later, root, store, where_not_zero

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Small = Literal[True] | None


@inner_kernel()
def add_internal_forces(law: Any, grid: Grid, linear: Small, u: Floats, force: Floats) -> None:
    """Add the force [N] (3, m) of springs, cells and foundation on the nodes displaced by u."""
    add_spring_forces(law, grid, linear, u, force)
    add_volume_forces(grid, linear, u, force)
    add_foundation_forces(grid, u, 1.0, force)


@inner_kernel()
def add_stiffness_damping(
    law: Any, grid: Grid, linear: Small, beta: float, u: Floats, v: Floats, force: Floats
) -> None:
    """Add the stiffness part of Rayleigh damping [N], see `msm.rayleigh`."""
    add_spring_damping(law, grid, linear, beta, u, v, force)
    add_volume_damping(grid, linear, beta, u, v, force)
    add_foundation_forces(grid, v, beta, force)


@inner_kernel(inline="always")
def vectors(lanes: Lanes, a: Floats, i: int) -> Any:
    """The three components of vectors at the nodes from i on."""
    return load(a, 0, i, lanes), load(a, 1, i, lanes), load(a, 2, i, lanes)


@inner_kernel()
def add_to(lanes: Lanes, a: Floats, d: int, i: int, x: Any) -> None:
    """Add to component d of vectors at the nodes from i on."""
    store(a, d, i, load(a, d, i, lanes) + x)


@inner_kernel()
def add(lanes: Lanes, a: Floats, i: int, x: Any, y: Any, z: Any) -> None:
    """Add vectors at the nodes from i on."""
    add_to(lanes, a, 0, i, x)
    add_to(lanes, a, 1, i, y)
    add_to(lanes, a, 2, i, z)


# Springs ---------------------------------------------------------------------------------------


@inner_kernel()
def add_spring_forces(law: Any, grid: Grid, linear: Small, u: Floats, force: Floats) -> None:
    """Add the force [N] of each spring to its two ends."""
    lanes, directions = grid.lanes, grid.offset.shape[0]
    none = every(0.0, lanes)
    for b in range(grid.start.shape[0]):
        i = grid.start[b]
        x, y, z = vectors(lanes, u, i)
        sum_x, sum_y, sum_z = none, none, none
        for d in range(directions):
            j = i + grid.offset[d]
            xj, yj, zj = vectors(lanes, u, j)
            dx, dy, dz = xj - x, yj - y, zj - z
            relative, dx, dy, dz = pulled(law, grid, linear, d, dx, dy, dz)
            weight = load(grid.weight, b * directions + d, 0, lanes)
            share = where_not_zero(weight, weight * relative, none)
            dx, dy, dz = share * dx, share * dy, share * dz
            sum_x, sum_y, sum_z = sum_x + dx, sum_y + dy, sum_z + dz
            add(lanes, force, j, -dx, -dy, -dz)
        add(lanes, force, i, sum_x, sum_y, sum_z)


@inner_kernel()
def add_spring_damping(
    law: Any, grid: Grid, linear: Small, beta: float, u: Floats, v: Floats, force: Floats
) -> None:
    """Add a dashpot along each spring, of beta times its stiffness at the current strain."""
    lanes, directions = grid.lanes, grid.offset.shape[0]
    none = every(0.0, lanes)
    for b in range(grid.start.shape[0]):
        i = grid.start[b]
        for d in range(directions):
            j = i + grid.offset[d]
            (x, y, z), (xj, yj, zj) = vectors(lanes, u, i), vectors(lanes, u, j)
            (vx, vy, vz), (wx, wy, wz) = vectors(lanes, v, i), vectors(lanes, v, j)
            slope, dx, dy, dz = resisted(law, grid, linear, d, xj - x, yj - y, zj - z)
            growth = dx * (wx - vx) + dy * (wy - vy) + dz * (wz - vz)
            weight = load(grid.weight, b * directions + d, 0, lanes)
            share = where_not_zero(weight, weight * (slope * (beta * growth)), none)
            dx, dy, dz = share * dx, share * dy, share * dz
            add(lanes, force, i, dx, dy, dz)
            add(lanes, force, j, -dx, -dy, -dz)


def pulled(law: Any, grid: Grid, linear: Small, d: int, dx: Any, dy: Any, dz: Any) -> Any:
    """Spring force over weight and spring vector [N/m], and that vector."""
    raise NotImplementedError(law, grid, linear, d, dx, dy, dz)


@overload(pulled)
def _pulled(law: Any, grid: Any, linear: Any, d: Any, dx: Any, dy: Any, dz: Any) -> Any:  # noqa: ARG001 - typed by law alone
    return _pulled_along if _displaced(linear) else _pulled_at_rest


def _pulled_along(law: Any, grid: Any, linear: Any, d: Any, dx: Any, dy: Any, dz: Any) -> Any:  # noqa: ARG001 - numba matches names
    """Along the deformed springs; `stretched` is the change of their squared length."""
    x, y, z = grid.rest[d, 0], grid.rest[d, 1], grid.rest[d, 2]
    stretched = 2.0 * (x * dx + y * dy + z * dz) + (dx * dx + dy * dy + dz * dz)
    dx, dy, dz = x + dx, y + dy, z + dz
    squared = dx * dx + dy * dy + dz * dz
    return pull(law, grid.length[d], grid.per_length[d], squared, stretched), dx, dy, dz


def _pulled_at_rest(law: Any, grid: Any, linear: Any, d: Any, dx: Any, dy: Any, dz: Any) -> Any:  # noqa: ARG001 - numba matches names
    """Along the undeformed springs."""
    x, y, z = grid.rest[d, 0], grid.rest[d, 1], grid.rest[d, 2]
    strain = (x * dx + y * dy + z * dz) * (grid.per_length[d] * grid.per_length[d])
    return tension(law, strain), x, y, z


def resisted(law: Any, grid: Grid, linear: Small, d: int, dx: Any, dy: Any, dz: Any) -> Any:
    """Spring stiffness over weight and squared length [m^2], and the spring vector."""
    raise NotImplementedError(law, grid, linear, d, dx, dy, dz)


@overload(resisted)
def _resisted(law: Any, grid: Any, linear: Any, d: Any, dx: Any, dy: Any, dz: Any) -> Any:  # noqa: ARG001 - typed by law alone
    return _resisted_along if _displaced(linear) else _resisted_at_rest


def _resisted_along(law: Any, grid: Any, linear: Any, d: Any, dx: Any, dy: Any, dz: Any) -> Any:  # noqa: ARG001 - numba matches names
    x, y, z = grid.rest[d, 0] + dx, grid.rest[d, 1] + dy, grid.rest[d, 2] + dz
    squared = x * x + y * y + z * z
    return stiffness(law, root(squared) * grid.per_length[d] - 1.0) / squared, x, y, z


def _resisted_at_rest(law: Any, grid: Any, linear: Any, d: Any, dx: Any, dy: Any, dz: Any) -> Any:  # noqa: ARG001 - numba matches names
    x, y, z = grid.rest[d, 0], grid.rest[d, 1], grid.rest[d, 2]
    per_square = grid.per_length[d] * grid.per_length[d]
    return stiffness(law, (x * dx + y * dy + z * dz) * per_square) * per_square, x, y, z


def _displaced(linear: Any) -> bool:
    """Whether geometric nonlinearity is included, from the numba type of `linear`."""
    return linear is types.none


def pull(law: Any, length: float, per_length: float, squared: Any, stretched: Any) -> Any:
    """T(X) L_0 / L [N/m], from rest length, squared length and its change."""
    raise NotImplementedError(law, length, per_length, squared, stretched)


@overload(pull)
def _pull(law: Any, length: Any, per_length: Any, squared: Any, stretched: Any) -> Any:  # noqa: ARG001 - typed by these
    found = law_of_kind(law)
    if found is None:
        return None
    precise = getattr(squared, "dtype", squared) is types.float64
    return (_PRECISE if precise else _SINGLE)[found.linear]


def _proportional(law: Any, length: Any, per_length: Any, squared: Any, stretched: Any) -> Any:  # noqa: ARG001 - numba matches names
    """T(1 - L_0 / L), as the tension is proportional to the strain."""
    return tension(law, 1.0 - length * inverse_root(squared))


def _general(law: Any, length: Any, per_length: Any, squared: Any, stretched: Any) -> Any:  # noqa: ARG001 - numba matches names
    inverse = inverse_root(squared)
    return length * inverse * tension(law, squared * inverse * per_length - 1.0)


# In single precision the strain of a small load would drown in differences of lengths nearly equal;
# L - L_0 = (L^2 - L_0^2) / (L + L_0).
def _single_proportional(
    law: Any,
    length: Any,
    per_length: Any,  # noqa: ARG001 - numba matches names
    squared: Any,
    stretched: Any,
) -> Any:
    return tension(law, stretched / (squared + length * root(squared)))


def _single_general(law: Any, length: Any, per_length: Any, squared: Any, stretched: Any) -> Any:
    now = root(squared)
    return length * tension(law, per_length * stretched / (now + length)) / now


_PRECISE: dict[bool, Callable[..., Any]] = {True: _proportional, False: _general}
_SINGLE: dict[bool, Callable[..., Any]] = {True: _single_proportional, False: _single_general}


# Cells -----------------------------------------------------------------------------------------


@inner_kernel()
def gradient(grid: Grid, a: Floats, row: int, i: int, to_gradient: float) -> Any:
    """Mean gradient of the component along an axis of the grid, over the cells from i on."""
    lanes, at, d = grid.lanes, grid.corner, grid.axes[row]
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


@inner_kernel()
def no_shares(lanes: Lanes) -> Any:
    """Contributions of no cells, as `scatter_pressure` returns them."""
    none = every(0.0, lanes)
    shares = none, none, none, none
    return shares, shares, shares


@inner_kernel()
def scatter_pressure(
    grid: Grid, force: Floats, c: int, pressure: Any, rows: Any, before: Any
) -> Any:
    """Subtract the nodal forces of pressures on the cofactors of block c, weights included.

    Corners along a row are shared by neighbouring cells. Their forces are summed in registers
    first, those of the last cell with the next block's, which receives them as `before`.
    """
    i, count = grid.cell_start[c], len(grid.lanes)
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = rows
    now = (
        corner_shares(pressure * ax, pressure * ay, pressure * az),
        corner_shares(pressure * bx, pressure * by, pressure * bz),
        corner_shares(pressure * cx, pressure * cy, pressure * cz),
    )
    add_shares(grid, force, i, before, now)
    if c + 1 < grid.cell_start.shape[0] and grid.cell_start[c + 1] == i + count:
        return now
    none = no_shares(grid.lanes)
    add_shares(grid, force, i + count, now, none)
    return none


@inner_kernel()
def add_shares(grid: Grid, force: Floats, i: int, before: Any, now: Any) -> None:
    """Add the contributions to the corners from i on, those to upper corners one place later."""
    for d in range(3):
        (b0, b1, b2, b3), (s0, s1, s2, s3) = before[d], now[d]
        axis = grid.axes[d]
        add_to(grid.lanes, force, axis, i, s0 + one_later(b1, s1))
        add_to(grid.lanes, force, axis, i + grid.corner[2], s2 + one_later(b3, s3))
        add_to(grid.lanes, force, axis, i + grid.corner[4], -(s3 + one_later(b2, s2)))
        add_to(grid.lanes, force, axis, i + grid.corner[6], -(s1 + one_later(b0, s0)))


def volume_change(grid: Grid, linear: Small, u: Floats, i: int, to_gradient: float) -> Any:
    """J - 1 of the cells from the corners i on, and the rows of their cofactor matrices."""
    raise NotImplementedError(grid, linear, u, i, to_gradient)


@overload(volume_change)
def _volume_change(grid: Any, linear: Any, u: Any, i: Any, to_gradient: Any) -> Any:  # noqa: ARG001 - typed by one alone
    return _volume_change_displaced if _displaced(linear) else _volume_change_at_rest


def _volume_change_displaced(grid: Any, linear: Any, u: Any, i: Any, to_gradient: Any) -> Any:  # noqa: ARG001 - numba matches names
    a, b, e = gradient(grid, u, 0, i, to_gradient)
    f, g, h = gradient(grid, u, 1, i, to_gradient)
    p, q, r = gradient(grid, u, 2, i, to_gradient)
    return cofactors(a, b, e, f, g, h, p, q, r)


def _volume_change_at_rest(grid: Any, linear: Any, u: Any, i: Any, to_gradient: Any) -> Any:  # noqa: ARG001 - numba matches names
    """The divergence of u, and the cofactors of the identity."""
    x, _, _ = gradient(grid, u, 0, i, to_gradient)
    _, y, _ = gradient(grid, u, 1, i, to_gradient)
    _, _, z = gradient(grid, u, 2, i, to_gradient)
    return x + y + z, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


@inner_kernel()
def add_volume_forces(grid: Grid, linear: Small, u: Floats, force: Floats) -> None:
    """Add -kappa V (J - 1) cof(F) B_a for each corner a of each cell."""
    to_gradient, before = 0.25 / grid.spacing, no_shares(grid.lanes)
    for c in range(grid.cell_start.shape[0]):
        i = grid.cell_start[c]
        swelling, x, y, z = volume_change(grid, linear, u, i, to_gradient)
        pressure = load(grid.bulk, c, 0, grid.lanes) * swelling * to_gradient
        before = scatter_pressure(grid, force, c, pressure, (x, y, z), before)


@inner_kernel()
def add_volume_damping(
    grid: Grid, linear: Small, beta: float, u: Floats, v: Floats, force: Floats
) -> None:
    """Add -beta kappa V (dJ/dt) cof(F) B_a for each corner a of a cell; dJ/dt = cof(F) : dF/dt."""
    to_gradient, before = 0.25 / grid.spacing, no_shares(grid.lanes)
    for c in range(grid.cell_start.shape[0]):
        i = grid.cell_start[c]
        _, x, y, z = volume_change(grid, linear, u, i, to_gradient)
        growth = (
            dot(x, gradient(grid, v, 0, i, to_gradient))
            + dot(y, gradient(grid, v, 1, i, to_gradient))
            + dot(z, gradient(grid, v, 2, i, to_gradient))
        )
        pressure = load(grid.bulk, c, 0, grid.lanes) * growth * (beta * to_gradient)
        before = scatter_pressure(grid, force, c, pressure, (x, y, z), before)


# Nodes -----------------------------------------------------------------------------------------


@inner_kernel()
def add_foundation_forces(grid: Grid, u: Floats, times: float, force: Floats) -> None:
    """Subtract `times` S u, with S the foundation."""
    lanes, couplings = grid.lanes, grid.held_offset.shape[0]
    none = every(0.0, lanes)
    for b in range(grid.held_start.shape[0]):
        i = grid.held_start[b]
        sum_x, sum_y, sum_z = none, none, none
        for d in range(couplings):
            x, y, z = vectors(lanes, u, i + grid.held_offset[d])
            k = load(grid.held, b * couplings + d, 0, lanes)
            sum_x, sum_y, sum_z = sum_x + k * x, sum_y + k * y, sum_z + k * z
        add(lanes, force, i, -times * sum_x, -times * sum_y, -times * sum_z)


@inner_kernel()
def damping(grid: Grid, u: Floats, b: int) -> Any:
    """Damping [N s/m] of the nodes of a block, eq. (9), or eq. (2) with gamma_1 = 0."""
    c = load(grid.gamma_0, b, 0, grid.lanes)
    if grid.uneven:
        x, y, z = vectors(grid.lanes, u, grid.start[b])
        c = c + load(grid.gamma_1, b, 0, grid.lanes) * root(x * x + y * y + z * z)
    return c
