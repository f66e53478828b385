"""Patch test: elements of any shape represent uniform strain exactly, whatever their degree.

Irons and Razzaque (1972); Taylor, Simo, Zienkiewicz and Chan (1986), Int. J. Numer. Meth. Eng.
22:39.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fem_reference.elements import ELEMENTS, ElementName
from fem_reference.grid import straight
from study.known.finding import Finding, error_of, number_of
from study.known.verification.moduli import lame_lambda, rounding, shear_modulus
from study.known.verification.solid import at_rest, free_everywhere, largest_error, solid
from study.mesh.kinds import TetrahedralMesh
from study.organ.block import block_mesh
from study.problem.tissue import Tissue

SIZE = (0.06, 0.05, 0.04)
STRAIN = np.array([[0.01, 0.004, -0.002], [0.004, -0.02, 0.006], [-0.002, 0.006, 0.015]])
RATIOS = (0.3, 0.4999)


def findings() -> Iterator[Finding]:
    """Displacement and energy of every element under a uniform strain."""
    for name in ELEMENTS:
        for nu in RATIOS:
            yield from _patch(name, Tissue(poisson_ratio=nu))


def distorted() -> TetrahedralMesh:
    """A block whose inner vertices are displaced at random."""
    mesh = block_mesh(SIZE, 0.02)
    inner = np.all((mesh.points > 0.0) & (mesh.points < SIZE), axis=1)
    moves = np.random.default_rng(1).uniform(-4e-3, 4e-3, mesh.points.shape)
    return TetrahedralMesh(mesh.points + inner[:, None] * moves, mesh.tetrahedra)


def _patch(name: ElementName, tissue: Tissue) -> Iterator[Finding]:
    body = solid(straight(distorted()), name, tissue)
    exact = body.points @ STRAIN
    inner = np.all((body.points > 1e-9) & (body.points < np.array(SIZE) - 1e-9), axis=1)
    prescribed = np.where(inner[:, None], free_everywhere(exact), exact)
    u = at_rest(body.stiffness, np.zeros(exact.size), prescribed)
    limit = rounding(tissue)
    label = f"{name}, nu {tissue.poisson_ratio:g}"
    yield error_of(f"displacement, {label}", largest_error(u, exact), limit)
    energy = 0.5 * float(u @ (body.stiffness @ u))
    yield number_of(f"energy [J], {label}", _energy(tissue), energy, limit)


def _energy(tissue: Tissue) -> float:
    density = shear_modulus(tissue) * (STRAIN**2).sum()
    density += 0.5 * lame_lambda(tissue) * np.trace(STRAIN) ** 2
    return float(density * np.prod(SIZE))
