"""Points and weights on the output's universe, by which areas and centroids are summed."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from fuzzy.systems.sets import Array
from fuzzy.systems.system import Variable


class Sampling(NamedTuple):
    """How areas under the output curve are found.

    `weights` gives those of so many equidistant samples, shape (M,), and is None where the curve
    itself is integrated. `words` name it; {samples} in them is the number of samples.
    """

    weights: Callable[[int], Array] | None
    words: str


def _trapezoidal(samples: int) -> Array:
    weights = np.ones(samples)
    weights[[0, -1]] = 0.5
    return weights


SAMPLINGS: dict[str, Sampling] = {
    "matlab": Sampling(np.ones, "sums over {samples} points"),
    "octave": Sampling(_trapezoidal, "the trapezoidal rule over {samples} points"),
    "exact": Sampling(None, "integration between the kinks of the curve"),
}
"""By name: MATLAB's `evalfis` weighs all samples alike, Octave's toolkit halves both ends."""


def is_exact(sampling: str) -> bool:
    """Whether a sampling, by name, takes no samples."""
    return SAMPLINGS[sampling].weights is None


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
