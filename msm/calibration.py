"""From Young's modulus to spring stiffness. `msm.springs` says why these numbers hold."""

from __future__ import annotations

POISSON_RATIO = 0.25
"""Of every lattice of central springs, whatever their stiffness."""


def reference_stiffness(youngs_modulus: float, spacing: float) -> float:
    """k_ref = 0.4 E h [N/m], the edge stiffness of the plain edge and face-diagonal lattice."""
    return 0.4 * youngs_modulus * spacing
