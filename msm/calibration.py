"""From Young's modulus to spring stiffness. `msm.springs` says why these numbers hold."""

from __future__ import annotations

SPRING_POISSON_RATIO = 0.25
"""Of every lattice of central springs, whatever their stiffness."""
LARGEST_POISSON_RATIO = 0.49999
"""Of a lattice with a volume term: that of the tissue of a scene, up to which the term is verified.

The term's stiffness over that of the springs is 2 nu / (1 - 2 nu) - 1, here 5e4: at rest the error
of the field no longer changes from 0.499 on, while the explicit step shortens by the root of it.
"""


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
