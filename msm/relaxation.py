"""The displaced lattice at rest, by dynamic relaxation with kinetic damping, compiled.

The nodes get masses that make a step of one stable at their present stiffness, and move without
damping; whenever their kinetic energy has passed a peak, they are stopped and set off again (after
Cundall 1976). It needs forces alone, linear or not, and finds a rest that the load leads to.
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from msm.forces import internal_forces
from msm.hanging import interpolate
from msm.kernel import kernel
from msm.laws import Law
from msm.linearised import nodal_bounds
from msm.network import Network

Floats = NDArray[np.float64]

MARGIN = 1.2
"""Fictitious masses over the least stable ones; the stiffness may grow until the next peak."""


class Relaxation(NamedTuple):
    """How a relaxation ended.

    `residual`: size of the forces left, relative to the load (to the first forces, without load).
    """

    status: Literal["at rest", "not at rest", "diverged"]
    steps: int
    residual: float


def relax(
    law: Law,
    net: Network,
    factor: float = 1.0,
    start: Floats | None = None,
    tolerance: float = 1e-8,
    most_steps: int = 100_000,
) -> tuple[Floats, Relaxation]:
    """Displacement [m] (n, 3) at rest under `factor` times the load, and how it was reached.

    It starts from the displacement `start`, or from none. Without enough steps the last
    displacement is returned as "not at rest"; on divergence it holds NaN. ValueError if nothing
    can be reached with the tolerance or the number of steps.
    """
    if not 0.0 < tolerance < 1.0:
        raise ValueError(f"tolerance: {tolerance:g} is not between 0 and 1; 1e-8 is a good one")
    if most_steps < 1:
        raise ValueError(f"most_steps: {most_steps} leaves no step to take; give 1 or more")
    u = np.zeros_like(net.load) if start is None else np.array(start, dtype=np.float64)
    if u.shape != net.load.shape:
        raise ValueError(f"start: shape {u.shape} does not fit the nodes' {net.load.shape}")
    steps, residual = move_to_rest(law, net, factor, u, tolerance, most_steps)
    if not np.isfinite(residual):
        return np.full_like(u, np.nan), Relaxation("diverged", steps, residual)
    reached = residual <= tolerance
    return u, Relaxation("at rest" if reached else "not at rest", steps, residual)


@kernel(nogil=True)
def move_to_rest(
    law: Any, net: Network, factor: float, u: Floats, tolerance: float, most_steps: int
) -> tuple[int, float]:
    """Move u to rest in place; the steps taken and the relative residual left."""
    force, v = np.empty_like(u), np.zeros_like(u)
    inertia = np.empty(u.shape[0])
    scale, energy = size_of(factor * net.load), 0.0
    residual, step = 1.0, 0
    set_inertia(law, net, u, inertia)
    for step in range(most_steps + 1):
        internal_forces(law, net, u, force)
        force += factor * net.load
        size = size_of(force)
        scale = max(scale, size) if step == 0 else scale
        residual = size / scale if size > 0.0 else 0.0
        if residual <= tolerance or not np.isfinite(residual) or step == most_steps:
            break
        # From a stop, half a kick: a whole one would throw a fast motion beyond where it came from.
        share = 0.5 if energy == 0.0 else 1.0
        before, energy = energy, kick(force, inertia, share, v)
        if energy < before:
            v[:] = 0.0
            energy = 0.0
            set_inertia(law, net, u, inertia)
        u += v
        interpolate(net, u)
    return step, residual


@kernel()
def set_inertia(law: Any, net: Network, u: Floats, inertia: Floats) -> None:
    """Masses (n,) with which no frequency exceeds the 2 that a step of one can follow."""
    nodal_bounds(law, net, u, inertia)
    inertia *= net.mass * MARGIN / 4.0


@kernel()
def kick(force: Floats, inertia: Floats, share: float, v: Floats) -> float:
    """Add a share of force over inertia to v; twice the kinetic energy then."""
    energy = 0.0
    for i in range(v.shape[0]):
        for d in range(3):
            v[i, d] += share * force[i, d] / inertia[i]
            energy += inertia[i] * v[i, d] ** 2
    return energy


@kernel()
def size_of(x: Floats) -> float:
    """Root of the sum of the squares of x (n, 3)."""
    total = 0.0
    for i in range(x.shape[0]):
        total += x[i, 0] ** 2 + x[i, 1] ** 2 + x[i, 2] ** 2
    return np.sqrt(total)  # type: ignore[no-any-return] # numpy scalars
