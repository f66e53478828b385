"""Mamdani inference: the rules clip the output sets, their union is reduced to its centroid."""

import numpy as np

from fuzzy.systems import exact
from fuzzy.systems.quadrature import Output, Sampling, centroid, sampled
from fuzzy.systems.sets import Array, membership
from fuzzy.systems.system import FuzzySystem, firing_strengths, memberships, merged, union


def evaluate(system: FuzzySystem, X: Array, sampling: Sampling, samples: int) -> Output:
    """Centroid (N,) for the readings X (N, inputs), in the output's unit."""
    fired = merged(system, firing_strengths(system, X, membership))
    if sampling == "exact":
        values = [exact.centroid(system, heights, membership) for heights in fired.T]
        return Output(np.array(values), None, fired.max(axis=0))
    quadrature = sampled(system.output, samples, sampling)
    mu = memberships(system.output, quadrature.y, membership)
    return Output(centroid(quadrature, union(fired, mu, system.operators)), None, fired.max(axis=0))
