"""Type reduction of sampled bounds to an interval of centroids, and its defuzzification.

The ends of the interval belong to sets that switch once from one bound to the other (Karnik and
Mendel). Prefix sums give the centroids for all switch points at once, without iteration. EIASC
finds the same ends by increasing the switch point until it passes the centroid.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from fuzzy.systems.quadrature import Quadrature
from fuzzy.systems.sets import Array

# Products of smaller areas lose their digits to underflow.
LEAST_AREA = 1e-290


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
    """Least centroid of one row: samples switch to the upper bound while that lowers it."""
    area, moment = float(lower.sum()), float(y @ lower)
    for y_k, gain in zip(y, upper - lower, strict=True):
        if area > LEAST_AREA and y_k * area > moment:
            break
        area += gain
        moment += y_k * gain
    return moment / area if area > LEAST_AREA else np.nan


class Reducer(NamedTuple):
    """A method of type reduction and defuzzification.

    `ends` returns the interval (..., 2) for sampled bounds (..., M); exact sampling uses the ends
    of Karnik and Mendel. `nie_tan`: the output is the centroid of the mean of both bounds (Nie and
    Tan) instead of the midpoint of the interval. `words` and `exact_words` describe the method with
    and without samples.
    """

    ends: Callable[[Quadrature, Array, Array], Array]
    nie_tan: bool
    words: str
    exact_words: str


_EXACT = "middle of the exact Karnik-Mendel interval"
_NIE_TAN = "Nie-Tan centroid, interval by Karnik-Mendel"

REDUCERS: dict[str, Reducer] = {
    "karnik-mendel": Reducer(karnik_mendel, False, _EXACT, _EXACT),
    "eiasc": Reducer(eiasc, False, "middle of the interval by EIASC", _EXACT),
    "nie-tan": Reducer(karnik_mendel, True, _NIE_TAN, _NIE_TAN),
}
