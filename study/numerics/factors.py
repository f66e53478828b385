"""Sparse factors of symmetric matrices, whose pivots show how many eigenvalues are negative."""

from __future__ import annotations

from typing import Any

from scipy.sparse import csc_array
from scipy.sparse.linalg import splu


def symmetric_factors(matrix: csc_array) -> Any:
    """Sparse factors by symmetric elimination, whose pivots have the signs of the eigenvalues.

    None if the matrix is singular.
    """
    try:
        return splu(
            csc_array(matrix),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError:
        return None


def has_inertia(factors: Any, negative: int = 0) -> bool:
    """Whether symmetric factors show so many negative eigenvalues, and all others positive.

    By Sylvester's law of inertia, which needs all pivots on the diagonal; False without factors.
    """
    if factors is None or not (factors.perm_r == factors.perm_c).all():
        return False
    pivot = factors.U.diagonal()
    return bool((pivot < 0.0).sum() == negative and (pivot > 0.0).sum() == len(pivot) - negative)
