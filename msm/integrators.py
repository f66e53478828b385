"""The integrators by name, with their order and stability limits."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from msm import explicit, grid_explicit, implicit, split, xpbd

UNBOUNDED = float("inf")


class Integrator(NamedTuple):
    """One integrator.

    `order`: order of convergence in the step; `at`: stages, as fractions of the step, at which the
    load factor is evaluated, one column each; `advance(law, network, factors, dt, u, v)` takes one
    step per row of factors, in place. Stability limits: omega dt = `oscillation` without damping,
    and c dt / m = `damping` for damping alone. `implicit_volume`: omega is that of the lattice
    without its volume term. `linear_only`: only for linear springs. `stiffness_damping`: whether it
    supports the stiffness part of Rayleigh damping. `on_grid`: the same for `msm.grid.Grids`, which
    replaces `advance` on cubic cells, None without one.
    """

    order: int
    at: tuple[float, ...]
    advance: Callable[..., Any]
    oscillation: float
    damping: float
    implicit_volume: bool = False
    linear_only: bool = False
    stiffness_damping: bool = False
    on_grid: Callable[..., Any] | None = None


INTEGRATORS = {
    "symplectic-euler": Integrator(
        1,
        (1.0,),
        explicit.symplectic_euler,
        2.0,
        UNBOUNDED,
        stiffness_damping=True,
        on_grid=grid_explicit.symplectic_euler,
    ),
    "velocity-verlet": Integrator(
        2,
        (0.0, 1.0),
        explicit.velocity_verlet,
        2.0,
        UNBOUNDED,
        on_grid=grid_explicit.velocity_verlet,
    ),
    # Stability limits: 2 sqrt(2) on the imaginary axis; |1 + z + z^2/2 + z^3/6 + z^4/24| = 1 on
    # the real one.
    "runge-kutta-4": Integrator(
        4,
        (0.0, 0.5, 1.0),
        explicit.runge_kutta_4,
        np.sqrt(8.0),
        2.785293,
        on_grid=grid_explicit.runge_kutta_4,
    ),
    "implicit-euler": Integrator(1, (1.0,), implicit.implicit_euler, UNBOUNDED, UNBOUNDED),
    "implicit-midpoint": Integrator(2, (0.5,), implicit.implicit_midpoint, UNBOUNDED, UNBOUNDED),
    "split-volume": Integrator(1, (1.0,), split.split_volume, 2.0, UNBOUNDED, implicit_volume=True),
    "xpbd": Integrator(1, (1.0,), xpbd.xpbd, UNBOUNDED, UNBOUNDED, linear_only=True),
}
