"""An unsupported body: six rigid motions without strain, and its mass and inertia."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from fem_reference.elasticity import Body
from study.known.finding import Finding, error_of, number_of
from study.known.pressed import BLOCK, block
from study.problem.tissue import Tissue

TISSUE = Tissue(poisson_ratio=0.3)
LIMIT = 1e-10


def findings() -> Iterator[Finding]:
    """Stiffness to rigid motions, mass, and moment of inertia about the corner's z axis."""
    body = block(TISSUE, "p2", 0.02)
    elastic = (body.stiffness.matrix - body.support).toarray()
    values = eigh(elastic, body.mass.toarray(), eigvals_only=True, subset_by_index=[0, 6])
    # A mechanism would make the seventh as small as the sixth.
    yield error_of("sixth eigenvalue over the seventh", float(abs(values[5] / values[6])), LIMIT)
    x, y, _ = body.points.T
    along, turning = np.zeros((2, body.node_count, 3))
    along[:, 0], turning[:, 0], turning[:, 1] = 1.0, -y, x
    mass = TISSUE.density * float(np.prod(BLOCK))
    yield number_of("mass [kg]", mass, _product(body, along), LIMIT)
    inertia = mass * (BLOCK[0] ** 2 + BLOCK[1] ** 2) / 3.0
    yield number_of("moment of inertia [kg m^2]", inertia, _product(body, turning), LIMIT)


def _product(body: Body, motion: NDArray[np.float64]) -> float:
    return float(motion.ravel() @ (body.mass @ motion.ravel()))
