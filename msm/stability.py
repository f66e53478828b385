"""The critical time step of a lattice, at rest and as it deforms.

An explicit integrator is stable up to omega_max dt = `oscillation`, omega_max^2 the largest
eigenvalue of M^-1 K(u), K the tangent stiffness at the displacement u. Implicit nodal damping only
lengthens the critical step, for symplectic Euler by sqrt(1 + zeta^2) + zeta, which is not used
here. Explicit damping shortens it. So does the stiffness part beta K of Rayleigh damping, whose
dashpots never exceed beta times the axial stiffness of the springs: by sqrt(1 + zeta^2) - zeta,
where zeta = beta omega_max / 2 is its damping ratio of the fastest mode.

The critical step changes with deformation. No Hookean spring becomes stiffer than at rest: its
axial stiffness is constant, and its transverse stiffness is smaller under tension and negative
under compression, which makes the body buckle but does not shorten the step. Hence springs alone
stay below their `frequency_bound` at rest, however deformed. They exceed their largest frequency
at rest where deformation aligns them (by a third, deformed at random). Stretched cells and
stiffening laws exceed both. `CriticalStepTracker` updates the critical step during a run.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh

from msm.assembly import Assembly, Material, arrays
from msm.calibration import lame
from msm.hanging import interpolate
from msm.integrators import INTEGRATORS, Integrator
from msm.laws import Law, stiffness_at_rest
from msm.linearised import largest_vector_change, nodal_bounds
from msm.network import Network
from msm.tangent import add_product, empty_tangent, linearise

Floats = NDArray[np.float64]

DEFAULT = "symplectic-euler"

DAMPING_WEIGHT = 0.17
"""Weight of explicit damping in the combined limit of oscillation and damping.

