"""Sugeno inference with the constants MATLAB's `mam2sug` takes from a Mamdani system."""

import numpy as np

from fuzzy.mamdani import centroid
from fuzzy.sets import Array, membership
from fuzzy.system import Merge, System, grid, heights, memberships, require_firing


def constants(system: System, samples: int) -> Array:
    """Centroid of each whole output set on the output universe, shape (sets,).

    A set cut by an end of the universe has its centroid off its centre.
    """
    y = grid(system.output, samples)
    return centroid(y, memberships(system.output, y, membership))


def evaluate(system: System, X: Array, samples: int, merge: Merge) -> Array:
    """Weighted average (N,) of the constants for the readings X (N, inputs).

    merge="sum" weighs every rule, as MATLAB does, so that a repeated rule counts twice; "max"
    weighs every output set once, by its strongest rule, as Mamdani's aggregation does.
    """
    weights = heights(system, X, membership, merge)
    require_firing(system, X, weights)
    return np.asarray(constants(system, samples) @ weights / weights.sum(axis=0))
