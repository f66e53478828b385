"""Hyperelasticity at finite strain, total Lagrangian: laws, and the potential energy of a body.

    Pi(u) = int W(F) dX + u S u / 2 - factor f . u,   F = I + du/dX

with the foundation S and the load f of the linear reference, both dead: they keep the direction
and the area of the undeformed body, so that only the tissue's law and geometry differ.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array
from skfem.models.elasticity import lame_parameters

from fem_reference.elasticity import Body, rows
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LawName = Literal["neo-hookean", "st-venant-kirchhoff"]

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

    Bonet and Wood (2008), section 6.4.3. Of the compressible forms the one most codes share, so
    that others can repeat the numbers; it is linear elasticity at small strain and resists a volume
    squeezed to nothing without bound. (ln J)^2 stops being convex at J = e, which tissue with a
    Poisson ratio near 1/2 does not come near.
    """

    lame: float
    shear: float

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
        return np.asarray(self.shear * F + pressure[..., None, None] * _inverse_transpose(F))

    def tangent(self, F: Floats) -> Floats:
        """d(F^-T)_iJ / dF_kL = -F^-T_iL F^-T_kJ does the rest."""
        G = _inverse_transpose(F)
        pressure = self.lame * np.log(np.linalg.det(F)) - self.shear
        return np.asarray(
            self.shear * np.einsum("ik,JL->iJkL", IDENTITY, IDENTITY)
            + self.lame * np.einsum("...iJ,...kL->...iJkL", G, G)
            - pressure[..., None, None, None, None] * np.einsum("...iL,...kJ->...iJkL", G, G)
        )


@dataclass(frozen=True)
class StVenantKirchhoff:
    """W = lambda/2 (tr E)^2 + mu E : E of the Green-Lagrange strain E = (C - I)/2.

    Hooke's law for large rotations. For small strains only: squeezed along one axis it softens and
    gives way at a stretch of 1/sqrt(3), and a volume squeezed to nothing costs a finite energy.
    """

    lame: float
    shear: float

    def energy(self, F: Floats) -> Floats:
        """Energy density."""
        strain = _green_lagrange(F)
        volume = np.trace(strain, axis1=-2, axis2=-1)
        return np.asarray(0.5 * self.lame * volume**2 + self.shear * (strain**2).sum(axis=(-2, -1)))

    def stress(self, F: Floats) -> Floats:
        """P = F S."""
        return np.asarray(F @ self._second_stress(F))

    def tangent(self, F: Floats) -> Floats:
        """Of F at fixed S, and of S, which is linear in E."""
        left = F @ np.swapaxes(F, -2, -1)
        return np.asarray(
            np.einsum("ik,...JL->...iJkL", IDENTITY, self._second_stress(F))
            + self.lame * np.einsum("...iJ,...kL->...iJkL", F, F)
            + self.shear * np.einsum("...iL,...kJ->...iJkL", F, F)
            + self.shear * np.einsum("...ik,JL->...iJkL", left, IDENTITY)
        )

    def _second_stress(self, F: Floats) -> Floats:
        strain = _green_lagrange(F)
        volume = np.trace(strain, axis1=-2, axis2=-1)[..., None, None]
        return np.asarray(self.lame * volume * IDENTITY + 2.0 * self.shear * strain)


def _inverse_transpose(F: Floats) -> Floats:
    return np.swapaxes(np.linalg.inv(F), -2, -1)


def _green_lagrange(F: Floats) -> Floats:
    return np.asarray(0.5 * (np.swapaxes(F, -2, -1) @ F - IDENTITY))


def material(tissue: Tissue, law: LawName | Law) -> Law:
    """The tissue's Lame constants in a law, or the law given. ValueError for an unknown name."""
    if not isinstance(law, str):
        return law
    constants = lame_parameters(tissue.youngs_modulus, tissue.poisson_ratio)
    if law == "neo-hookean":
        return NeoHookean(*constants)
    if law == "st-venant-kirchhoff":
        return StVenantKirchhoff(*constants)
    raise ValueError(f"law: {law!r} is unknown; give neo-hookean or st-venant-kirchhoff")


