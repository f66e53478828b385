"""The critical step, measured: bisection on the step by whether a small motion grows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from msm.assembly import Assembly, Material, arrays
from msm.integrators import INTEGRATORS, UNBOUNDED, Integrator
from msm.laws import Law
from msm.network import Network

Floats = NDArray[np.float64]

EXPLICIT = tuple(name for name, one in INTEGRATORS.items() if one.oscillation < UNBOUNDED)
"""Names of the integrators that have a critical step."""
RESOLUTION = 1e-3
"""Relative distance of the stable and the unstable step between which the limit is found."""
LOOKS = 40
SMALL = 1e-7
"""Amplitude of the initial motion in spacings, so small that geometry stays linear."""
LOST = 1e4
"""Growth that ends the observation."""
GROWN = 10.0
"""Growth from the first to the second half of the observation that counts as unstable.

Beating below the limit has reached its amplitude in the first half; a growth by 10 in the second
half is more than 1e-3 per step in 2000 steps.
"""


def measured_limit(
    assembly: Assembly,
    material: Material,
    integrator: str,
    guess: float,
    steps: int,
    *,
    linear: bool = True,
) -> float:
    """Critical step [s] of an unloaded lattice about its rest shape, near a guess [s]."""
    net = arrays(assembly, material, linear=linear)
    net, still = net._replace(load=np.zeros_like(net.load)), np.zeros_like(net.load)
    return longest_stable_step(material.law, net, INTEGRATORS[integrator], guess, still, steps)


def longest_stable_step(
    law: Law, net: Network, method: Integrator, guess: float, about: Floats, steps: int
) -> float:
    """Step [s] beyond which motions about the rest state `about` [m] (n, 3) grow."""
    low, high = guess / 1.25, guess * 1.25
    while grows(law, net, method, low, about, steps):
        low, high = low / 2.0, low
    while not grows(law, net, method, high, about, steps):
        low, high = high, high * 2.0
    while high > (1.0 + RESOLUTION) * low:
        middle = float(np.sqrt(low * high))
        if grows(law, net, method, middle, about, steps):
            high = middle
        else:
            low = middle
    return float(np.sqrt(low * high))


def grows(law: Law, net: Network, method: Integrator, dt: float, about: Floats, steps: int) -> bool:
    """Whether a small random motion about a rest state under the full load grows."""
    noise = np.random.default_rng(0).standard_normal(about.shape)
    u, v = about + SMALL * net.spacing * noise, np.zeros_like(about)
    stretch = np.ones((max(1, steps // LOOKS), len(method.at)))
    sizes = [_size(net, u - about, v, dt)]
    for _ in range(LOOKS):
        method.advance(law, net, stretch, dt, u, v)
        sizes.append(_size(net, u - about, v, dt))
        if not sizes[-1] < LOST * sizes[0]:
            return True
    half = LOOKS // 2
    return max(sizes[half:]) > GROWN * max(sizes[:half])


def _size(net: Network, u: Floats, v: Floats, dt: float) -> float:
    """Norm of a motion, as a root of its energy [J^0.5]."""
    return float(np.sqrt((net.mass[:, None] * (v**2 + (u / dt) ** 2)).sum()))
