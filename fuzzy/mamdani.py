"""Mamdani inference: min implication, max aggregation, centroid on a grid."""

import numpy as np

from fuzzy.sets import Array, membership
from fuzzy.system import System, grid, heights, memberships, require_firing, union


def centroid(y: Array, mu: Array) -> Array:
    """Centre of gravity sum(y mu) / sum(mu) of mu (..., M) sampled at y (M,), shape (...).

    The sum rule of MATLAB's `evalfis`. Raises ValueError where mu is 0 at every sample.
    """
    area = mu.sum(axis=-1)
    if np.any(area <= 0):
        raise ValueError("the aggregated set is 0 at every sample: raise the number of samples")
    return np.asarray((mu * y).sum(axis=-1) / area)


def evaluate(system: System, X: Array, samples: int) -> Array:
    """Crisp output (N,) for the readings X (N, inputs), in the output's unit."""
    fired = heights(system, X, membership)
    require_firing(system, X, fired)
    y = grid(system.output, samples)
    return centroid(y, union(fired, memberships(system.output, y, membership)))
