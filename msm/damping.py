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


UNDAMPED = NodalDamping(0.0)
