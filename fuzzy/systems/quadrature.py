"""Quadrature points and weights on the output's universe, and defuzzification."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fuzzy.systems.sets import Array
from fuzzy.systems.system import Variable

ROUNDING = 1e-14
"""Share by which memberships or areas that are equal may differ in floating-point numbers."""


class Sampling(NamedTuple):
    """Integration rule of the output curve.

    `weights` returns the weights (M,) of M equidistant samples, None for exact integration. `words`
    describe it, with {samples} for their number. `size` orders points for smallest and largest of
    maximum: MATLAB takes the point nearest to 0, Octave the first.
    """

    weights: Callable[[int], Array] | None
    words: str
    size: Callable[[Array], Array] = np.abs


def _trapezoidal(samples: int) -> Array:
    weights = np.ones(samples)
    weights[[0, -1]] = 0.5
    return weights


SAMPLINGS: dict[str, Sampling] = {
    "matlab": Sampling(np.ones, "sums over {samples} points"),
    "octave": Sampling(_trapezoidal, "the trapezoidal rule over {samples} points", np.positive),
    "exact": Sampling(None, "integration between the kinks of the curve"),
}
"""By name: MATLAB's `evalfis` has equal weights, Octave's toolkit halves those of both ends."""


def is_exact(sampling: str) -> bool:
    """Whether a sampling, by name, is exact."""
    return SAMPLINGS[sampling].weights is None


class Quadrature(NamedTuple):
    """Ascending points y (M,) and weights (M,), of which only ratios matter."""

    y: Array
    weights: Array


class Output(NamedTuple):
    """Output of an inference system for N rows of readings.

    `value` (N,) is NaN where nothing fires, `interval` (N, 2) the ends of the type-reduced set of
    type-2 and None for the others, `strength` (N,) the strength of the strongest output set.
    """

    value: Array
    interval: Array | None
    strength: Array


def sampled(variable: Variable, samples: int, sampling: str) -> Quadrature:
    """`samples` equidistant points, both ends included. ValueError for a sampling without any."""
    weights = SAMPLINGS[sampling].weights
    if weights is None:
        raise ValueError(f"sampling = {sampling!r} takes no samples: use matlab or octave")
    return Quadrature(np.linspace(variable.low, variable.high, samples), weights(samples))


def centroid(quadrature: Quadrature, mu: Array) -> Array:
    """Centre of gravity of mu (..., M) sampled at the points, shape (...); NaN where mu is 0."""
    y, weights = quadrature
    area = mu @ weights
    moment = mu @ (weights * y)
    return np.divide(moment, area, out=np.full_like(area, np.nan), where=area > 0)


def bisector(quadrature: Quadrature, mu: Array) -> Array:
    """The first point with half of the area under mu (..., M) up to it, shape (...).

    Octave's toolkit returns the number of the sample instead of the point.
    """
    area = np.cumsum(mu * quadrature.weights, axis=-1)
    return np.asarray(quadrature.y[(area >= (0.5 - ROUNDING) * area[..., -1:]).argmax(axis=-1)])


def _largest(mu: Array) -> NDArray[np.bool_]:
    """Where mu (..., M) is largest: all of a plateau, whose points may differ by rounding."""
    return np.asarray(mu >= (1.0 - ROUNDING) * mu.max(axis=-1, keepdims=True))


def mean_of_maximum(quadrature: Quadrature, mu: Array) -> Array:
    """The mean of the points where mu (..., M) is largest, shape (...)."""
    largest = _largest(mu)
    return np.asarray((largest @ quadrature.y) / largest.sum(axis=-1))


def smallest_of_maximum(y: Array, mu: Array, size: Callable[[Array], Array]) -> Array:
    """The point of smallest size among those y (M,) where mu (..., M) is largest."""
    largest = _largest(mu)
    return np.asarray(y[np.where(largest, size(y), np.inf).argmin(axis=-1)])


DEFUZZIFICATIONS: dict[str, Callable[[Quadrature, Array, Sampling], Array]] = {
    "centroid": lambda quadrature, mu, _: centroid(quadrature, mu),
    "bisector": lambda quadrature, mu, _: bisector(quadrature, mu),
    "mom": lambda quadrature, mu, _: mean_of_maximum(quadrature, mu),
    "som": lambda quadrature, mu, how: smallest_of_maximum(quadrature.y, mu, how.size),
    "lom": lambda quadrature, mu, how: smallest_of_maximum(
        quadrature.y, mu, lambda y: -how.size(y)
    ),
}
"""Defuzzification methods by MATLAB's names."""


def defuzzified(quadrature: Quadrature, mu: Array, defuzzification: str, sampling: str) -> Array:
    """Defuzzified value of each curve mu (..., M), shape (...); NaN where it is 0."""
    found = DEFUZZIFICATIONS[defuzzification](quadrature, mu, SAMPLINGS[sampling])
    return np.where((mu > 0).any(axis=-1), found, np.nan)
