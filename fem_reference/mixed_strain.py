"""Mixed displacement-pressure formulation of a neo-Hookean body at finite strain, free of locking.

    L(u, p) = int mu/2 (tr C - 3) - mu ln J + p ln J - p^2 / (2 lambda) dX

is stationary in equilibrium with p = lambda ln J in the weak sense. The law is
`fem_reference.laws.NeoHookean`; the elements are quadratic in displacement and linear in pressure
(Taylor and Hood 1973; Boffi, Brezzi and Fortin 2013, ch. 8, for small strain). The linearisation at
rest is the element `taylor-hood` of the linear reference.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array

from fem_reference.assembly import MASS_ORDER, cell_moduli, rows
from fem_reference.forms import pattern, products
from fem_reference.grid import mapping
from fem_reference.hyperelasticity import by_positive_weights, flat
from fem_reference.laws import IDENTITY
from study.problem.heterogeneous import Composition
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Kinematics(NamedTuple):
    """F (t, q, 3, 3), J = det F and F^-T at the integration points."""

    gradient: Floats
    volume: Floats
    inverse_transpose: Floats


class Sparsity(NamedTuple):
    """Compressed columns `indptr`, `indices`; `place`: entry of each pair of unknowns of a cell."""

    indptr: Ints
    indices: Ints
    place: Ints


@dataclass(frozen=True)
class MixedSolid:
    """The Lagrangian of a body as a function of w, displacements u [m] (n,), then pressures [Pa].

    `nodes`: scikit-fem's basis of one component; `slopes` (t, q, 3, a): derivatives [1/m] of the
    a shape functions of tetrahedron t at its integration points q, whose `weights` [m^3] are
    (t, q); `unknowns` (t, a, 3) and `corners` (t, 4): indices of displacements and pressures in w;
    `shares` (q, 4): shape functions of the pressure. `lame`, `shear` [Pa], or those of each cell
    (t, 1); `support` [N/m] (n, n). `pointwise` [Pa]: part of `lame` that acts on ln J at each
    point, with the pressure for the rest. The pressure alone prevents a collapse of the volume in
    the mean only.
    """

    nodes: skfem.Basis
    lame: Any
    shear: Any
    slopes: Floats
    weights: Floats
    unknowns: Ints
    corners: Ints
    shares: Floats
    support: csc_array
    pointwise: Any = 0.0

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
        """Cube root of the volume [m], a length scale for residual volumes."""
        return float(np.cbrt(self.weights.sum()))

    @cached_property
    def typical_shear(self) -> float:
        """Mean shear modulus [Pa], a scale for residual volumes as forces."""
        return float((self.shear * self.weights).sum() / self.weights.sum())

    def deformation(self, w: Floats) -> Floats:
        """Deformation gradient F at the integration points, shape (t, q, 3, 3)."""
        gradient = self.slopes @ w[self.unknowns][:, None]
        return np.asarray(IDENTITY + np.swapaxes(gradient, -2, -1))

    def volume_ratio(self, w: Floats) -> Floats:
        """J = det F at the integration points, (t, q)."""
        return kinematics(self.deformation(w)).volume

    def energy(self, w: Floats) -> float:
        """Strain energy [J] of tissue and support, with p^2 / (2 lambda) for the volume."""
        F, u = self.deformation(w), w[: self.size]
        density = 0.5 * self.shear * ((F**2).sum(axis=(-2, -1)) - 3.0)
        log_volume = np.log(np.linalg.det(F))
        density += (0.5 * self.pointwise * log_volume - self.shear) * log_volume
        density += 0.5 * self._pressure(w) ** 2 / self.carried
        return float((density * self.weights).sum() + 0.5 * u @ (self.support @ u))

    def gradient(self, w: Floats) -> Floats:
        """Derivative of L, shape of w: forces [N], then residual volumes [m^3]."""
        found = kinematics(self.deformation(w))
        p, slopes = self._pressure(w), self._spatial(found)
        nodal = self._stretching @ w[self.unknowns] + self._unstretched
        stress = p + self.pointwise * np.log(found.volume) - self.shear
        push = (stress * self.weights)[:, None, :]
        nodal += (push @ slopes).reshape(len(nodal), 3, -1).mT
        force = np.bincount(self.unknowns.ravel(), nodal.ravel(), minlength=len(w))
        missed = ((np.log(found.volume) - p / self.carried) * self.weights) @ self.shares
        force += np.bincount(self.corners.ravel(), missed.ravel(), minlength=len(w))
        force[: self.size] += self.support @ w[: self.size]
        return np.asarray(force, dtype=np.float64)

    def tangent(self, w: Floats) -> csc_array:
        """Second derivative of L, symmetric and indefinite, in the order of w.

        With h_a = F^-T dN_a/dX, the integrand is mu dN_a . dN_b delta_ik + (mu - p) h_ak h_bi for
        two displacements, and h_ai N for a displacement and a pressure.
        """
        found = kinematics(self.deformation(w))
        slopes = self._spatial(found)
        stress = self._pressure(w) + self.pointwise * np.log(found.volume) - self.shear
        cells, nodes = self.unknowns.shape[:2]
        count = 3 * nodes
        pairs = slopes.mT @ (slopes * (-stress * self.weights)[..., None])
        pairs = pairs.reshape(cells, 3, nodes, 3, nodes)  # (k, a, i, b)
        own = pairs.transpose(0, 2, 3, 4, 1).copy()  # (a, i, b, k)
        for i in range(3):
            own[:, :, i, :, i] += self._stretching
        if np.any(self.pointwise):
            bulk = slopes.mT @ (slopes * (self.pointwise * self.weights)[..., None])
            own += bulk.reshape(cells, 3, nodes, 3, nodes).transpose(0, 2, 1, 4, 3)
        coupling = (self.shares * self.weights[..., None]).mT @ slopes
        coupling = coupling.reshape(cells, 4, 3, nodes).swapaxes(-2, -1).reshape(cells, 4, count)
        whole = np.empty((cells, count + 4, count + 4))
        whole[:, :count, :count] = own.reshape(cells, count, count)
        whole[:, count:, :count] = coupling
        whole[:, :count, count:] = coupling.mT
        whole[:, count:, count:] = -self._pressure_mass
        return self.assembled(whole) + self.padded_support

    def linear(self) -> csc_array:
        """The tangent at zero displacement, that of linear elasticity."""
        return self.tangent(np.zeros(self.size + self.pressures))

    @property
    def carried(self) -> Any:
        """Part of lambda [Pa] that the pressure represents."""
        return self.lame - self.pointwise

    def _pressure(self, w: Floats) -> Floats:
        """Pressure [Pa] at the integration points, (t, q)."""
        return np.asarray(w[self.corners] @ self.shares.T)

    def _spatial(self, found: Kinematics) -> Floats:
        """F^-T dN/dX of each direction and shape function, (t, q, 3 a)."""
        slopes = found.inverse_transpose @ self.slopes
        return slopes.reshape(*slopes.shape[:2], -1)

    @cached_property
    def _stretching(self) -> Floats:
        """Integrals, times mu, of dN_a/dX . dN_b/dX, (t, a, a)."""
        weighted = self.slopes * (self.shear * self.weights)[..., None, None]
        return np.asarray(flat(self.slopes).mT @ flat(weighted))

    @cached_property
    def _unstretched(self) -> Floats:
        """Integrals, times mu, of dN_a/dX, (t, a, 3)."""
        return np.asarray(np.einsum("tq,tqja->taj", self.shear * self.weights, self.slopes))

    @cached_property
    def _pressure_mass(self) -> Floats:
        """Pressure mass over lambda of each tetrahedron, (t, 4, 4)."""
        pairs = self.shares[:, :, None] * self.shares[:, None, :]
        return np.asarray(np.einsum("tq,qab->tab", self.weights / self.carried, pairs))

    @cached_property
    def _sparsity(self) -> Sparsity:
        cells, total = len(self.corners), self.size + self.pressures
        places = np.concatenate([self.unknowns.reshape(cells, -1), self.corners], axis=1)
        keys = places[:, None, :] * np.int64(total) + places[:, :, None]
        known, place = np.unique(keys.ravel(), return_inverse=True)
        counts = np.bincount(known // total, minlength=total)
        return Sparsity(np.concatenate([[0], np.cumsum(counts)]), known % total, place)

    def assembled(self, blocks: Floats) -> csc_array:
        """Global matrix, in the order of w, of cell blocks for displacements, then pressures."""
        indptr, indices, place = self._sparsity
        entries = np.bincount(place, blocks.ravel(), minlength=len(indices))
        total = self.size + self.pressures
        return csc_array((entries, indices, indptr), shape=(total, total))

    @cached_property
    def padded_support(self) -> csc_array:
        """The support [N/m] in the order of w, with zeros for the pressures."""
        total, own = self.size + self.pressures, coo_array(self.support)
        return csc_array(coo_array((own.data, (own.row, own.col)), shape=(total, total)))

    @cached_property
    def nodal_volume(self) -> csc_array:
        """Integrals [m^3] (nodes, nodes) of products of shape functions: mass over density."""
        return csc_array(products(self.nodes, pattern(self.nodes)))

    def weight(self, acceleration: Floats, density: float) -> Floats:
        """Nodal forces [N] (n,) of an acceleration [m/s^2] (3,) at a density [kg/m^3]."""
        share = np.asarray(self.nodal_volume.sum(axis=1)).ravel()
        return np.outer(density * share, acceleration).ravel()


def mixed_solid(grid: skfem.Mesh, tissue: Tissue) -> MixedSolid:
    """The body on a mesh of scikit-fem's, straight or curved (`fem_reference.grid`).

    ValueError for a Poisson ratio without a mixed formulation: 0 and below, or 1/2.
    """
    nodes = skfem.Basis(grid, skfem.ElementTetP2(), mapping(grid), intorder=MASS_ORDER)
    return on_nodes(nodes, tissue)


def on_nodes(
    nodes: skfem.Basis,
    tissue: Tissue,
    support: csc_array | None = None,
    made: Composition | None = None,
) -> MixedSolid:
    """The body on a quadratic scikit-fem basis of one component, with moduli per cell if given.

    At interfaces of tissues the pressure jumps, and its continuous shape functions smear the jump
    over the adjacent cells.
    """
    regular = tissue.highest_poisson_ratio < 0.5
    lame, shear = cell_moduli(made, tissue) if regular else (0.0, 0.0)
    if not np.all(lame > np.zeros(1)):
        raise ValueError(
            f"tissue.poisson_ratio: {tissue.poisson_ratio:g} is not between 0 and 0.5, where "
            "elements with a pressure of their own are defined at large strain"
        )
    nodes = by_positive_weights(nodes)
    slopes = np.stack([rows(function[0].grad) for function in nodes.basis], axis=-1)
    unknowns = 3 * nodes.element_dofs.T[..., None] + np.arange(3)
    local = np.asarray(nodes.X)
    shares = np.stack([1.0 - local.sum(axis=0), *local], axis=-1)
    size = 3 * int(nodes.N)
    _, corners = np.unique(nodes.mesh.t.T[:, :4], return_inverse=True)
    corners = size + corners.reshape(-1, 4)
    held = csc_array((size, size)) if support is None else support
    return MixedSolid(nodes, lame, shear, slopes, nodes.dx, unknowns, corners, shares, held)


def relieved(body: MixedSolid, moved: Floats) -> MixedSolid:
    """The body whose stress-free shape is that of `body` displaced by `moved`.

    `moved` is in the order of w. Displacements count from the new shape; the nodes keep their
    previous positions.
    """
    change = kinematics(body.deformation(moved))
    return replace(
        body,
        slopes=np.ascontiguousarray(change.inverse_transpose @ body.slopes),
        weights=body.weights * change.volume,
    )


def kinematics(F: Floats) -> Kinematics:
    """Kinematics of F (t, q, 3, 3) by cofactors, far faster than batched inverses."""
    rows_of = [F[..., i, :] for i in range(3)]
    cofactors = np.stack(
        [np.cross(rows_of[(i + 1) % 3], rows_of[(i + 2) % 3]) for i in range(3)], axis=-2
    )
    volume = (F[..., 0, :] * cofactors[..., 0, :]).sum(axis=-1)
    return Kinematics(F, volume, cofactors / volume[..., None, None])
