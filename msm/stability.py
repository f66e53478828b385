"""The critical step: how long a step may be before the motion grows without bound.

An explicit integrator is stable up to omega_max dt = `oscillation`, omega_max^2 the largest
eigenvalue of M^-1 K(u), K the tangent stiffness at the state u. Nodal damping that is treated
implicitly only lengthens the step, for symplectic Euler by sqrt(1 + zeta^2) + zeta; no use is made
of that here. Explicit damping shortens it, as does the stiffness part beta K of Rayleigh's, whose
dashpots never exceed beta times the stiffness along springs: by sqrt(1 + zeta^2) - zeta with
zeta = beta omega_max / 2 the damping ratio that it gives the fastest mode.

As the body deforms the limit moves. No Hookean spring becomes stiffer than at rest: along itself it
keeps its stiffness; across, it resists less than that under tension, and pushes aside under
compression, which makes the body buckle but not the step too long. Hence springs alone stay below
their `frequency_bound` at rest, however deformed. They do exceed their largest frequency at rest
where they are turned into line (by a third, deformed at random), and so do stretched cells and
stiffening laws, without such a bound. `Follower` keeps up with them.
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
from msm.linearised import largest_turn, nodal_bounds
from msm.network import Network
from msm.tangent import add_product, empty_tangent, linearise

Floats = NDArray[np.float64]

DEFAULT = "symplectic-euler"

SHARED = 0.17
"""How much of the damping limit counts towards that of oscillation, where damping is explicit.

Runge-Kutta's region is not a rectangle: with 0.17 the ellipse (omega dt / 2.83)^2 +
0.17 (c dt / m / 2.79)^2 = 1 stays inside it, by a scan of the roots of its polynomial.
"""
SHARP = 1e-3
"""Residual, relative to omega^2, at which a frequency is accepted."""
RESOLVED = 3e-3
"""Residual, relative to omega^2, at which one that is followed is accepted."""
GROWTH = 1.05
"""Growth of the stiffness about any node after which the frequency is found anew."""
RELIEF = 0.8
"""Fall of the largest stiffness about a node after which it is found anew."""
TURN = 0.1
"""Change of a spring's vector over its length after which it is found anew."""
LANCZOS_VECTORS = 8
NOISE = 1.0
"""Random motion in the start vector relative to the last mode, for modes at a new place."""


def critical_time_step(assembly: Assembly, material: Material, integrator: str = DEFAULT) -> float:
    """Largest stable step [s] of the lattice at rest.

    A stiffening law shortens it by the root of its largest stiffness over its initial one, and
    large deformation further.
    """
    net = arrays(assembly, material)
    method = INTEGRATORS[integrator]
    still = np.zeros_like(net.load)
    steepest = at_rest(material.law, bounding(net, method))
    omega, _ = largest_frequency(material.law, steepest, still)
    return longest_step(method, omega, damping_rate(net, still), net.beta)


def longest_step(method: Integrator, omega: float, rate: float, beta: float = 0.0) -> float:
    """Largest stable step [s] at frequencies up to omega [rad/s] and damping c / m = rate [1/s].

    `beta` [s]: explicit damping over stiffness, of methods with an oscillation limit of 2.
    """
    pace, damped = omega / method.oscillation, rate / method.damping
    slowest = max(float(np.hypot(pace, np.sqrt(SHARED) * damped)), damped)
    zeta = 0.5 * beta * omega
    return (float(np.hypot(1.0, zeta)) - zeta) / slowest if slowest > 0.0 else float("inf")


def cell_bound(youngs_modulus: float, poisson_ratio: float, density: float, h: float) -> float:
    """Step [s] safe for symplectic Euler on an unsupported lattice at rest: h sqrt(rho / (3 K)).

    E [Pa], rho [kg/m^3], h [m]; K the bulk modulus. A cell alone has no higher frequency, and no
    assembly of cells has one above its highest cell. Fill fractions do not change it.
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
    """The network with every spring as stiff as on the steeper side of rest.

    A law with a corner there has one slope towards stretching, which counts at no strain, and one
    towards compression; the least motion feels both. The same network without a corner.
    """
    below, above = stiffness_at_rest(law)
    return net._replace(scale=net.scale * (below / above)) if below > above else net


def largest_frequency(
    law: Law, net: Network, u: Floats, start: Floats | None = None, tolerance: float = SHARP
) -> tuple[float, Floats]:
    """Largest frequency [rad/s] of small motions about u [m] (n, 3), and its mode (3 n,).

    Lanczos on M^-1/2 K M^-1/2 without the matrix, from `start` (3 n,), until the residual is
    `tolerance` of omega^2, so from below by less than half of it where the mode is the highest one
    that `start` has a part along. Zero if nothing resists.
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
    """A unit vector with a part along every mode, the same at each call."""
    noise = np.random.default_rng(0).standard_normal(size)
    return np.asarray(noise / np.linalg.norm(noise))


class Follower:
    """The critical step of one run, kept up with its deformation.

    The frequency is found at some states. Since then it is taken to have grown by the root of the
    largest growth of the stiffness about any node, and by half the largest `turn`: how far a
    spring's vector has changed over its length, for springs turned into line add up. Beyond GROWTH
    or TURN it is found anew, from the last mode and some noise. `found`: how often.
    """

    def __init__(self, law: Law, net: Network, method: Integrator) -> None:
        self.law, self.net, self.method = law, bounding(net, method), method
        self.bounded = bool(np.isfinite(method.oscillation))
        self.found = 0
        self.omega = 0.0
        self.bound = np.zeros(len(net.mass))
        self.bound_then, self.then = self.bound, np.zeros_like(net.load)
        self.noise = NOISE * random_motion(net.load.size)
        self.mode = self.noise

    def limit(self, u: Floats) -> float:
        """Largest stable step [s] at the state u [m] (n, 3), which must be finite."""
        rate = damping_rate(self.net, u)
        if not self.bounded:
            return longest_step(self.method, 0.0, rate)
        net = self.net if u.any() else at_rest(self.law, self.net)
        nodal_bounds(self.law, net, u, self.bound)
        return longest_step(self.method, self._frequency(net, u), rate, self.net.beta)

    def stiffest(self) -> int:
        """The node about which the network was stiffest when last looked at."""
        return int(np.argmax(self.bound))  # NaN counts as largest

    def _frequency(self, net: Network, u: Floats) -> float:
        """Carried on from where it was found last, or found anew."""
        if self.found:
            growth = float((self.bound / self.bound_then).max())
            relief = float(self.bound.max() / self.bound_then.max())
            turn = largest_turn(net, u, self.then)
            if growth < GROWTH and relief > RELIEF and turn < TURN:
                return float(self.omega * (np.sqrt(max(growth, 1.0)) + 0.5 * turn))
        start = self.mode + self.noise
        self.omega, self.mode = largest_frequency(self.law, net, u, start, RESOLVED)
        self.bound_then, self.then = self.bound.copy(), u.copy()
        self.found += 1
        return self.omega
