"""The range of validity of linear elasticity."""

from __future__ import annotations

STRAIN_LIMIT = 0.05
"""Largest strain up to which the linear reference is considered valid."""
ROTATION_LIMIT = 0.2
"""Largest valid rotation [rad]; linear elasticity adds a spurious strain of half its square."""
MEANINGLESS_STRAIN = 1.0
"""Largest strain from which a linear displacement may turn tissue inside out."""


def is_meaningless(strain: float) -> bool:
    """Whether linear elasticity says nothing of the tissue: a line in it may have no length."""
    return strain >= MEANINGLESS_STRAIN


def is_large(strain: float, rotation: float) -> bool:
    """Whether a strain or a rotation [rad] exceeds the validity of linear elasticity."""
    return strain > STRAIN_LIMIT or rotation > ROTATION_LIMIT
