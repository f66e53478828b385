"""A ball of another stiffness in a body under uniform strain, against Eshelby's closed form.

The exact displacement is prescribed on the faces of a cube of three radii half an edge, so that it
stands for a body without end; what is compared is what the ball changes of the uniform strain, so
that an error of 100 % is that of no ball at all. Meshes do not follow the ball.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fem_reference.elements import ElementName
from fem_reference.grid import straight
from study.known.finding import Finding, error_of, observed_order
from study.known.inclusion import STRAIN, BallInclusion
from study.known.verification.solid import at_rest, solid
from study.mesh.kinds import TetrahedralMesh
from study.organ.block import block_mesh
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]

RADIUS, HALF = 0.01, 0.03
"""[m]"""
CELLS = 6
"""Number of cells along each edge of the cube."""
FINER, FINER_LIMIT = (4, 7), 0.25
CONTRASTS = (1.0, 10.0, 1000.0, 0.1)
RATIOS = (("p2", 0.25), ("p2", 0.45), ("taylor-hood", 0.49))
LIMITS = {1.0: 1e-10, 10.0: 0.3, 1000.0: 0.3, 0.1: 0.5}
"""Limits of the error by contrast: elements as large as the radius do not resolve the ball."""


def findings() -> Iterator[Finding]:
    """What the ball adds, of balls as stiff as the body around, stiffer and softer."""
    for name, nu in RATIOS:
        for contrast in CONTRASTS:
            found = error(name, nu, contrast)
            label = f"ball of {contrast:g} times the modulus, {name}, nu {nu:g}"
            yield error_of(label, found, LIMITS[contrast])
    errors = [error("p2", 0.45, 10.0, count) for count in FINER]
    order = observed_order(errors, FINER[1] / FINER[0])
    label = f"ball of 10 times the modulus, {FINER[1]} cells an edge"
    yield error_of(label, errors[-1], FINER_LIMIT, order=order)


def error(name: ElementName, nu: float, contrast: float, cells: int = CELLS) -> float:
    """Relative error of what the ball adds to the displacement, of the whole if it adds nothing."""
    ball = BallInclusion.stiffer(RADIUS, contrast, Tissue(poisson_ratio=nu), STRAIN)
    mesh = block_mesh((2.0 * HALF,) * 3, 2.0 * HALF / cells)
    centred = TetrahedralMesh(mesh.points - HALF, mesh.tetrahedra)
    body = solid(straight(centred), name, ball.tissue)
    exact = ball.displacement(body.points)
    outer = np.asarray((np.abs(body.points) > HALF - 1e-9).any(axis=1))
    prescribed = np.where(outer[:, None], exact, np.nan)
    u = at_rest(body.stiffness, np.zeros(exact.size), prescribed).reshape(-1, 3)
    return ball.off(u, body.points)
