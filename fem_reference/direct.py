"""Sparse direct solvers, for systems that are small or solved many times."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array, diags_array

from study.numerics.factors import symmetric_factors

Floats = NDArray[np.float64]
Solve = Callable[[Floats], Floats]

EPSILON = float(np.finfo(np.float64).eps)
IMBALANCE = 1e-6
"""Largest admissible residual relative to the load, whatever rounding is to be expected."""


def factorised(matrix: Any) -> Solve:
    """Direct solver of a symmetric sparse matrix, in a fill-reducing ordering.

    The matrix is positive definite, or that of a saddle point with definite blocks, which can be
    factored without pivoting in any ordering too. ValueError if it is singular.
    """
    factors = _factors(matrix)
    return lambda f: np.asarray(factors.solve(f))


class Pivots(NamedTuple):
    """Pivots of a symmetric matrix: number of negative ones, and whether all are diagonal.

    They are the exact pivots of a perturbed matrix. As a quadratic form, the perturbation is at
    most `rounding` times the magnitudes of the diagonal.
    """

    negative: int
    in_place: bool
    rounding: float


def pivots(matrix: csc_array) -> Pivots:
    """Pivots of the factors of a symmetric matrix. ValueError if it is singular.

    Rounding changes an entry by k eps (|L| |U|) at most, with k entries in the fullest row of L;
    with |L| |U| = S S^T the spectral norm is below the product of the largest sums of rows and of
    columns of S. Higham (2002), Accuracy and Stability of Numerical Algorithms, sections 9.3, 10.1.
    """
    factors = _factors(matrix)
    pivot, in_place = factors.U.diagonal(), np.array_equal(factors.perm_r, factors.perm_c)
    lower, diagonal = abs(csr_array(factors.L)), np.empty(len(pivot))
    diagonal[factors.perm_r] = np.abs(matrix.diagonal())
    sizes = diags_array(1.0 / np.sqrt(diagonal)) @ lower @ diags_array(np.sqrt(np.abs(pivot)))
    entries = int(np.diff(lower.indptr).max())
    largest = float(sizes.sum(axis=1).max() * sizes.sum(axis=0).max())
    return Pivots(int((pivot < 0.0).sum()), bool(in_place), entries * EPSILON * largest)


def _factors(matrix: csc_array) -> Any:
    found = symmetric_factors(matrix)
    if found is None:
        raise ValueError("the stiffness is singular: the support does not hold the body")
    return found