@dataclass(frozen=True)
class Solid:
    """The strain and support energy of a body as a function of its displacement u [m] (n,).

    `slopes` (t, q, 3, a): derivatives [1/m] of the a shape functions of tetrahedron t at its
    integration points q, whose `weights` [m^3] are (t, q); `unknowns` (t, a, 3): places in u.
    """

    law: Law
    slopes: Floats
    weights: Floats
    unknowns: Ints
    support: csc_array
    load: Floats

    def deformation(self, u: Floats) -> Floats:
        """Deformation gradient F at the integration points, shape (t, q, 3, 3)."""
        gradient = self.slopes @ u[self.unknowns][:, None]
        return np.asarray(IDENTITY + np.swapaxes(gradient, -2, -1))

    def energy(self, u: Floats) -> float:
        """Energy [J] stored in the tissue and the foundation."""
        strain = (self.law.energy(self.deformation(u)) * self.weights).sum()
        return float(strain + 0.5 * u @ (self.support @ u))

    def internal_force(self, u: Floats) -> Floats:
        """Gradient [N] of the energy, shape (n,)."""
        stress = self.law.stress(self.deformation(u)) * self.weights[..., None, None]
        nodal = _flat(self.slopes).mT @ _flat(stress.mT)
        found = np.bincount(self.unknowns.ravel(), nodal.ravel(), minlength=len(u))
        return np.asarray(found + self.support @ u)

    def tangent(self, u: Floats) -> csc_array:
        """Second derivative [N/m] of the energy, shape (n, n)."""
        moduli = self.law.tangent(self.deformation(u)) * self.weights[..., None, None, None, None]
        blocks = _element_stiffness(moduli, self.slopes)
        count = blocks.shape[-1]
        unknowns = self.unknowns.reshape(-1, count)
        places = (np.repeat(unknowns, count, axis=1).ravel(), np.tile(unknowns, count).ravel())
        entries = (blocks.ravel(), places)
        return csc_array(coo_array(entries, shape=(len(u), len(u)))) + self.support


def _flat(values: Floats) -> Floats:
    """(t, q, 3, a) as (t, 3 q, a): sums over points and directions are one matrix product."""
    return values.reshape(len(values), -1, values.shape[-1])


def _element_stiffness(moduli: Floats, slopes: Floats) -> Floats:
    """K_(ai)(bk) = sum_q dN_a/dX_J A_iJkL dN_b/dX_L, shape (t, 3 a, 3 a).

    Batched products of small matrices; as a scikit-fem form, called for each of the 900 pairs of
    shape functions, the same took eight times as long.
    """
    count = slopes.shape[-1]
    found = np.empty((len(slopes), count, 3, count, 3))
    left = _flat(slopes).mT
    for i in range(3):
        for k in range(i + 1):
            block = left @ _flat(moduli[..., i, :, k, :] @ slopes)
            found[:, :, i, :, k] = block
            found[:, :, k, :, i] = block.mT
    return found.reshape(-1, 3 * count, 3 * count)


def solid(body: Body, tissue: Tissue, law: LawName | Law = "neo-hookean") -> Solid:
    """The body's elements, support and load with a law in place of Hooke's.

    ValueError for an unknown law, or for a body with a pressure field of its own.
    """
    if body.element == "taylor-hood":
        raise ValueError(
            "hyperelasticity is in displacements alone; discretise with element 'p2', which is "
            "good to a Poisson ratio of 0.49"
        )
    nodes = body.nodes
    slopes = np.stack([rows(function[0].grad) for function in nodes.basis], axis=-1)
    unknowns = 3 * nodes.element_dofs.T[..., None] + np.arange(3)
    return Solid(material(tissue, law), slopes, nodes.dx, unknowns, body.support, body.load)


def largest_log_strain(F: Floats) -> float:
    """Largest absolute principal logarithmic strain, |ln stretch|, of gradients (..., 3, 3)."""
    squares = np.linalg.eigvalsh(np.swapaxes(F, -2, -1) @ F)
    return float(0.5 * np.abs(np.log(squares)).max())
