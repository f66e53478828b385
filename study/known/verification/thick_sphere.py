"""A thick sphere under inner pressure, up to nu 0.49999: locking, and elements without it.

With inner radius a, outer radius b and pressure p, the radial displacement is A r + B / r^2,
A = p a^3 (1 - 2 nu) / (E (b^3 - a^3)), B = p a^3 b^3 (1 + nu) / (2 E (b^3 - a^3)). Lame and
Clapeyron (1833); Timoshenko and Goodier (1970), Theory of Elasticity, art. 136. An eighth is
solved, with symmetry on three planes and curved quadratic elements.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fem_reference.elements import ElementName
from fem_reference.grid import curved, straight
from study.known.finding import Finding, error_of, observed_order
from study.known.verification.round_shapes import shell_octant
from study.known.verification.solid import (
    at_rest,
    free_everywhere,
    largest_error,
    solid,
    surface_force,
)
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]

INNER, OUTER = 0.05, 0.10
"""[m]"""
PRESSURE = 100.0
"""[Pa]"""
LAYERS = (3, 4)
RATIOS = (0.3, 0.45, 0.49, 0.499, 0.49999)


def findings() -> Iterator[Finding]:
    """Largest nodal error of the displacement, and the variation of Taylor-Hood's with nu.

    The locking of displacement elements as nu grows is reported without a criterion: it is why a
    reference near nu 1/2 needs a pressure field.
    """
    mixed = []
    for nu in RATIOS:
        coarse, fine = (error("taylor-hood", nu, layers) for layers in LAYERS)
        mixed.append(fine)
        order = observed_order([coarse, fine], ratio=LAYERS[1] / LAYERS[0])
        yield error_of(
            f"displacement, largest error, taylor-hood, nu {nu:g}", fine, 0.005, order=order
        )
    spread = max(mixed) / min(mixed) - 1.0
    yield error_of("spread over nu of the error of taylor-hood", spread, 0.1)
    for name in ("p2", "p1"):
        for nu in RATIOS:
            yield error_of(f"displacement, largest error, {name}, nu {nu:g}", error(name, nu))


def error(name: ElementName, nu: float, layers: int = LAYERS[-1]) -> float:
    """Largest nodal error over the largest displacement."""
    tissue = Tissue(poisson_ratio=nu)
    mesh, project = shell_octant(INNER, OUTER, layers)
    body = solid(straight(mesh) if name == "p1" else curved(mesh, project), name, tissue)
    symmetric = body.points < 1e-9
    prescribed = np.where(symmetric, 0.0, free_everywhere(body.points))
    u = at_rest(body.stiffness, surface_force(body, _pressure), prescribed)
    return largest_error(u, displacement(body.points, tissue))


def _pressure(points: Floats, normals: Floats) -> Floats:
    """Traction [Pa] against the outward normal of the inner sphere."""
    inside = np.linalg.norm(points, axis=-1) < 0.5 * (INNER + OUTER)
    # Only the spheres have normals along the radius; planes of symmetry have them across.
    radial = np.abs((points * normals).sum(axis=-1)) > 0.5 * np.linalg.norm(points, axis=-1)
    return np.asarray(np.where((inside & radial)[..., None], -PRESSURE * normals, 0.0))


def displacement(x: Floats, tissue: Tissue) -> Floats:
    """Exact displacement [m] (..., 3)."""
    E, nu, r = tissue.youngs_modulus, tissue.poisson_ratio, np.linalg.norm(x, axis=-1)
    share = PRESSURE * INNER**3 / (E * (OUTER**3 - INNER**3))
    radial = share * ((1.0 - 2.0 * nu) + 0.5 * (1.0 + nu) * (OUTER / r) ** 3)
    return np.asarray(radial[..., None] * x)
