"""Interval type-2 Mamdani inference.

The lower and upper memberships enclose a family of type-1 sets, whose centroids form an interval.
The output is its midpoint, or Nie and Tan's centroid of the mean of both bounds.
"""

import numpy as np

from fuzzy.systems import exact
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.quadrature import Output, centroid, is_exact, sampled
from fuzzy.systems.sets import Array, lower_membership, upper_membership
from fuzzy.systems.system import (
    FuzzySystem,
    firing_strengths,
    joins,
    memberships,
    merged,
    union,
)
from fuzzy.systems.type_reduction import REDUCERS


def bounds_of_firing(system: FuzzySystem, X: Array) -> tuple[Array, Array]:
    """Lower and upper heights of the output sets, each shape (sets, N)."""
    lower = firing_strengths(system, X, lower_membership, upper_membership)
    upper = firing_strengths(system, X, upper_membership, lower_membership)
    return merged(system, lower), merged(system, upper)


def evaluate(system: FuzzySystem, X: Array, options: InferenceOptions) -> Output:
    """Output (N,) and interval (N, 2) of the centroid for the readings X (N, inputs)."""
    low_fired, high_fired = bounds_of_firing(system, X)
    strength = high_fired.max(axis=0)
    reducer = REDUCERS[options.reducer]
    if is_exact(options.sampling):
        rows = [
            exact.reduce(system, *heights)
            for heights in zip(low_fired.T, high_fired.T, strict=True)
        ]
        interval = np.array([row.interval for row in rows])
        middle = np.array([row.nie_tan for row in rows])
    else:
        quadrature = sampled(system.output, options.samples, options.sampling)
        y = quadrature.y
        lower_sets = memberships(system.output, y, lower_membership)
        upper_sets = memberships(system.output, y, upper_membership)
        lower = union(low_fired, lower_sets, system.operators)
        upper = union(high_fired, upper_sets, system.operators)
        interval = reducer.ends(quadrature, lower, upper)
        middle = centroid(quadrature, lower + upper)
    interval = np.sort(interval, axis=-1)  # without a footprint the ends differ by rounding alone
    value = middle if reducer.nie_tan else interval.mean(axis=-1)
    return Output(value, interval, strength)


def method(system: FuzzySystem, options: InferenceOptions) -> str:
    """One sentence that describes type-2 inference."""
    reducer = REDUCERS[options.reducer]
    reduced = reducer.exact_words if is_exact(options.sampling) else reducer.words
    return f"Interval type-2: {joins(system.operators)}, {reduced}, {options.points}"
