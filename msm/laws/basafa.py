"""Springs of the Basafa benchmark, eqs. (6), (7): cubic up to a strain, linear beyond."""

from __future__ import annotations

from typing import NamedTuple

from msm.laws.force_law import ForceLaw


class Basafa(NamedTuple):
    """Eqs. (6), (7): K_1 X + K_2 X^3 up to the strain x_c, with constant slope beyond.

    `k1`, `k2` [N/m] are K_1 / h and K_2 / h of an edge. A face diagonal has sqrt(2) times the force
    constants of an edge, which keeps the lattice isotropic.
    """

    k1: float
    k2: float
    x_c: float


def _tension(law: Basafa, strain: float) -> float:
    x = max(min(strain, law.x_c), -law.x_c)
    inner = law.k1 * x + law.k2 * (x * x * x)  # Eq. (6), inner branch
    b = law.k1 + 3.0 * law.k2 * law.x_c**2
    return inner + b * (strain - x)  # Eq. (7), taken at x_c: force and slope continuous


def _stiffness(law: Basafa, strain: float) -> float:
    x = min(abs(strain), law.x_c)
    return law.k1 + 3.0 * law.k2 * (x * x)


def _largest_stiffness(law: Basafa) -> float:
    return _stiffness(law, law.x_c)


def in_proportion(k: float, cubic: float, x_c: float) -> Basafa:
    """Law of K_1 / h = k [N/m] and K_2 = `cubic` K_1. ValueError unless it stiffens."""
    if not (cubic >= 0.0 and x_c > 0.0):
        raise ValueError(
            f"cubic = {cubic:g} and x_c = {x_c:g} make no law: give cubic of 0 or more, x_c above 0"
        )
    return Basafa(k, cubic * k, x_c)


BASAFA = ForceLaw(Basafa, _tension, _stiffness, _largest_stiffness, in_proportion, branchless=True)
