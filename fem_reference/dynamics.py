"""Second-order implicit time stepping with mass-proportional damping.

M u'' + alpha M u' + K u = f(t) as a first-order system in u and v, by TR-BDF2: a trapezoidal stage
to t + gamma dt, gamma = 2 - sqrt(2), then the second-order backward formula. Both stages share one
matrix, and the scheme is L-stable: an overdamped velocity settles within a few steps, however long.
Bank et al. (1985), IEEE Trans. CAD 4:436; Hosea and Shampine (1996), Appl. Numer. Math. 20:21.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

Floats = NDArray[np.float64]

GAMMA = 2.0 - np.sqrt(2.0)
ORDER = 2


def factorised(matrix: csc_array) -> Any:
    """Sparse factors of a symmetric positive matrix, with an ordering that keeps them small.

    ValueError if the matrix is singular: nothing holds the body.
    """
    try:
        return splu(
            matrix,
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError:
        raise ValueError("the stiffness is singular: the support does not hold the body") from None


def solve_static(stiffness: csc_array, load: Floats) -> Floats:
    """Displacement [m] at rest under a load [N]. ValueError if the result is not in balance."""
    displacement = np.asarray(factorised(stiffness).solve(load))
    residual = np.linalg.norm(stiffness @ displacement - load) / np.linalg.norm(load)
    if not residual < 1e-6:
        raise ValueError(f"static solution out of balance by {residual:.1e} of the load")
    return displacement


@dataclass(frozen=True)
class Oscillator:
    """M u'' + alpha M u' + K u = factor(t) load."""

    mass: csc_array
    stiffness: csc_array
    load: Floats
    damping_rate: float


def march(
    system: Oscillator, factor: Callable[[Floats], Floats], step: float, count: int
) -> Iterator[tuple[Floats, Floats]]:
    """Displacement and velocity, from rest, at 0, step, ..., count * step [s]."""
    theta = 0.5 * GAMMA * step
    alpha, M, K = system.damping_rate, system.mass, system.stiffness
    solver = factorised(csc_array((1.0 + theta * alpha) * M + theta**2 * K))
    u, v = np.zeros_like(system.load), np.zeros_like(system.load)
    yield u, v
    a = 1.0 / (GAMMA * (2.0 - GAMMA))
    b = (1.0 - GAMMA) ** 2 * a
    for n in range(count):
        start, middle, end = factor(step * (n + np.array([0.0, GAMMA, 1.0])))
        force = (start + middle) * system.load - K @ (2.0 * u + theta * v)
        v_mid = solver.solve((1.0 - theta * alpha) * (M @ v) + theta * force)
        u_mid = u + theta * (v + v_mid)
        u_hat, v_hat = a * u_mid - b * u, a * v_mid - b * v
        v = solver.solve(M @ v_hat + theta * (end * system.load - K @ u_hat))
        u = u_hat + theta * v
        yield u, v
