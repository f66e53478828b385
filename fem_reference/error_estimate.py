"""Discretisation error estimated from systematically refined meshes.

Two meshes and the order of convergence give the error of the finer one by Richardson's
extrapolation; three give the order too. As a grid convergence index, the estimate is multiplied by
a safety factor, larger where the order is assumed: Roache (1994), J. Fluids Eng. 116:405; Celik et
al. (2008), J. Fluids Eng. 130:078001. Where three results alternate (Stern et al. 2001, J. Fluids
Eng. 123:793), or come no nearer to each other, there is nothing to extrapolate: half their range
takes its place, times the factor of an assumed order (Eca and Hoekstra 2014, J. Comput. Phys.
262:104).

Adaptively refined meshes are not geometrically similar and show no order. Their error is assumed to
decrease with the order of the elements for smooth solutions, which adaptive refinement recovers
for singular ones: a saturation assumption, Bank and Smith (1993), SIAM J. Numer. Anal. 30:921.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SAFETY = 1.25
SAFETY_ASSUMED = 3.0
"""Where the order is assumed: two meshes, or three without an observed order in range."""
SAFETY_GRADED = 1.5
"""Graded meshes. In tests/benchmarks, 1.25 held for seven organs, with true errors up to 0.88 of
the estimate."""
ASSUMED_ORDER = 2.0
"""Order of flat facets, of edges of a support, and of most users' meshes."""
LEAST_ORDER = 1.0
BEYOND = 0.5
"""Distance of an observed order from its range above which meshes count as not yet asymptotic."""
FLATTEST, STEEPEST = 1e-6, 12.0
TINY = 1e-300


@dataclass(frozen=True)
class ErrorEstimate:
    """Estimated relative error of the finest mesh, and the observed order.

    `observed`: order of convergence of the three finest meshes; None for two meshes, and for
    results that alternate or diverge.
    """

    error: float
    observed: float | None


def discretisation_error(
    results: Sequence[Floats], sizes: Sequence[float], formal: float, weights: Floats | None = None
) -> ErrorEstimate:
    """Relative L2 error from results (n, 3) on meshes of element `sizes`, coarse to fine.

    `weights` (n,): of the points. An observed order outside [1, `formal`], `formal` the order of
    the element, is clipped to that range, and counts as assumed if it is well above. If it is well
    below, or there is none, the estimate is half the range of the last three results.
    """
    w = np.ones(len(results[-1])) if weights is None else weights
    steps = [fine - coarse for coarse, fine in pairwise(results)]
    whole = max(_product(results[-1], results[-1], w), TINY)
    norms = [math.sqrt(_product(step, step, w) / whole) for step in steps]
    ratio = sizes[-2] / sizes[-1]
    if len(results) == 2:
        return ErrorEstimate(SAFETY_ASSUMED * norms[-1] / (ratio**ASSUMED_ORDER - 1.0), None)
    alternate = _product(steps[-2], steps[-1], w) < 0.0
    observed = None if alternate else observed_order(norms[-2], norms[-1], sizes[-3:])
    if observed is None or observed < LEAST_ORDER - BEYOND:
        both = steps[-2] + steps[-1]
        extent = max(*norms[-2:], math.sqrt(_product(both, both, w) / whole))
        return ErrorEstimate(SAFETY_ASSUMED * 0.5 * extent, observed)
    order = min(max(observed, LEAST_ORDER), formal)
    safety = SAFETY if abs(observed - order) <= BEYOND else SAFETY_ASSUMED
    return ErrorEstimate(safety * norms[-1] / (ratio**order - 1.0), observed)


def graded_error(
    results: Sequence[Floats], sizes: Sequence[float], order: float, weights: Floats | None = None
) -> ErrorEstimate:
    """Discretisation error on adaptively refined meshes, at an assumed `order` of convergence.

    The last change counts at least as much as the one before implies at that order, since a change
    may be small by coincidence.
    """
    w = np.ones(len(results[-1])) if weights is None else weights
    whole = max(_product(results[-1], results[-1], w), TINY)
    changes = [
        math.sqrt(_product(fine - coarse, fine - coarse, w) / whole)
        for coarse, fine in pairwise(results[-3:])
    ]
    shrunk = [(h / sizes[-1]) ** order for h in sizes[-len(changes) - 1 :]]
    # Between meshes with errors e r and e, the results change by at least e (r - 1).
    left = [c / (a - b) for c, (a, b) in zip(changes, pairwise(shrunk), strict=True)]
    safety = SAFETY_GRADED if len(left) > 1 else SAFETY_ASSUMED
    return ErrorEstimate(safety * max(left), None)


def _product(a: Floats, b: Floats, weights: Floats) -> float:
    return float(weights @ (a * b).sum(axis=1))


def observed_order(
    coarse_difference: float, fine_difference: float, sizes: Sequence[float]
) -> float | None:
    """Order p with (h_1^p - h_2^p) / (h_2^p - h_3^p) equal to the ratio of the differences.

    None if no positive order satisfies it.
    """
    h1, h2, h3 = sizes
    if not (coarse_difference > 0.0 and fine_difference > 0.0):
        return None
    wanted = math.log(coarse_difference / fine_difference)

    def excess(p: float) -> float:
        return math.log((h1**p - h2**p) / (h2**p - h3**p)) - wanted

    if excess(FLATTEST) > 0.0:
        return None
    from scipy.optimize import brentq

    return float(brentq(excess, FLATTEST, STEEPEST)) if excess(STEEPEST) > 0.0 else STEEPEST
