"""Sparse factors, for systems that are small or solved many times."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

Floats = NDArray[np.float64]
Solve = Callable[[Floats], Floats]

IMBALANCE = 1e-6
"""Share of the load by which no answer is out of balance, whatever rounding is to be expected."""


def factorised(matrix: csc_array) -> Solve:
    """Solution by factors of a symmetric matrix, in an ordering that keeps them small.

    The matrix is positive definite, or that of a saddle point with definite blocks, which has such
    factors in any ordering too. ValueError if it is singular: nothing holds the body.
    """
    factors = _factors(matrix)
    return lambda f: np.asarray(factors.solve(f))


class Pivots(NamedTuple):
    """Of a symmetric matrix: how many are negative, and whether all were taken from the diagonal.

    `largest_column`: entries of the fullest column of the factor.
    """

    negative: int
    in_place: bool
    largest_column: int


def pivots(matrix: csc_array) -> Pivots:
    """Of the factors of a symmetric matrix. ValueError if it is singular."""
    factors = _factors(matrix)
    return Pivots(
        int((factors.U.diagonal() < 0.0).sum()),
        bool(np.array_equal(factors.perm_r, factors.perm_c)),
        int(np.diff(factors.L.indptr).max()),
    )


def _factors(matrix: csc_array) -> Any:
    try:
        return splu(
            matrix,
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError:
        raise ValueError("the stiffness is singular: the support does not hold the body") from None
