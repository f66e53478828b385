"""A smooth displacement, the body force that it takes, and the order at which elements find it.

On the unit cube u = w + (mu / lambda) v with w_x = sin(pi y) cos(pi z) and so on round, free of
divergence, and v the gradient of s / (3 pi^2), s = sin(pi x) sin(pi y) sin(pi z). Both are
eigenfunctions of the Laplacian, so the force is 2 pi^2 mu w + 3 pi^2 (lambda + 2 mu) (mu / lambda)
v; lambda div u = -mu s stays bounded as nu goes to 1/2. Manufactured solutions: Roache (2002), J.
Fluids Eng. 124:4. Orders of the L2 error, the degree plus one: Ciarlet (1978), The Finite Element
Method for Elliptic Problems, sec. 3.2; Taylor-Hood: Boffi, Brezzi and Fortin (2013), Mixed Finite
Element Methods, ch. 8.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fem_reference.elements import ElementName
from fem_reference.grid import straight
from study.known.finding import Finding, convergence
from study.known.verification.moduli import lame_lambda, oedometric, shear_modulus
from study.known.verification.solid import (
    at_rest,
    body_force,
    free_everywhere,
    l2_error,
    solid,
)
from study.organ.block import block_mesh
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]

ORDER_TOLERANCE = 0.1


def linear() -> Iterator[Finding]:
    """Order and error of linear tetrahedra."""
    yield from _converging("p1", 0.3, (8, 16), 2, 0.02)


def quadratic() -> Iterator[Finding]:
    """Order and error of quadratic tetrahedra."""
    yield from _converging("p2", 0.3, (4, 8), 3, 0.002)


def mixed() -> Iterator[Finding]:
    """Order and error of Taylor-Hood elements, the same at both Poisson ratios."""
    for nu in (0.3, 0.4999):
        yield from _converging("taylor-hood", nu, (4, 8), 3, 0.002)


def _converging(
    name: ElementName, nu: float, cells: tuple[int, ...], order: int, limit: float
) -> Iterator[Finding]:
    errors = [error(name, Tissue(poisson_ratio=nu), n) for n in cells]
    label = f"displacement, L2, {name}, nu {nu:g}"
    yield from convergence(label, errors, order, ORDER_TOLERANCE, limit)


def error(name: ElementName, tissue: Tissue, cells: int) -> float:
    """Relative L2 error with `cells` along an edge, displacements prescribed on the boundary."""
    body = solid(straight(block_mesh((1.0, 1.0, 1.0), 1.0 / cells)), name, tissue)
    x = body.points
    inner = np.all((x > 1e-9) & (x < 1.0 - 1e-9), axis=1)[:, None]
    prescribed = np.where(inner, free_everywhere(x), displacement(x, tissue))
    u = at_rest(body.stiffness, body_force(body, lambda p: force(p, tissue)), prescribed)
    return l2_error(body.nodes, u, lambda p: displacement(p, tissue))


def displacement(x: Floats, tissue: Tissue) -> Floats:
    """The manufactured solution [m] (..., 3)."""
    return _solenoidal(x) + shear_modulus(tissue) / lame_lambda(tissue) * _gradient(x)


def force(x: Floats, tissue: Tissue) -> Floats:
    """The force per volume of the manufactured solution [N/m^3] (..., 3)."""
    mu, lame = shear_modulus(tissue), lame_lambda(tissue)
    gradient = 3.0 * oedometric(tissue) * mu / lame * _gradient(x)
    return np.asarray(np.pi**2 * (2.0 * mu * _solenoidal(x) + gradient))


def _solenoidal(x: Floats) -> Floats:
    following, last = np.roll(x, -1, axis=-1), np.roll(x, -2, axis=-1)
    return np.asarray(np.sin(np.pi * following) * np.cos(np.pi * last))


def _gradient(x: Floats) -> Floats:
    following, last = np.roll(x, -1, axis=-1), np.roll(x, -2, axis=-1)
    product = np.cos(np.pi * x) * np.sin(np.pi * following) * np.sin(np.pi * last)
    return np.asarray(product / (3.0 * np.pi))
