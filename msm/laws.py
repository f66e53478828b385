"""Spring laws: tension over strain, relative to the spring's weight and rest length.

A spring of rest length L_0, weight w (its stiffness relative to k_ref) and strain
X = (L - L_0) / L_0 pulls with w L_0 `tension(law, X)`. A law is a named tuple with a tension
function, joined in TENSIONS; the kernel compiles each pair into a loop of its own with nothing left
to decide inside. A new law is one more pair and its two slopes.
"""

from __future__ import annotations

from typing import Any, NamedTuple


class Hooke(NamedTuple):
    """Linear spring: `k` [N/m] is k_ref."""

    k: float


class Basafa(NamedTuple):
    """Eq. (6), (7): K_1 X + K_2 X^3 up to the strain x_c, then straight on.

    `k1`, `k2` [N/m] are K_1 / h and K_2 / h of an edge: a face diagonal thus has sqrt(2) times the
    force constants of an edge, which keeps the lattice isotropic.
    """

    k1: float
    k2: float
    x_c: float


Law = Hooke | Basafa


# The kernel compiles these two and wants the annotations of its own overload, hence Any.
def _hooke(law: Any, strain: Any) -> Any:
    return law.k * strain


def _basafa(law: Any, strain: Any) -> Any:
    size = abs(strain)
    if size <= law.x_c:
        return law.k1 * strain + law.k2 * strain**3  # Eq. (6), inner branch
    a = law.k1 * law.x_c + law.k2 * law.x_c**3  # Eq. (7), taken at x_c: force and slope continuous
    b = law.k1 + 3.0 * law.k2 * law.x_c**2
    return (a + b * (size - law.x_c)) * (1.0 if strain > 0.0 else -1.0)


TENSIONS = {Hooke: _hooke, Basafa: _basafa}


def tension(law: Law, strain: float) -> float:
    """Tension [N/m] of a law at a strain; times weight and rest length it is a force [N]."""
    return float(TENSIONS[type(law)](law, strain))


def initial_stiffness(law: Law) -> float:
    """Slope [N/m] of the tension at rest."""
    return law.k if isinstance(law, Hooke) else law.k1


def largest_stiffness(law: Law) -> float:
    """Largest slope [N/m] of the tension at any strain."""
    return law.k if isinstance(law, Hooke) else law.k1 + 3.0 * law.k2 * law.x_c**2
