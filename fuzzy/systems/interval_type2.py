"""Interval type-2 Mamdani inference with type reduction.

Between a lower and an upper membership lies a whole family of type-1 sets. Their centroids fill an
interval whose ends belong to sets that switch once from one bound to the other (Karnik and Mendel).
Prefix sums give the centroid for every switch point at once, so the ends are found without
iteration; EIASC finds the same ends by stepping until the switch point passes the centroid. The
answer is the middle of the interval, or Nie and Tan's centroid of the mean of both bounds.
"""

from typing import Literal

import numpy as np

from fuzzy.systems import exact
from fuzzy.systems.quadrature import Output, Quadrature, Sampling, centroid, sampled
from fuzzy.systems.sets import Array, lower_membership, upper_membership
from fuzzy.systems.system import FuzzySystem, firing_strengths, memberships, merged, union

Reducer = Literal["karnik-mendel", "eiasc", "nie-tan"]

# Products of smaller areas lose their digits to underflow.
LEAST_AREA = 1e-290


def bounds_of_firing(system: FuzzySystem, X: Array) -> tuple[Array, Array]:
    """Lower and upper heights of the output sets, each shape (sets, N)."""
    lower = firing_strengths(system, X, lower_membership, upper_membership)
    upper = firing_strengths(system, X, upper_membership, lower_membership)
    return merged(system, lower), merged(system, upper)


def evaluate(
    system: FuzzySystem, X: Array, sampling: Sampling, samples: int, reducer: Reducer
) -> Output:
    """Answer (N,) and interval (N, 2) of the centroid for the readings X (N, inputs)."""
    low_fired, high_fired = bounds_of_firing(system, X)
    strength = high_fired.max(axis=0)
    if sampling == "exact":
        rows = [
            exact.reduce(system, *heights)
            for heights in zip(low_fired.T, high_fired.T, strict=True)
        ]
        interval = np.array([row.interval for row in rows])
        middle = np.array([row.nie_tan for row in rows])
    else:
        quadrature = sampled(system.output, samples, sampling)
        y = quadrature.y
        lower_sets = memberships(system.output, y, lower_membership)
        upper_sets = memberships(system.output, y, upper_membership)
        lower = union(low_fired, lower_sets, system.operators)
        upper = union(high_fired, upper_sets, system.operators)
        find = eiasc if reducer == "eiasc" else karnik_mendel
        interval = find(quadrature, lower, upper)
        middle = centroid(quadrature, lower + upper)
    value = middle if reducer == "nie-tan" else interval.mean(axis=-1)
    return Output(value, interval, strength)


def karnik_mendel(quadrature: Quadrature, lower: Array, upper: Array) -> Array:
    """Ends [c_l, c_r] of the centroids between lower and upper (..., M), shape (..., 2).

    NaN where upper is 0 at every point.
    """
    y, weights = quadrature
    left = _least_centroid(y, weights * lower, weights * upper)
    mirrored = (weights * bound for bound in (lower, upper))
    right = -_least_centroid(-y[::-1], *(bound[..., ::-1] for bound in mirrored))
    return np.stack([left, right], axis=-1)


def _least_centroid(y: Array, lower: Array, upper: Array) -> Array:
    """Least centroid over all switch points: upper up to the switch, lower after it."""
    area = _switched_sums(lower, upper)
    moment = _switched_sums(y * lower, y * upper)
    centroids = np.divide(moment, area, out=np.full_like(area, np.inf), where=area > LEAST_AREA)
    least = np.asarray(centroids.min(axis=-1))
    return np.where(np.isfinite(least), least, np.nan)


def _switched_sums(lower: Array, upper: Array) -> Array:
    """Sums of the first k terms of upper and the rest of lower, k = 0..M, shape (..., M + 1)."""
    gained = np.cumsum(upper - lower, axis=-1)
    none = np.zeros_like(gained[..., :1])
    return np.asarray(lower.sum(axis=-1, keepdims=True) + np.concatenate([none, gained], axis=-1))


def eiasc(quadrature: Quadrature, lower: Array, upper: Array) -> Array:
    """The ends of `karnik_mendel` by the iteration of Wu and Nie (2011), same shapes."""
    y, weights = quadrature
    rows = np.broadcast_shapes(lower.shape, upper.shape)[:-1]
    lower, upper = (np.broadcast_to(weights * b, (*rows, y.size)) for b in (lower, upper))
    flat = [bound.reshape(-1, y.size) for bound in (lower, upper)]
    left = [_stepped(y, low, high) for low, high in zip(*flat, strict=True)]
    right = [-_stepped(-y[::-1], low[::-1], high[::-1]) for low, high in zip(*flat, strict=True)]
    return np.stack([np.reshape(left, rows), np.reshape(right, rows)], axis=-1)


def _stepped(y: Array, lower: Array, upper: Array) -> float:
    """Least centroid of one row: take samples over to the upper bound while that lowers it."""
    area, moment = float(lower.sum()), float(y @ lower)
    for y_k, gain in zip(y, upper - lower, strict=True):
        if area > LEAST_AREA and y_k * area > moment:
            break
        area += gain
        moment += y_k * gain
    return moment / area if area > LEAST_AREA else np.nan
