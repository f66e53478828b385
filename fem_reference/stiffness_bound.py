"""Proven lower bounds of the stiffness of a body, by Sylvester's law of inertia."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, csc_array, diags_array

from fem_reference.direct import pivots
from fem_reference.elasticity import Body

Floats = NDArray[np.float64]

MASS_SHARE, DIAGONAL_SHARE = 0.8, 1.0 / 16.0
"""Shares of a trial eigenvalue. In straight tetrahedra, M >= 0.39 diag(M)."""
TRIES = 30


class StiffnessBound(NamedTuple):
    """K - eigenvalue M and K - diag(diagonal) are positive definite; [1/s^2] and [N/m] (n,)."""

    eigenvalue: float
    diagonal: Floats


def stiffness_lower_bound(body: Body, eigenvalue: float) -> StiffnessBound:
    """Lower bounds near `eigenvalue`, an upper bound of the lowest eigenvalue [1/s^2] of M^-1 K.

    The pivots of K - 0.8 s M - s D / 16, with D the diagonal of M, have the signs of its
    eigenvalues (Sylvester's law of inertia). Mixed elements add one negative pivot per pressure.
    The shift s is halved until the pivots prove the matrix positive definite. The effect of
    rounding on the pivots is subtracted. ValueError if no bound is found.
    """
    diagonal = body.mass.diagonal()
    stiffest = float((body.stiffness.matrix.diagonal() / diagonal).max())
    for halvings in range(TRIES):
        tried = eigenvalue * 0.5**halvings
        found = pivots(_shifted(body, tried * MASS_SHARE, tried * DIAGONAL_SHARE * diagonal))
        margin = tried * DIAGONAL_SHARE - found.rounding * stiffest
        if margin <= 0.0:
            break
        if found.in_place and found.negative == body.unknowns - body.stiffness.size:
            return StiffnessBound(tried * MASS_SHARE, margin * diagonal)
    raise ValueError("the stiffness is not definite beyond rounding: nothing holds the body")


def _shifted(body: Body, of_mass: float, diagonal: Floats) -> csc_array:
    """The system matrix minus a multiple of the mass and a diagonal, of the displacements."""
    pressures = body.unknowns - body.stiffness.size
    shift = csc_array(of_mass * body.mass + diags_array(diagonal))
    if pressures:
        shift = block_diag([shift, csc_array((pressures, pressures))])
    return csc_array(body.stiffness.system() - shift)
