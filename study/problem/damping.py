"""Damping of a body in terms of its mass and its stiffness."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RayleighDamping:
    """Rayleigh damping C = mass M + stiffness K, in 1/s and s.

    Lord Rayleigh (1877), The Theory of Sound, vol. 1, section 97.
    """

    mass: float
    stiffness: float = 0.0
