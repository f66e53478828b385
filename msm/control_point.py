"""A single control mass point on one spring: eqs. (1), (2) against eqs. (5)-(9).

A standard solver integrates both to a tight tolerance, so that only the models differ.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from msm.damping import NodalDamping
from msm.laws import Law, tension
from study.problem.trajectory import Trajectory

Floats = NDArray[np.float64]

RELATIVE_TOLERANCE = 1e-9


def mass_that_meets(gamma_0: float, zeta: float, k: float) -> float:
    """Mass [kg] at which eq. (2), gamma = 2 zeta sqrt(k m), equals gamma_0 [N s/m]."""
    return (gamma_0 / (2.0 * zeta)) ** 2 / k


def run(
    law: Law,
    rest_length: float,
    mass: float,
    damping: NodalDamping,
    force: Callable[[float], float],
    times: Floats,
) -> Trajectory:
    """Motion along the spring from rest; the one probe moves along x.

    `damping` is relative to the mass, as for the lattice; `force` [N] over time [s]. A failure of
    the solver gives a diverged trajectory.
    """

    def motion(t: float, state: Floats) -> list[float]:
        x, v = state
        spring = rest_length * tension(law, x / rest_length)
        damper = mass * (damping.gamma_0 + damping.gamma_1 * abs(x)) * v  # Eq. (9)
        return [v, (force(t) - spring - damper) / mass]

    solution = solve_ivp(
        motion,
        (times[0], times[-1]),
        [0.0, 0.0],
        method="LSODA",
        t_eval=times,
        rtol=RELATIVE_TOLERANCE,
        atol=1e-15,
        max_step=float(times[1] - times[0]),
    )
    state = np.full((2, len(times)), np.nan)
    state[:, : solution.y.shape[1]] = solution.y
    return _as_trajectory(state, times, finished=bool(solution.success))


def _as_trajectory(state: Floats, times: Floats, *, finished: bool) -> Trajectory:
    displacement, velocity = np.zeros((2, len(times), 1, 3))
    displacement[:, 0, 0], velocity[:, 0, 0] = state
    none = np.zeros((0, 0, 3))
    if finished and np.isfinite(state).all():
        return Trajectory(displacement, velocity, none, none)
    first_nan = int(np.flatnonzero(~np.isfinite(state).all(axis=0))[0])
    return Trajectory(
        displacement,
        velocity,
        none,
        none,
        status="diverged",
        ended_at=float(times[first_nan]),
    )
