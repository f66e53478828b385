"""Hyperelasticity at finite strain, total Lagrangian: the potential energy of a body.

    Pi(u) = int W(F) dX + u S u / 2 - factor f . u,   F = I + du/dX

with the foundation S and the load f of the linear reference, both dead: they keep the direction
and the area of the undeformed body, so that only the tissue's law and geometry differ.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array

from fem_reference.assembly import cell_moduli, rows
from fem_reference.elasticity import Body, Booleans, decoupled
from fem_reference.elements import ELEMENTS
from fem_reference.laws import DEFAULT, IDENTITY, LAWS, Law
from study.problem.heterogeneous import Composition
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ENERGY_ORDER = 5
"""Degree that the quadrature of an energy integrates. That of the mass, 4, has a negative weight at
the centre of a cell: exact for the polynomials of a linear body, but where that point collapses, an
energy of finite strain would fall without bound."""


def material(tissue: Tissue, law: str | Law, made: Composition | None = None) -> Law:
    """The tissue's Lame constants in a law, or the law given. ValueError for an unknown name.

    Those of each cell where it is made of several tissues.
    """
    if not isinstance(law, str):
        return law
    if law not in LAWS:
        raise ValueError(f"law: {law!r} is unknown; give {' or '.join(LAWS)}")
    return LAWS[law](*cell_moduli(made, tissue))


@dataclass(frozen=True)
class HyperelasticSolid:
    """The strain and support energy of a body as a function of its displacement u [m] (n,).

    `slopes` (t, q, 3, a): derivatives [1/m] of the a shape functions of tetrahedron t at its
    integration points q, whose `weights` [m^3] are (t, q); `unknowns` (t, a, 3): places in u, of
    which those that are `fixed` (n,) feel no force and have a stiffness of their own.
    """

    law: Law
    slopes: Floats
    weights: Floats
    unknowns: Ints
    support: csc_array
    load: Floats
    fixed: Booleans | None = None

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
        nodal = flat(self.slopes).mT @ flat(stress.mT)
        found = np.bincount(self.unknowns.ravel(), nodal.ravel(), minlength=len(u))
        force = found + self.support @ u
        if self.fixed is not None:
            force[self.fixed] = 0.0
        return np.asarray(force)

    def tangent(self, u: Floats) -> csc_array:
        """Second derivative [N/m] of the energy, shape (n, n)."""
        moduli = self.law.tangent(self.deformation(u)) * self.weights[..., None, None, None, None]
        blocks = element_stiffness(moduli, self.slopes)
        count = blocks.shape[-1]
        unknowns = self.unknowns.reshape(-1, count)
        places = (np.repeat(unknowns, count, axis=1).ravel(), np.tile(unknowns, count).ravel())
        entries = (blocks.ravel(), places)
        whole = csc_array(coo_array(entries, shape=(len(u), len(u)))) + self.support
        return decoupled(whole, self.fixed)


def flat(values: Floats) -> Floats:
    """(t, q, 3, a) as (t, 3 q, a): sums over points and directions are one matrix product."""
    return values.reshape(len(values), -1, values.shape[-1])


def element_stiffness(moduli: Floats, slopes: Floats) -> Floats:
    """K_(ai)(bk) = sum_q dN_a/dX_J A_iJkL dN_b/dX_L, shape (t, 3 a, 3 a).

    Batched products of small matrices; as a scikit-fem form, called for each of the 900 pairs of
    shape functions, the same took eight times as long.
    """
    count = slopes.shape[-1]
    found = np.empty((len(slopes), count, 3, count, 3))
    left = flat(slopes).mT
    for i in range(3):
        for k in range(i + 1):
            block = left @ flat(moduli[..., i, :, k, :] @ slopes)
            found[:, :, i, :, k] = block
            found[:, :, k, :, i] = block.mT
    return found.reshape(-1, 3 * count, 3 * count)


def by_positive_weights(nodes: skfem.Basis) -> skfem.Basis:
    """A basis of scikit-fem's with the quadrature of an energy of finite strain."""
    return skfem.Basis(nodes.mesh, nodes.elem, nodes.mapping, intorder=ENERGY_ORDER)


def solid(body: Body, tissue: Tissue, law: str | Law = DEFAULT) -> HyperelasticSolid:
    """The body's elements, support and load with a law in place of Hooke's.

    ValueError for an unknown law, or for a body with a pressure field of its own.
    """
    if ELEMENTS[body.element].mixed:
        raise ValueError(
            "hyperelasticity is in displacements alone; discretise with element 'p2', which is "
            "good to a Poisson ratio of 0.49"
        )
    nodes = by_positive_weights(body.nodes)
    slopes = np.stack([rows(function[0].grad) for function in nodes.basis], axis=-1)
    unknowns = 3 * nodes.element_dofs.T[..., None] + np.arange(3)
    return HyperelasticSolid(
        material(tissue, law, body.composition),
        slopes,
        nodes.dx,
        unknowns,
        body.support,
        body.whole_load,
        body.fixed,
    )


def largest_log_strain(F: Floats) -> float:
    """Largest absolute principal logarithmic strain, |ln stretch|, of gradients (..., 3, 3)."""
    squares = np.linalg.eigvalsh(np.swapaxes(F, -2, -1) @ F)
    return float(0.5 * np.abs(np.log(squares)).max())
