"""The tool's pressure on a half space, whose depth under it is known.

A force P on the surface moves a point at depth z and distance r of it, R^2 = r^2 + z^2, by

u_r = P / (4 pi mu) (r z / R^3 - (1 - 2 nu) r / (R (R + z)))
u_z = P / (4 pi mu) (z^2 / R^3 + 2 (1 - nu) / R)

Boussinesq (1885); Johnson (1985), Contact Mechanics, eq. 3.18. Summed over the tool's disc of
radius a with the pressure p (1 - (r / a)^2)^2, the depth at its centre is 16/15 (1 - nu^2) p a / E.
The mean depth, weighed by the pressure, is 393216 / (155925 pi) (1 - nu^2) p a / E, as the Hankel
transform 8 p a^2 J_3(k a) / (k a)^3 of the pressure and 2 (1 - nu^2) / (E k) of the surface give
(Sneddon, 1951, Fourier Transforms, ch. 10). A quarter of a block of 2.5 a is solved; on its far
faces the displacement of the half space is prescribed, so that its size leaves no error.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fem_reference.elasticity import discretise
from fem_reference.elements import ElementName
from fem_reference.stiffness import Stiffness
from study.known.finding import Finding, number_of, observed_order
from study.known.verification.moduli import shear_modulus
from study.known.verification.solid import at_rest, free_everywhere
from study.mesh.kinds import TetrahedralMesh
from study.organ.block import block_mesh
from study.problem.contact import Foundation, ToolPatch
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]

RADIUS, SIZE = 0.015, 0.0375
"""Radius of the tool's disc and edge of the block [m]."""
FORCE = 0.1
"""Force of the whole disc [N]."""
PRESSURE = 3.0 * FORCE / (np.pi * RADIUS**2)
"""Pressure at the centre [Pa]: the profile's mean is a third of it."""
GRADING = 1.5
"""Power by which cells grow away from the tool."""
CASES: tuple[tuple[ElementName, float], ...] = (
    ("p2", 0.45),
    ("taylor-hood", 0.4999),
)
CELLS = (4, 8)
"""Cells along an edge of the block."""
MEAN, CENTRE = 393216.0 / (155925.0 * np.pi), 16.0 / 15.0
"""Depth over (1 - nu^2) p a / E."""
DOWN = np.array([0.0, 0.0, -1.0])


def findings() -> Iterator[Finding]:
    """Mean depth of the half space's surface under the tool, and that at its centre."""
    for name, nu in CASES:
        tissue = Tissue(poisson_ratio=nu)
        found = np.array([depths(name, tissue, cells) for cells in CELLS])
        scale = (1.0 - nu**2) * PRESSURE * RADIUS / tissue.youngs_modulus
        for what, share, limit, ours in zip(
            ("mean depth", "depth at the centre"),
            (MEAN, CENTRE),
            (2e-3, 1e-2),
            found.T,
            strict=True,
        ):
            order = observed_order(list(np.abs(ours - share * scale)))
            label = f"{what} [m], {name}, nu {nu:g}"
            yield number_of(label, share * scale, float(ours[-1]), limit, order)


def depths(name: ElementName, tissue: Tissue, cells: int) -> tuple[float, float]:
    """Mean depth [m] and that at the centre with so many cells along an edge."""
    mesh = block_mesh((SIZE, SIZE, SIZE), SIZE / cells)
    graded = SIZE * (mesh.points / SIZE) ** GRADING * [1.0, 1.0, -1.0]
    turned = TetrahedralMesh(graded, mesh.tetrahedra[:, [0, 2, 1, 3]])
    tool = ToolPatch(np.zeros(3), DOWN, RADIUS, 0.25 * FORCE)
    body = discretise(turned, tissue, Foundation(DOWN, SIZE, 1e-3, 1.0), tool, name)
    elastic = Stiffness(body.stiffness.matrix - body.support, body.stiffness.pressure)
    u = at_rest(elastic, body.load, _prescribed(body.points, tissue))
    centre = np.linalg.norm(body.points, axis=1).argmin()
    return float(body.load @ u) / tool.force, -float(u[3 * centre + 2])


def _prescribed(x: Floats, tissue: Tissue) -> Floats:
    """Symmetry on two planes, the half space's displacement on the far faces."""
    symmetric = (x < 1e-9) & [True, True, False]
    prescribed = np.where(symmetric, 0.0, free_everywhere(x))
    far = (np.abs(x) > SIZE - 1e-9).any(axis=1)
    prescribed[far] = displacement(x[far], tissue)
    return prescribed


def displacement(points: Floats, tissue: Tissue) -> Floats:
    """Exact displacement [m] (n, 3) below the surface z = 0, far enough from the tool.

    By Gauss's rule along the radius and the trapezoidal rule round the disc, both of which converge
    geometrically there.
    """
    s, weight = np.polynomial.legendre.leggauss(12)
    r, angle = 0.5 * RADIUS * (s + 1.0), np.linspace(0.0, 2.0 * np.pi, 32, endpoint=False)
    ring = weight * 0.5 * RADIUS * r * PRESSURE * (1.0 - (r / RADIUS) ** 2) ** 2 * 2.0 * np.pi / 32
    x = np.outer(r, np.cos(angle)).ravel()
    y = np.outer(r, np.sin(angle)).ravel()
    off = points[:, None] - np.stack([x, y, np.zeros_like(x)], axis=1)
    return np.asarray(np.einsum("nqd,q->nd", point_force(off, tissue), np.repeat(ring, 32)))


def point_force(off: Floats, tissue: Tissue) -> Floats:
    """Displacement per newton [m/N] (..., 3) at places relative to the force, which pushes down."""
    nu, scale = tissue.poisson_ratio, 1.0 / (4.0 * np.pi * shear_modulus(tissue))
    R, z = np.linalg.norm(off, axis=-1), -off[..., 2]
    sideways = z / R**3 - (1.0 - 2.0 * nu) / (R * (R + z))
    downwards = z**2 / R**3 + 2.0 * (1.0 - nu) / R
    parts = [off[..., 0] * sideways, off[..., 1] * sideways, -downwards]
    return np.asarray(scale * np.stack(parts, axis=-1))
