"""Sparse factors, for systems that are small or solved many times."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

Floats = NDArray[np.float64]
Solve = Callable[[Floats], Floats]

IMBALANCE = 1e-6
"""Share of the load by which no answer is out of balance, whatever rounding is to be expected."""


def factorised(matrix: Any) -> Solve:
    """Solution by factors of a symmetric sparse matrix, in an ordering that keeps them small.

    The matrix is positive definite, or that of a saddle point with definite blocks, which has such
    factors in any ordering too. ValueError if it is singular: nothing holds the body.
    """
    try:
        factors = splu(
            csc_array(matrix),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError:
        raise ValueError("the stiffness is singular: the support does not hold the body") from None
    return lambda f: np.asarray(factors.solve(f))
