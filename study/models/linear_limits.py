"""How far linear elasticity can be trusted."""

from __future__ import annotations

STRAIN_LIMIT = 0.05
"""Largest strain of the linear reference above which it is not to be trusted."""
ROTATION_LIMIT = 0.2
"""Largest rotation [rad] of it: half its square is a strain that linear elasticity invents."""


def is_large(strain: float, rotation: float) -> bool:
    """Whether a largest strain or rotation [rad] is more than linear elasticity is good for."""
    return strain > STRAIN_LIMIT or rotation > ROTATION_LIMIT
