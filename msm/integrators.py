"""The integrators by name, each with its order and how far its step may go."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from msm import explicit, grid_explicit, implicit, split, xpbd

UNBOUNDED = float("inf")


class Integrator(NamedTuple):
    """One integrator.

    `order` of its error in the step; `at`: fractions of the step at which it wants the load factor,
    one column each; `advance(law, network, factors, dt, u, v)` takes a step per row of factors, in
    place. It is stable up to omega dt = `oscillation` without damping, and up to
    c dt / m = `damping` for damping alone. With `implicit_volume`, omega is that of the network
    without its volume term. With `linear_only` it takes linear springs only; only with
    `stiffness_damping` it takes the stiffness part of Rayleigh damping. `on_grid`: the same with a
    `msm.grid.Grids` for the network, if there is one; on cubic cells it is taken for `advance`.
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
    # On the imaginary axis 2 sqrt(2); on the real one where |1 + z + z^2/2 + z^3/6 + z^4/24| = 1.
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
