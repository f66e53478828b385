"""A bar bent by a force across its end, exact in three dimensions.

Saint-Venant (1856), J. Math. Pures Appl. 1:89, in the form of Love (1927), A Treatise on the
Mathematical Theory of Elasticity, ch. 15: with the bar along z, a force P along x at z = L and I
the second moment of the section |x| <= a, |y| <= b,

u_x = P / (E I) (nu (L - z) (x^2 - y^2) / 2 + L z^2 / 2 - z^3 / 6)
u_y = P / (E I) nu (L - z) x y
u_z = -P / (E I) (x (L z - z^2 / 2) + chi + x y^2)

with a harmonic chi that leaves the sides without traction; for the rectangle a cubic polynomial and
a series. At z = 0 the displacement is prescribed, warping included, at z = L the shear traction, so
there is no error of beam theory in it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fem_reference.elements import ElementName
from fem_reference.grid import straight
from study.known.finding import Finding, error_of, number_of, observed_order
from study.known.verification.moduli import shear_modulus
from study.known.verification.solid import (
    Solid,
    at_rest,
    free_everywhere,
    l2_error,
    solid,
    surface_force,
)
from study.mesh.kinds import TetrahedralMesh
from study.organ.block import block_mesh
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]

A, B, L = 0.01, 0.015, 0.04
"""Half the height, half the width, the length [m]."""
P = 0.01
"""[N]"""
I = 4.0 * A**3 * B / 3.0  # noqa: E741 - the second moment's symbol
CASES: tuple[tuple[ElementName, float], ...] = (("p2", 0.3), ("taylor-hood", 0.4999))
TERMS = 60
CELLS = (0.01, 0.005)
"""[m]"""


def findings() -> Iterator[Finding]:
    """Deflection of the bent bar's end, and the whole displacement."""
    for name, nu in CASES:
        yield from _bent(name, Tissue(poisson_ratio=nu))


def _bent(name: ElementName, tissue: Tissue) -> Iterator[Finding]:
    errors = []
    for cell in CELLS:
        body, u = solved(name, tissue, cell)
        errors.append(l2_error(body.nodes, u, lambda x: displacement(x, tissue)))
    label = f"{name}, nu {tissue.poisson_ratio:g}"
    centre = np.linalg.norm(body.points - [0.0, 0.0, L], axis=1).argmin()
    exact = P * L**3 / (3.0 * tissue.youngs_modulus * I)
    yield number_of(f"deflection of the end [m], {label}", exact, float(u[3 * centre]), 1e-3)
    yield error_of(f"displacement, L2, {label}", errors[-1], 1e-3, order=observed_order(errors))


def solved(name: ElementName, tissue: Tissue, cell: float) -> tuple[Solid, Floats]:
    """The bar, and its displacement [m] (n,)."""
    mesh = block_mesh((2.0 * A, 2.0 * B, L), cell)
    body = solid(
        straight(TetrahedralMesh(mesh.points - [A, B, 0.0], mesh.tetrahedra)), name, tissue
    )
    x = body.points
    root = (x[:, 2] < 1e-9)[:, None]
    prescribed = np.where(root, displacement(x, tissue), free_everywhere(x))

    def end(points: Floats, normals: Floats) -> Floats:
        return np.where(normals[..., 2:] > 0.5, shear(points, tissue), 0.0)

    return body, at_rest(body.stiffness, surface_force(body, end), prescribed)


def displacement(points: Floats, tissue: Tissue) -> Floats:
    """Exact displacement [m] (..., 3)."""
    nu, (x, y, z) = tissue.poisson_ratio, np.moveaxis(points, -1, 0)
    across = 0.5 * nu * (L - z) * (x**2 - y**2) + 0.5 * L * z**2 - z**3 / 6.0
    along = x * (L * z - 0.5 * z**2) + _chi(x, y, nu)[0] + x * y**2
    parts = np.stack([across, nu * (L - z) * x * y, -along], axis=-1)
    return np.asarray(P / (tissue.youngs_modulus * I) * parts)


def shear(points: Floats, tissue: Tissue) -> Floats:
    """Traction [Pa] (..., 3) of a section that faces z; it is free of tension at the end."""
    nu, (x, y, _) = tissue.poisson_ratio, np.moveaxis(points, -1, 0)
    _, by_x, by_y = _chi(x, y, nu)
    xz = by_x + 0.5 * nu * x**2 + (1.0 - 0.5 * nu) * y**2
    yz = by_y + (2.0 + nu) * x * y
    scale = -P * shear_modulus(tissue) / (tissue.youngs_modulus * I)
    return np.asarray(scale * np.stack([xz, yz, np.zeros_like(xz)], axis=-1))


def _chi(x: Floats, y: Floats, nu: float) -> tuple[Floats, Floats, Floats]:
    """The flexure function chi and its slopes along x and y."""
    slope, cubic = nu * B**2 / 3.0 - (1.0 + nu) * A**2, (2.0 + nu) / 6.0
    chi = slope * x + cubic * (x**3 - 3.0 * x * y**2)
    by_x = slope + 3.0 * cubic * (x**2 - y**2)
    by_y = -6.0 * cubic * x * y
    for n in range(1, TERMS + 1):
        k = n * np.pi / B
        c = 4.0 * nu * B**2 * (-1) ** n / (np.pi**2 * n**2) / k
        # Divided by cosh(k a), which alone would overflow.
        plus, minus = np.exp(k * (x - A)), np.exp(-k * (x + A))
        rise, level = (f / (1.0 + np.exp(-2.0 * k * A)) for f in (plus - minus, plus + minus))
        chi = chi + c * rise * np.cos(k * y)
        by_x = by_x + c * k * level * np.cos(k * y)
        by_y = by_y - c * k * rise * np.sin(k * y)
    return chi, by_x, by_y
