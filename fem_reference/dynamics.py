"""Implicit time stepping of M u'' + C u' + K u = f(t), C = a M + b K, from rest.

TR-BDF2 is a trapezoidal stage to t + gamma dt, gamma = 2 - sqrt(2), then the second-order backward
formula, on the first-order system in u and v. Both stages share one matrix, and the scheme is
L-stable: an overdamped velocity settles within a few steps, however long. Bank et al. (1985), IEEE
Trans. CAD 4:436; Hosea and Shampine (1996), Appl. Numer. Math. 20:21.

HHT-alpha is Newmark's scheme with the forces evaluated inside the step, which damps frequencies
that the step does not resolve; alpha = 0 is the average acceleration method. Hilber, Hughes and
Taylor (1977), Earthquake Eng. Struct. Dyn. 5:283.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from fem_reference.direct import Solve, factorised
from fem_reference.stiffness import Stiffness
from study.problem.damping import RayleighDamping

Floats = NDArray[np.float64]
State = tuple[Floats, Floats]
"""Displacement [m] and velocity [m/s], each of any shape."""
March = Callable[["Oscillator", Callable[[Floats], Floats], float, int], Iterator[State]]

GAMMA = 2.0 - np.sqrt(2.0)
ORDER = 2
ALPHA = -0.05


@dataclass(frozen=True)
class Oscillator:
    """M u'' + C u' + K u = load factor(t), with one load (n,) or several (n, k)."""

    mass: csc_array
    stiffness: Stiffness
    load: Floats
    damping: RayleighDamping

    def shifted(self, damped: float, elastic: float) -> Solve:
        """Direct solver of (M + damped C + elastic K) u = f."""
        factor = damped * self.damping.stiffness + elastic
        mass = (1.0 + damped * self.damping.mass) * self.mass
        solve = factorised(self.stiffness.system(mass, factor))
        size, pressures = self.stiffness.size, self.stiffness.unknowns - self.stiffness.size
        return lambda f: solve(np.concatenate([f, np.zeros(pressures)]))[:size]

    @property
    def rest(self) -> Floats:
        """Zero displacement [m] (n,)."""
        return np.zeros(len(self.load))

    def applied_force(self, factor: Floats) -> Floats:
        """Nodal forces [N] (n,) at a load factor, or at one factor per load (k,)."""
        return np.asarray(self.load.reshape(len(self.load), -1) @ np.atleast_1d(factor))

    def internal_force(self, u: Floats, v: Floats) -> Floats:
        """C v + K u [N] (n,)."""
        a, b = self.damping.mass, self.damping.stiffness
        return np.asarray(a * (self.mass @ v) + self.stiffness @ (u + b * v))


def march(
    system: Oscillator, factor: Callable[[Floats], Floats], step: float, count: int
) -> Iterator[tuple[Floats, Floats]]:
    """Displacement and velocity by TR-BDF2, from rest, at 0, step, ..., count * step [s]."""
    theta = 0.5 * GAMMA * step
    M, solve = system.mass, system.shifted(theta, theta**2)
    u, v = system.rest, system.rest
    yield u, v
    a = 1.0 / (GAMMA * (2.0 - GAMMA))
    b = (1.0 - GAMMA) ** 2 * a
    for n in range(count):
        start, middle, end = factor(step * (n + np.array([0.0, GAMMA, 1.0])))
        force = system.applied_force(start + middle) - system.internal_force(2.0 * u + theta * v, v)
        v_mid = solve(M @ v + theta * force)
        u_mid = u + theta * (v + v_mid)
        u_hat, v_hat = a * u_mid - b * u, a * v_mid - b * v
        v = solve(M @ v_hat + theta * (system.applied_force(end) - system.stiffness @ u_hat))
        u = u_hat + theta * v
        yield u, v


def hht(
    system: Oscillator,
    factor: Callable[[Floats], Floats],
    step: float,
    count: int,
    alpha: float = ALPHA,
) -> Iterator[tuple[Floats, Floats]]:
    """Displacement and velocity by HHT-alpha, from rest, at 0, step, ..., count * step [s].

    The initial acceleration balances the load at time zero. ValueError for an alpha outside
    [-1/3, 0].
    """
    if not -1.0 / 3.0 <= alpha <= 0.0:
        raise ValueError(f"alpha of HHT is {alpha:g}; give -1/3 to 0")
    gamma, beta = 0.5 - alpha, 0.25 * (1.0 - alpha) ** 2
    solve = system.shifted((1.0 + alpha) * gamma * step, (1.0 + alpha) * beta * step**2)
    u, v = system.rest, system.rest
    before = factor(np.zeros(1))[0]
    a = factorised(system.mass)(system.applied_force(before))
    yield u, v
    for n in range(count):
        after = factor(np.array([step * (n + 1)]))[0]
        u_hat = u + step * v + step**2 * (0.5 - beta) * a
        v_hat = v + step * (1.0 - gamma) * a
        load = system.applied_force((1.0 + alpha) * after - alpha * before)
        internal = (1.0 + alpha) * system.internal_force(u_hat, v_hat)
        internal = internal - alpha * system.internal_force(u, v)
        a = solve(load - internal)
        u, v = u_hat + step**2 * beta * a, v_hat + step * gamma * a
        before = after
        yield u, v


def hermite(before: State, after: State, share: float, step: float) -> State:
    """Displacement and velocity at a fraction of a step [s] by cubic Hermite interpolation.

    The interpolation error is of order 4 in displacement and 3 in velocity; that of the time
    stepping is of order 2.
    """
    (u, v), (u_end, v_end), s = before, after, share
    if s == 1.0:
        return after
    gap = (u_end - u) / step
    lead, lag = v - gap, v_end - gap
    moved = u + step * s * (gap + (1.0 - s) * ((1.0 - s) * lead - s * lag))
    speed = gap + (1.0 - s) * (1.0 - 3.0 * s) * lead + s * (3.0 * s - 2.0) * lag
    return moved, speed


class SteppedMotion:
    """Motion from rest by time steps of `step` [s]; the constructor factors the matrix.

    `factor`: load factor at times [s]. `displacement` [m] (n,) of all unknowns after the steps
    taken.
    """

    def __init__(
        self,
        system: Oscillator,
        factor: Callable[[Floats], Floats],
        step: float,
        scheme: March = march,
    ) -> None:
        self.step = step
        self._states = scheme(system, factor, step, sys.maxsize)
        self.displacement = next(self._states)[0]

    def take_step(self) -> None:
        """Advance by one step."""
        self.displacement = next(self._states)[0]
