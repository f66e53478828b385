"""Points and weights on the output's universe, by which areas and centroids are summed."""

from typing import Literal, NamedTuple, get_args

import numpy as np

from fuzzy.systems.sets import Array
from fuzzy.systems.system import Variable

Sampling = Literal["matlab", "octave", "exact"]
"""`matlab` sums samples alike, `octave` by the trapezoidal rule, `exact` integrates the curve."""

SAMPLINGS: tuple[Sampling, ...] = get_args(Sampling)


class Quadrature(NamedTuple):
    """Rising points y (M,) and their weights (M,); only ratios of weights matter."""

    y: Array
    weights: Array


class Output(NamedTuple):
    """What an inference system answers to N rows of readings.

    `value` (N,) is NaN where nothing fires, `interval` (N, 2) the ends of the type-reduced set of
    type-2 and None for the others, `strength` (N,) the strength of the strongest output set.
    """

    value: Array
    interval: Array | None
    strength: Array


def sampled(variable: Variable, samples: int, sampling: Sampling) -> Quadrature:
    """`samples` equidistant points, both ends included.

    MATLAB's `evalfis` weighs all alike; Octave's toolkit halves the weight of both ends.
    """
    y = np.linspace(variable.low, variable.high, samples)
    weights = np.ones(samples)
    if sampling == "octave":
        weights[[0, -1]] = 0.5
    return Quadrature(y, weights)


def centroid(quadrature: Quadrature, mu: Array) -> Array:
    """Centre of gravity of mu (..., M) sampled at the points, shape (...); NaN where mu is 0."""
    y, weights = quadrature
    area = mu @ weights
    moment = mu @ (weights * y)
    return np.divide(moment, area, out=np.full_like(area, np.nan), where=area > 0)
