"""Interval type-2 Mamdani inference with exact Karnik-Mendel type reduction.

Between a lower and an upper membership lies a whole family of type-1 sets. Their centroids fill an
interval whose ends belong to sets that switch once from one bound to the other. Prefix sums give
the centroid for every switch point at once, so the ends are found without iteration.
"""

import numpy as np

from fuzzy.sets import Array, lower_membership, upper_membership
from fuzzy.system import System, grid, heights, memberships, require_firing, union

# Products of smaller areas lose their digits to underflow.
LEAST_AREA = 1e-290


def type_reduce(y: Array, lower: Array, upper: Array) -> Array:
    """Ends [c_l, c_r] of the centroids between lower and upper (..., M) at y (M,), shape (..., 2).

    y must increase. Raises ValueError where upper is 0 at every sample.
    """
    left = _least_centroid(y, lower, upper)
    right = -_least_centroid(-y[::-1], lower[..., ::-1], upper[..., ::-1])
    return np.stack([left, right], axis=-1)


def _least_centroid(y: Array, lower: Array, upper: Array) -> Array:
    """Least centroid: upper bound up to a switch point, lower bound after it."""
    area = _switched_sums(lower, upper)
    moment = _switched_sums(y * lower, y * upper)
    centroids = np.divide(moment, area, out=np.full_like(area, np.inf), where=area > LEAST_AREA)
    least = centroids.min(axis=-1)
    if not np.all(np.isfinite(least)):
        raise ValueError("the upper membership is 0 at every sample: there is nothing to reduce")
    return np.asarray(least)


def _switched_sums(lower: Array, upper: Array) -> Array:
    """Sums of the first k terms of upper and the rest of lower, k = 0..M, shape (..., M + 1)."""
    gained = np.cumsum(upper - lower, axis=-1)
    none = np.zeros_like(gained[..., :1])
    return np.asarray(lower.sum(axis=-1, keepdims=True) + np.concatenate([none, gained], axis=-1))


def evaluate(system: System, X: Array, samples: int) -> tuple[Array, Array]:
    """Midpoint (N,) and interval (N, 2) of the centroid for the readings X (N, inputs)."""
    upper_fired = heights(system, X, upper_membership)
    require_firing(system, X, upper_fired)
    lower_fired = heights(system, X, lower_membership)
    y = grid(system.output, samples)
    lower = union(lower_fired, memberships(system.output, y, lower_membership))
    upper = union(upper_fired, memberships(system.output, y, upper_membership))
    interval = type_reduce(y, lower, upper)
    return interval.mean(axis=-1), interval
