"""A body that nothing holds: six motions without strain, and its mass and inertia."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from fem_reference.elasticity import Body, discretise
from study.known.verification.finding import Finding, value
from study.organ.block import block_mesh
from study.problem.contact import Foundation, ToolPatch
from study.problem.tissue import Tissue

SIZE = (0.06, 0.05, 0.04)
TISSUE = Tissue(poisson_ratio=0.3)
LIMIT = 1e-10


def findings() -> Iterator[Finding]:
    """Eigenvalues of the elastic stiffness, mass, moment of inertia about the corner's z axis."""
    body = _body()
    elastic = (body.stiffness.matrix - body.support).toarray()
    values = eigh(elastic, body.mass.toarray(), eigvals_only=True, subset_by_index=[0, 6])
    # A mechanism would make the seventh as small as the sixth.
    yield Finding("sixth eigenvalue over the seventh", float(abs(values[5] / values[6])), LIMIT)
    x, y, _ = body.points.T
    along, turning = np.zeros((2, body.node_count, 3))
    along[:, 0], turning[:, 0], turning[:, 1] = 1.0, -y, x
    mass = TISSUE.density * float(np.prod(SIZE))
    yield value("mass [kg]", mass, _product(body, along), LIMIT)
    inertia = mass * (SIZE[0] ** 2 + SIZE[1] ** 2) / 3.0
    yield value("moment of inertia [kg m^2]", inertia, _product(body, turning), LIMIT)


def _body() -> Body:
    down = np.array([0.0, 0.0, -1.0])
    tool = ToolPatch(np.array([0.03, 0.025, 0.04]), down, 0.02, 1.0)
    return discretise(block_mesh(SIZE, 0.02), TISSUE, Foundation(down, 0.0, 1e-3, 1e6), tool, "p2")


def _product(body: Body, motion: NDArray[np.float64]) -> float:
    return float(motion.ravel() @ (body.mass @ motion.ravel()))
