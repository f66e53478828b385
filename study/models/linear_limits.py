"""The range of validity of linear elasticity."""

from __future__ import annotations

STRAIN_LIMIT = 0.05
"""Largest strain up to which the linear reference is considered valid."""
ROTATION_LIMIT = 0.2
"""Largest valid rotation [rad]; linear elasticity adds a spurious strain of half its square."""


def is_large(strain: float, rotation: float) -> bool:
    """Whether a strain or a rotation [rad] exceeds the validity of linear elasticity."""
    return strain > STRAIN_LIMIT or rotation > ROTATION_LIMIT
