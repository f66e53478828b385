"""Hyperelastic laws: energy density, stress and tangent of a deformation gradient."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

IDENTITY = np.eye(3)


class Law(Protocol):
    """Energy density of a deformation gradient F (..., 3, 3) and its derivatives by it [Pa]."""

    def energy(self, F: Floats) -> Floats:
        """W, shape (...)."""

    def stress(self, F: Floats) -> Floats:
        """First Piola-Kirchhoff stress P = dW/dF, shape (..., 3, 3)."""

    def tangent(self, F: Floats) -> Floats:
        """A_iJkL = dP_iJ/dF_kL, shape (..., 3, 3, 3, 3)."""


@dataclass(frozen=True)
class NeoHookean:
    """W = mu/2 (tr C - 3) - mu ln J + lambda/2 (ln J)^2, with Lame's constants [Pa].

    Bonet and Wood (2008), section 6.4.3. Of the compressible forms it is the one that most codes
    have, so that others can reproduce the results. It reduces to linear elasticity at small strain,
    and its energy is unbounded as the volume vanishes. (ln J)^2 is not convex above J = e, which
    tissue with a Poisson ratio near 1/2 does not approach.
    """

    lame: Any
    shear: Any

    def energy(self, F: Floats) -> Floats:
        """Energy density."""
        log_volume = np.log(np.linalg.det(F))
        square = (F**2).sum(axis=(-2, -1))
        return np.asarray(
            0.5 * self.shear * (square - 3.0)
            - self.shear * log_volume
            + 0.5 * self.lame * log_volume**2
        )

    def stress(self, F: Floats) -> Floats:
        """P = mu F + (lambda ln J - mu) F^-T."""
        pressure = self.lame * np.log(np.linalg.det(F)) - self.shear
        return np.asarray(
            _over(self.shear, 2) * F + pressure[..., None, None] * _inverse_transpose(F)
        )

    def tangent(self, F: Floats) -> Floats:
        """A_iJkL with d(F^-T)_iJ / dF_kL = -F^-T_iL F^-T_kJ."""
        G = _inverse_transpose(F)
        pressure = self.lame * np.log(np.linalg.det(F)) - self.shear
        return np.asarray(
            _over(self.shear, 4) * np.einsum("ik,JL->iJkL", IDENTITY, IDENTITY)
            + _over(self.lame, 4) * np.einsum("...iJ,...kL->...iJkL", G, G)
            - pressure[..., None, None, None, None] * np.einsum("...iL,...kJ->...iJkL", G, G)
        )


@dataclass(frozen=True)
class StVenantKirchhoff:
    """W = lambda/2 (tr E)^2 + mu E : E of the Green-Lagrange strain E = (C - I)/2.

    Hooke's law for large rotations and small strains. Under uniaxial compression it softens and
    loses stability at a stretch of 1/sqrt(3), and its energy is finite as the volume vanishes.
    """

    lame: Any
    shear: Any

    def energy(self, F: Floats) -> Floats:
        """Energy density."""
        strain = _green_lagrange(F)
        volume = np.trace(strain, axis1=-2, axis2=-1)
        return np.asarray(0.5 * self.lame * volume**2 + self.shear * (strain**2).sum(axis=(-2, -1)))

    def stress(self, F: Floats) -> Floats:
        """P = F S."""
        return np.asarray(F @ self._second_stress(F))

    def tangent(self, F: Floats) -> Floats:
        """Geometric part at constant S, and material part, as S is linear in E."""
        left = F @ np.swapaxes(F, -2, -1)
        return np.asarray(
            np.einsum("ik,...JL->...iJkL", IDENTITY, self._second_stress(F))
            + _over(self.lame, 4) * np.einsum("...iJ,...kL->...iJkL", F, F)
            + _over(self.shear, 4) * np.einsum("...iL,...kJ->...iJkL", F, F)
            + _over(self.shear, 4) * np.einsum("...ik,JL->...iJkL", left, IDENTITY)
        )

    def _second_stress(self, F: Floats) -> Floats:
        strain = _green_lagrange(F)
        volume = np.trace(strain, axis1=-2, axis2=-1)[..., None, None]
        return np.asarray(
            _over(self.lame, 2) * volume * IDENTITY + 2.0 * _over(self.shear, 2) * strain
        )


def _over(constant: Any, axes: int) -> Floats:
    """A constant, or one per cell (cells, 1), with so many axes appended."""
    return np.asarray(constant)[(..., *axes * (None,))]


def _inverse_transpose(F: Floats) -> Floats:
    return np.swapaxes(np.linalg.inv(F), -2, -1)


def _green_lagrange(F: Floats) -> Floats:
    return np.asarray(0.5 * (np.swapaxes(F, -2, -1) @ F - IDENTITY))


LAWS: dict[str, Callable[[Any, Any], Law]] = {
    "neo-hookean": NeoHookean,
    "st-venant-kirchhoff": StVenantKirchhoff,
}
"""Laws by name, each from Lame's constants lambda and mu [Pa], or those of each cell (cells, 1)."""
DEFAULT = "neo-hookean"
NONE = "none"
LARGE_STRAIN = (*LAWS, NONE)
"""Laws with which a linear reference may be compared, or none."""
