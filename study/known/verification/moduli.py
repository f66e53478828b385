"""Elastic moduli of the exact solutions, independent of those that the elements use."""

from __future__ import annotations

from study.problem.tissue import Tissue


def shear_modulus(tissue: Tissue) -> float:
    """Shear modulus mu [Pa]."""
    return tissue.youngs_modulus / (2.0 * (1.0 + tissue.poisson_ratio))


def rounding(tissue: Tissue) -> float:
    """Relative error that rounding leaves on a small mesh: the condition grows with lambda / mu."""
    return 1e-13 / (1.0 - 2.0 * tissue.poisson_ratio)


def lame_lambda(tissue: Tissue) -> float:
    """Lame's first parameter lambda [Pa]."""
    return 2.0 * shear_modulus(tissue) * tissue.poisson_ratio / (1.0 - 2.0 * tissue.poisson_ratio)


def oedometric(tissue: Tissue) -> float:
    """Stress over strain [Pa] where the material cannot move sideways, lambda + 2 mu."""
    return lame_lambda(tissue) + 2.0 * shear_modulus(tissue)
