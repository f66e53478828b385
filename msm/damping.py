"""Nodal damping, eq. (2) of the fuzzy-tuned model and eq. (9) of the benchmark; Rayleigh damping.

Nodal damping acts against the ground and resists rigid motion. Rayleigh damping alpha M + beta K
consists of nodal damping alpha M and of dashpots along the springs, beta K (`msm.rayleigh`), which
do not resist rigid motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class NodalDamping:
    """Damping coefficient c = gamma_0 + gamma_1 |u| of a node over its mass: [1/s] and [1/(m s)].

    Relative to the mass it does not depend on the lattice spacing. `beta` [s]: damping of springs,
    cells and foundation over their stiffness.
    """

    gamma_0: float
    gamma_1: float = 0.0
    beta: float = 0.0


def eq_2(zeta: float, k: float, mass: float) -> NodalDamping:
    """Damping gamma = 2 zeta k / w with w = sqrt(k / m), k [N/m], m [kg]; over m: 2 zeta w."""
    return NodalDamping(2.0 * zeta * float(np.sqrt(k / mass)))


def eq_9(gamma_0: float, gamma_1: float, mass: float) -> NodalDamping:
    """Damping gamma_0 [N s/m] and gamma_1 [N s/m^2] of a node of the given mass [kg]."""
    return NodalDamping(gamma_0 / mass, gamma_1 / mass)


def rayleigh(zetas: tuple[float, float], omegas: tuple[float, float]) -> NodalDamping:
    """Rayleigh damping alpha M + beta K with given damping ratios at two frequencies.

    From zeta = (alpha / omega + beta omega) / 2, omega [rad/s]. ValueError if alpha or beta would
    be negative, which would supply energy to some mode.
    """
    (z1, z2), (w1, w2) = zetas, omegas
    if not (w1 > 0.0 and w2 > 0.0 and w1 != w2):
        raise ValueError(f"Rayleigh damping needs two different frequencies, not {w1:g} and {w2:g}")
    spread = w2**2 - w1**2
    alpha, beta = 2.0 * w1 * w2 * (z1 * w2 - z2 * w1) / spread, 2.0 * (z2 * w2 - z1 * w1) / spread
    if not (alpha >= 0.0 and beta >= 0.0):
        raise ValueError(
            f"no Rayleigh damping has ratios {z1:g} at {w1:g} rad/s and {z2:g} at {w2:g} rad/s: "
            f"it would need alpha = {alpha:.3g} 1/s and beta = {beta:.3g} s, both at least 0; "
            "bring the two ratios, or the two frequencies, closer together"
        )
    return NodalDamping(alpha, beta=beta)


UNDAMPED = NodalDamping(0.0)
