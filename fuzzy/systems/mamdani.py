"""Mamdani inference: the rules clip the output sets, their union is reduced to its centroid."""

import numpy as np

from fuzzy.systems import exact
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.quadrature import Output, centroid, is_exact, sampled
from fuzzy.systems.sets import Array, membership
from fuzzy.systems.system import (
    FuzzySystem,
    firing_strengths,
    joins,
    memberships,
    merged,
    union,
)


def evaluate(system: FuzzySystem, X: Array, options: InferenceOptions) -> Output:
    """Centroid (N,) for the readings X (N, inputs), in the output's unit."""
    fired = merged(system, firing_strengths(system, X, membership))
    if is_exact(options.sampling):
        values = [exact.centroid(system, heights, membership) for heights in fired.T]
        return Output(np.array(values), None, fired.max(axis=0))
    quadrature = sampled(system.output, options.samples, options.sampling)
    mu = memberships(system.output, quadrature.y, membership)
    return Output(centroid(quadrature, union(fired, mu, system.operators)), None, fired.max(axis=0))


def method(system: FuzzySystem, options: InferenceOptions) -> str:
    """One sentence on how Mamdani answers are computed."""
    return f"Mamdani: {joins(system.operators)}, centroid by {options.points}"
