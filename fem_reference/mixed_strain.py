"""A neo-Hookean body at finite strain with a pressure of its own, which does not lock.

    L(u, p) = int mu/2 (tr C - 3) - mu ln J + p ln J - p^2 / (2 lambda) dX

is stationary where forces balance and p is lambda ln J in the mean: the law of
`fem_reference.laws.NeoHookean`, quadratic in displacement and linear in pressure (Taylor and Hood
1973; Boffi, Brezzi and Fortin 2013, ch. 8, for small strain). Its linearisation at rest is the
element `taylor-hood` of the linear reference.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array
from skfem.models.elasticity import lame_parameters

from fem_reference.elasticity import MASS_ORDER, rows
from fem_reference.forms import pattern, products
from fem_reference.grid import mapping
from fem_reference.hyperelasticity import element_stiffness, flat
from fem_reference.laws import IDENTITY
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class MixedSolid:
    """The Lagrangian of a body as a function of w, displacements u [m] (n,), then pressures [Pa].

    `nodes`: scikit-fem's basis of one component; `slopes` (t, q, 3, a): derivatives [1/m] of the
    a shape functions of tetrahedron t at its integration points q, whose `weights` [m^3] are
    (t, q); `unknowns` (t, a, 3) and `corners` (t, 4): places of displacements and pressures in w;
    `shares` (q, 4): shape functions of the pressure. `lame`, `shear` [Pa]; `support` [N/m] (n, n).
    """

    nodes: Any
    lame: float
    shear: float
    slopes: Floats
    weights: Floats
    unknowns: Ints
    corners: Ints
    shares: Floats
    support: csc_array

    @property
    def size(self) -> int:
        """Number of displacements."""
        return 3 * int(self.nodes.N)

    @cached_property
    def pressures(self) -> int:
        """Number of pressures."""
        return int(self.corners.max()) + 1 - self.size

    @property
    def points(self) -> Floats:
        """Positions [m] (nodes, 3)."""
        return np.ascontiguousarray(self.nodes.doflocs.T)

    @cached_property
    def length(self) -> float:
        """Cube root of the volume [m], which makes a force of a pressure's equation."""
        return float(np.cbrt(self.weights.sum()))

    def deformation(self, w: Floats) -> Floats:
        """Deformation gradient F at the integration points, shape (t, q, 3, 3)."""
        gradient = self.slopes @ w[self.unknowns][:, None]
        return np.asarray(IDENTITY + np.swapaxes(gradient, -2, -1))

    def energy(self, w: Floats) -> float:
        """Energy [J] stored in the tissue and the support; p^2 / (2 lambda) is that of volume."""
        F, u = self.deformation(w), w[: self.size]
        density = 0.5 * self.shear * ((F**2).sum(axis=(-2, -1)) - 3.0)
        density += -self.shear * np.log(np.linalg.det(F)) + 0.5 * self._pressure(w) ** 2 / self.lame
        return float((density * self.weights).sum() + 0.5 * u @ (self.support @ u))

    def gradient(self, w: Floats) -> Floats:
        """Derivative of L, shape of w: forces [N], then what volumes [m^3] miss."""
        F, p = self.deformation(w), self._pressure(w)
        stress = self.shear * F + (p - self.shear)[..., None, None] * _inverse_transpose(F)
        stress *= self.weights[..., None, None]
        nodal = flat(self.slopes).mT @ flat(stress.mT)
        found = np.bincount(self.unknowns.ravel(), nodal.ravel(), minlength=len(w))
        missed = (np.log(np.linalg.det(F)) - p / self.lame) * self.weights
        found += np.bincount(self.corners.ravel(), (missed @ self.shares).ravel(), minlength=len(w))
        found[: self.size] += self.support @ w[: self.size]
        return np.asarray(found, dtype=np.float64)

    def tangent(self, w: Floats) -> csc_array:
        """Second derivative of L, symmetric and indefinite, in the order of w."""
        F, p, mass = self.deformation(w), self._pressure(w), self._pressure_mass
        G = _inverse_transpose(F)
        moduli = self.shear * np.einsum("ik,JL->iJkL", IDENTITY, IDENTITY) - np.einsum(
            "...,...iL,...kJ->...iJkL", p - self.shear, G, G
        )
        blocks = element_stiffness(moduli * self.weights[..., None, None, None, None], self.slopes)
        weighted = np.swapaxes(G * self.weights[..., None, None], -2, -1)  # (t, q, J, i)
        slopes = np.swapaxes(self.slopes, -2, -1) @ weighted  # (t, q, a, i): d ln J / du
        coupling = self.shares.T @ slopes.reshape(*slopes.shape[:2], -1)
        cells = len(blocks)
        places = np.concatenate([self.unknowns.reshape(cells, -1), self.corners], axis=1)
        whole = np.zeros((cells, places.shape[1], places.shape[1]))
        count = blocks.shape[-1]
        whole[:, :count, :count] = blocks
        whole[:, count:, :count] = coupling
        whole[:, :count, count:] = coupling.mT
        whole[:, count:, count:] = -mass
        return self._assembled(whole, places) + self._padded_support

    def linear(self) -> csc_array:
        """The tangent without deformation: that of linear elasticity."""
        return self.tangent(np.zeros(self.size + self.pressures))

    def _pressure(self, w: Floats) -> Floats:
        """Pressure [Pa] at the integration points, (t, q)."""
        return np.asarray(w[self.corners] @ self.shares.T)

    @property
    def _pressure_mass(self) -> Floats:
        """What each tetrahedron adds to the pressures' mass over lambda, (t, 4, 4)."""
        pairs = self.shares[:, :, None] * self.shares[:, None, :]
        return np.asarray(np.einsum("tq,qab->tab", self.weights / self.lame, pairs))

    def _assembled(self, blocks: Floats, places: Ints) -> csc_array:
        count = places.shape[1]
        entries = (np.repeat(places, count, axis=1).ravel(), np.tile(places, count).ravel())
        total = self.size + self.pressures
        return csc_array(coo_array((blocks.ravel(), entries), shape=(total, total)))

    @cached_property
    def _padded_support(self) -> csc_array:
        total, own = self.size + self.pressures, coo_array(self.support)
        return csc_array(coo_array((own.data, (own.row, own.col)), shape=(total, total)))

    @cached_property
    def nodal_volume(self) -> csc_array:
        """Integrals [m^3] (nodes, nodes) of products of shape functions: mass over density."""
        return csc_array(products(self.nodes, pattern(self.nodes)))

    def weight(self, acceleration: Floats, density: float) -> Floats:
        """Nodal forces [N] (n,) of an acceleration [m/s^2] (3,) of its mass, density [kg/m^3]."""
        share = np.asarray(self.nodal_volume.sum(axis=1)).ravel()
        return np.outer(density * share, acceleration).ravel()


