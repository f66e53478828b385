"""Spring stiffness from Young's modulus; `msm.springs` has the derivation."""

from __future__ import annotations

SPRING_POISSON_RATIO = 0.25
"""Poisson ratio of every lattice of central springs (Cauchy symmetry)."""
LARGEST_POISSON_RATIO = 0.49999
"""Largest verified Poisson ratio of a lattice with a volume term.

The volume term is stiffer than the springs by 2 nu / (1 - 2 nu) - 1, here 5e4. The static field
error no longer changes above 0.499; the explicit step shortens with the square root of that ratio.
"""


def reference_stiffness(
    youngs_modulus: float, spacing: float, poisson_ratio: float = SPRING_POISSON_RATIO
) -> float:
    """Stiffness k_ref = mu h [N/m] of an edge in the lattice of edges and face diagonals.

    Without a volume term nu is 1/4 and k_ref = 0.4 E h.
    """
    return lame(youngs_modulus, poisson_ratio)[1] * spacing


def lame(youngs_modulus: float, poisson_ratio: float) -> tuple[float, float]:
    """Lame constants lambda and mu [Pa]."""
    mu = youngs_modulus / (2.0 * (1.0 + poisson_ratio))
    return 2.0 * mu * poisson_ratio / (1.0 - 2.0 * poisson_ratio), mu
