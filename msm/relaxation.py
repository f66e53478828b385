"""Static equilibrium of a lattice by dynamic relaxation with kinetic damping, compiled.

The nodes have fictitious masses for which a unit time step is stable at the current stiffness, and
move without damping. Whenever the kinetic energy passes a peak, all velocities are set to zero
(after Cundall 1976). The method needs internal forces only, linear or nonlinear, and follows the
load to a stable equilibrium.
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

MASS_FACTOR = 1.2
"""Fictitious masses over the smallest stable ones: the stiffness may grow before the next peak."""


class Relaxation(NamedTuple):
    """Outcome of a relaxation.

    `residual`: norm of the unbalanced force relative to that of the load, or to that of the first
    residual without a load.
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
    """Displacement [m] (n, 3) at rest under `factor` times the load, and the outcome.

    The relaxation starts from the displacement `start`, by default zero. When `most_steps` are not
    enough, the last displacement is returned as "not at rest"; on divergence it holds NaN.
    ValueError for a tolerance outside (0, 1), no steps, or a start that does not fit the nodes.
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
    converged = residual <= tolerance
    return u, Relaxation("at rest" if converged else "not at rest", steps, residual)


@kernel(nogil=True)
def move_to_rest(
    law: Any, net: Network, factor: float, u: Floats, tolerance: float, most_steps: int
) -> tuple[int, float]:
    """Relax u in place; return the number of steps and the final relative residual."""
    force, v = np.empty_like(u), np.zeros_like(u)
    inertia = np.empty(u.shape[0])
    scale, energy = norm(factor * net.load), 0.0
    residual, step = 1.0, 0
    set_inertia(law, net, u, inertia)
    for step in range(most_steps + 1):
        internal_forces(law, net, u, force)
        force += factor * net.load
        size = norm(force)
        scale = max(scale, size) if step == 0 else scale
        residual = size / scale if size > 0.0 else 0.0
        if residual <= tolerance or not np.isfinite(residual) or step == most_steps:
            break
        # Leapfrog starts with half a velocity step; a whole one would overshoot.
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
    """Set fictitious masses (n,) with frequencies below 2, the limit of a unit time step."""
    nodal_bounds(law, net, u, inertia)
    inertia *= net.mass * MASS_FACTOR / 4.0


@kernel()
def kick(force: Floats, inertia: Floats, share: float, v: Floats) -> float:
    """Add a share of force over inertia to v; return twice the kinetic energy."""
    energy = 0.0
    for i in range(v.shape[0]):
        for d in range(3):
            v[i, d] += share * force[i, d] / inertia[i]
            energy += inertia[i] * v[i, d] ** 2
    return energy


@kernel()
def norm(x: Floats) -> float:
    """Frobenius norm of x (n, 3)."""
    total = 0.0
    for i in range(x.shape[0]):
        total += x[i, 0] ** 2 + x[i, 1] ** 2 + x[i, 2] ** 2
    return np.sqrt(total)  # type: ignore[no-any-return] # numpy scalars