def mixed_solid(grid: Any, tissue: Tissue, support: csc_array | None = None) -> MixedSolid:
    """The body on a mesh of scikit-fem's, straight or curved (`fem_reference.grid`).

    ValueError for a Poisson ratio at which no pressure carries the volume: 0 and below, or 1/2.
    """
    nodes = skfem.Basis(grid, skfem.ElementTetP2(), mapping(grid), intorder=MASS_ORDER)
    return on_nodes(nodes, tissue, support)


def on_nodes(nodes: Any, tissue: Tissue, support: csc_array | None = None) -> MixedSolid:
    """The same on a basis of one component, quadratic."""
    if not 0.0 < tissue.poisson_ratio < 0.5:
        raise ValueError(
            f"tissue.poisson_ratio: {tissue.poisson_ratio:g} is not between 0 and 0.5, where "
            "elements with a pressure of their own are defined at large strain"
        )
    lame, shear = lame_parameters(tissue.youngs_modulus, tissue.poisson_ratio)
    slopes = np.stack([rows(function[0].grad) for function in nodes.basis], axis=-1)
    unknowns = 3 * nodes.element_dofs.T[..., None] + np.arange(3)
    local = np.asarray(nodes.X)
    shares = np.stack([1.0 - local.sum(axis=0), *local], axis=-1)
    size = 3 * int(nodes.N)
    _, corners = np.unique(nodes.mesh.t.T[:, :4], return_inverse=True)
    corners = size + corners.reshape(-1, 4)
    held = csc_array((size, size)) if support is None else support
    return MixedSolid(
        nodes, float(lame), float(shear), slopes, nodes.dx, unknowns, corners, shares, held
    )


def _inverse_transpose(F: Floats) -> Floats:
    return np.swapaxes(np.linalg.inv(F), -2, -1)
