"""Nodal damping to ground: eq. (2) of the fuzzy-tuned model, eq. (9) of the benchmark."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Damping:
    """Damping c = gamma_0 + gamma_1 |u| of a node, per mass: [1/s] and [1/(m s)].

    Per mass it is the same material at every lattice spacing.
    """

    gamma_0: float
    gamma_1: float = 0.0


def eq_2(zeta: float, k: float, mass: float) -> Damping:
    """Damping gamma = 2 zeta k / w with w = sqrt(k / m), k [N/m], m [kg]; per mass 2 zeta w."""
    return Damping(2.0 * zeta * float(np.sqrt(k / mass)))


def eq_9(gamma_0: float, gamma_1: float, mass: float) -> Damping:
    """gamma_0 [N s/m] and gamma_1 [N s/m^2] of a node of the given mass [kg]."""
    return Damping(gamma_0 / mass, gamma_1 / mass)
