"""Mamdani inference: rules clip the output sets, and their union is defuzzified."""

import numpy as np

from fuzzy.systems import exact
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.quadrature import Output, defuzzified, is_exact, sampled
from fuzzy.systems.sets import Array, membership
from fuzzy.systems.system import (
    FuzzySystem,
    aggregated,
    firing_strengths,
    joins,
    memberships,
    merged,
)


def evaluate(system: FuzzySystem, X: Array, options: InferenceOptions) -> Output:
    """Centroid (N,) for the readings X (N, inputs), in the output's unit."""
    strengths = firing_strengths(system, X, membership)
    if is_exact(options.sampling):
        require_centroid_of_union(system, "sampling = 'exact'")
        fired = merged(system, strengths)
        values = [exact.centroid(system, heights, membership) for heights in fired.T]
        return Output(np.array(values), None, fired.max(axis=0))
    quadrature = sampled(system.output, options.samples, options.sampling)
    mu = memberships(system.output, quadrature.y, membership)
    curve = aggregated(system, strengths, mu)
    value = defuzzified(quadrature, curve, system.operators.defuzzification, options.sampling)
    return Output(value, None, strengths.max(axis=0))


def require_centroid_of_union(system: FuzzySystem, what: str) -> None:
    """ValueError, with the feature that needs it, for another aggregation or defuzzification."""
    operators = system.operators
    if not operators.is_centroid_of_union:
        raise ValueError(
            f"{what}: finds centroids of the maximum only, and {system.name} has aggregation "
            f"{operators.aggregation} and defuzzification {operators.defuzzification}; evaluate it "
            "as mamdani with matlab or octave sampling"
        )


def method(system: FuzzySystem, options: InferenceOptions) -> str:
    """One sentence that describes Mamdani inference."""
    how = system.operators.defuzzification
    return f"Mamdani: {joins(system.operators)}, {how} by {options.points}"
