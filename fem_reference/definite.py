"""A proof, by the signs of pivots, of how stiff a body is at least."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, csc_array, diags_array

from fem_reference.direct import pivots
from fem_reference.elasticity import Body

Floats = NDArray[np.float64]

MASS_SHARE, DIAGONAL_SHARE = 0.8, 1.0 / 16.0
"""Of the eigenvalue tried; a mass is 0.39 of its diagonal or more, in straight tetrahedra."""
TRIES = 30


class StiffnessFloor(NamedTuple):
    """K - eigenvalue M and K - diag(diagonal) are positive definite, [1/s^2] and [N/m] (n,)."""

    eigenvalue: float
    diagonal: Floats


def stiffness_floor(body: Body, eigenvalue: float) -> StiffnessFloor:
    """A floor near an upper bound of the lowest squared angular frequency [1/s^2].

    The pivots of K - 0.8 s M - s D / 16, D the diagonal of M, have the signs of its eigenvalues
    (Sylvester's law of inertia), those of a saddle point beside one negative sign for each
    pressure; s is halved until they prove it definite. What rounding may do to them is taken off.
    ValueError if no floor is found.
    """
    diagonal = body.mass.diagonal()
    stiffest = float((body.stiffness.matrix.diagonal() / diagonal).max())
    for halvings in range(TRIES):
        tried = eigenvalue * 0.5**halvings
        found = pivots(_shifted(body, tried * MASS_SHARE, tried * DIAGONAL_SHARE * diagonal))
        left = tried * DIAGONAL_SHARE - found.rounding * stiffest
        if left <= 0.0:
            break
        if found.in_place and found.negative == body.unknowns - body.stiffness.size:
            return StiffnessFloor(tried * MASS_SHARE, left * diagonal)
    raise ValueError("the stiffness is not definite beyond rounding: nothing holds the body")


def _shifted(body: Body, of_mass: float, diagonal: Floats) -> csc_array:
    """The system less a share of the mass and a diagonal, among displacements."""
    pressures = body.unknowns - body.stiffness.size
    shift = csc_array(of_mass * body.mass + diags_array(diagonal))
    if pressures:
        shift = block_diag([shift, csc_array((pressures, pressures))])
    return csc_array(body.stiffness.system() - shift)