Runge-Kutta's region is not a rectangle: with 0.17 the ellipse (omega dt / 2.83)^2 +
0.17 (c dt / m / 2.79)^2 = 1 stays inside it, by a scan of the roots of its polynomial.
"""
TOLERANCE = 1e-3
"""Residual of the largest eigenvalue, relative to omega^2."""
TRACKING_TOLERANCE = 3e-3
"""The same in `CriticalStepTracker`."""
GROWTH = 1.05
"""Growth of a nodal stiffness bound after which the frequency is computed again."""
DECREASE = 0.8
"""Ratio of the largest nodal stiffness bounds below which it is computed again."""
ALIGNMENT = 0.1
"""Change of a spring vector over its rest length after which it is computed again."""
LANCZOS_VECTORS = 8
NOISE = 1.0
"""Random part of the start vector relative to the last mode, which finds modes elsewhere."""


def critical_time_step(assembly: Assembly, material: Material, integrator: str = DEFAULT) -> float:
    """Critical time step [s] of the lattice at rest.

    A stiffening law shortens it by up to the square root of its largest over its initial stiffness,
    and large deformation further.
    """
    net = arrays(assembly, material)
    method = INTEGRATORS[integrator]
    zero = np.zeros_like(net.load)
    steepest = at_rest(material.law, bounding(net, method))
    omega, _ = largest_frequency(material.law, steepest, zero)
    return longest_step(method, omega, damping_rate(net, zero), net.beta)


def longest_step(method: Integrator, omega: float, rate: float, beta: float = 0.0) -> float:
    """Largest stable step [s] at frequencies up to omega [rad/s] and damping c / m = rate [1/s].

    `beta` [s]: stiffness-proportional damping, for methods with an oscillation limit of 2.
    """
    oscillation, damped = omega / method.oscillation, rate / method.damping
    inverse = max(float(np.hypot(oscillation, np.sqrt(DAMPING_WEIGHT) * damped)), damped)
    zeta = 0.5 * beta * omega
    return (float(np.hypot(1.0, zeta)) - zeta) / inverse if inverse > 0.0 else float("inf")


def cell_bound(youngs_modulus: float, poisson_ratio: float, density: float, h: float) -> float:
    """Step [s] safe for symplectic Euler on an unsupported lattice at rest: h sqrt(rho / (3 K)).

    E [Pa], rho [kg/m^3], h [m]; K is the bulk modulus. No assembly of cells has a frequency above
    the highest of its single cells. Fill fractions do not change the bound.
    """
    first, mu = lame(youngs_modulus, poisson_ratio)
    return float(h * np.sqrt(density / (3.0 * first + 2.0 * mu)))


def frequency_bound(law: Law, net: Network, u: Floats) -> float:
    """Upper bound [rad/s] on the largest frequency at the state u [m] (n, 3), after Gershgorin."""
    bound = np.empty(len(u))
    nodal_bounds(law, net, u, bound)
    return float(np.sqrt(bound.max()))


def damping_rate(net: Network, u: Floats) -> float:
    """Largest damping over mass [1/s] of a node displaced by u [m] (n, 3)."""
    away = np.linalg.norm(u, axis=1)
    return float(((net.gamma_0 + net.gamma_1 * away) / net.mass).max())


def bounding(net: Network, method: Integrator) -> Network:
    """The network without what the method treats implicitly."""
    return net._replace(cells=net.cells[:0], bulk=net.bulk[:0]) if method.implicit_volume else net


def at_rest(law: Law, net: Network) -> Network:
    """The network with each spring as stiff as on the stiffer side of zero strain.

    A law with a kink at zero strain has one slope in tension, which `stiffness` returns there, and
    another in compression; the smallest motion meets both. Without a kink, the same network.
    """
    below, above = stiffness_at_rest(law)
    return net._replace(scale=net.scale * (below / above)) if below > above else net


def largest_frequency(
    law: Law, net: Network, u: Floats, start: Floats | None = None, tolerance: float = TOLERANCE
) -> tuple[float, Floats]:
    """Largest frequency [rad/s] of small motions about u [m] (n, 3), and its mode (3 n,).

    Matrix-free Lanczos iteration on M^-1/2 K M^-1/2 from `start` (3 n,), to a residual of
    `tolerance` times omega^2. The result is a lower bound, low by less than half of `tolerance`
    unless `start` is orthogonal to the highest mode. Zero for a body without stiffness.
    """
    root = np.sqrt(net.mass)[:, None]
    free = np.ones_like(u)
    free[net.fixed[:, 0], net.fixed[:, 1]] = 0.0
    tangent = empty_tangent(net)
    linearise(law, net, u, tangent)

    def product(x: Any) -> Any:
        force, motion = np.zeros_like(u), free * x.reshape(-1, 3) / root
        interpolate(net, motion)
        add_product(net, tangent, motion, 1.0, force)
        return (force / root).ravel()

    if start is None:
        start = random_motion(u.size)
    operator = LinearOperator((u.size, u.size), matvec=product, dtype=np.float64)
    vectors = min(u.size, LANCZOS_VECTORS)
    try:
        squared, mode = eigsh(operator, k=1, which="LA", v0=start, ncv=vectors, tol=tolerance)
    except ArpackNoConvergence:
        return frequency_bound(law, net, u), start
    return float(np.sqrt(max(squared[0], 0.0))), mode[:, 0]


def random_motion(size: int) -> Floats:
    """A random unit vector, the same at each call."""
    noise = np.random.default_rng(0).standard_normal(size)
    return np.asarray(noise / np.linalg.norm(noise))


class CriticalStepTracker:
    """The critical step of one run, updated as the body deforms.

    Between computations the largest frequency is extrapolated: it grows by the square root of the
    largest growth of a nodal stiffness bound, and by half the largest relative change of a spring
    vector, since aligned springs add up. Beyond GROWTH, DECREASE or ALIGNMENT it is computed again,
    from the last mode and random noise. `updates`: number of computations.
    """

    def __init__(self, law: Law, net: Network, method: Integrator) -> None:
        self.law, self.net, self.method = law, bounding(net, method), method
        self.bounded = bool(np.isfinite(method.oscillation))
        self.updates = 0
        self.omega = 0.0
        self.bound = np.zeros(len(net.mass))
        self.last_bound, self.last_displacement = self.bound, np.zeros_like(net.load)
        self.noise = NOISE * random_motion(net.load.size)
        self.mode = self.noise

    def limit(self, u: Floats) -> float:
        """Critical step [s] at the displacement u [m] (n, 3), which must be finite."""
        rate = damping_rate(self.net, u)
        if not self.bounded:
            return longest_step(self.method, 0.0, rate)
        net = self.net if u.any() else at_rest(self.law, self.net)
        nodal_bounds(self.law, net, u, self.bound)
        return longest_step(self.method, self._frequency(net, u), rate, self.net.beta)

    def stiffest_node(self) -> int:
        """The node with the largest stiffness bound at the last check."""
        return int(np.argmax(self.bound))  # NaN counts as largest

    def _frequency(self, net: Network, u: Floats) -> float:
        """Largest frequency [rad/s], extrapolated from the last computation or computed again."""
        if self.updates:
            growth = float((self.bound / self.last_bound).max())
            decrease = float(self.bound.max() / self.last_bound.max())
            change = largest_vector_change(net, u, self.last_displacement)
            if growth < GROWTH and decrease > DECREASE and change < ALIGNMENT:
                return float(self.omega * (np.sqrt(max(growth, 1.0)) + 0.5 * change))
        start = self.mode + self.noise
        self.omega, self.mode = largest_frequency(self.law, net, u, start, TRACKING_TOLERANCE)
        self.last_bound, self.last_displacement = self.bound.copy(), u.copy()
        self.updates += 1
        return self.omega
