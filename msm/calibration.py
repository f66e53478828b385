"""From Young's modulus to spring stiffness. `msm.springs` says why these numbers hold."""

from __future__ import annotations

SPRING_POISSON_RATIO = 0.25
"""Of every lattice of central springs, whatever their stiffness."""
LARGEST_POISSON_RATIO = 0.4999
"""Of a lattice with a volume term, up to which it is verified. A cell then resists a change of its
volume 5000 times as much as one of its shape; beyond, the steps that its solvers leave unexplained
are no longer small beside the shape's."""


def reference_stiffness(
    youngs_modulus: float, spacing: float, poisson_ratio: float = SPRING_POISSON_RATIO
) -> float:
    """k_ref = mu h [N/m], the edge stiffness of the plain edge and face-diagonal lattice.

    Without a volume term the springs are the whole material, of nu = 1/4, and k_ref = 0.4 E h.
    """
    return lame(youngs_modulus, poisson_ratio)[1] * spacing


def lame(youngs_modulus: float, poisson_ratio: float) -> tuple[float, float]:
    """Lame's lambda and mu [Pa]."""
    mu = youngs_modulus / (2.0 * (1.0 + poisson_ratio))
    return 2.0 * mu * poisson_ratio / (1.0 - 2.0 * poisson_ratio), mu
