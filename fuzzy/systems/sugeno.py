"""Sugeno inference: a weighted average of the consequents.

A Mamdani system is converted as in MATLAB: every output set becomes the constant at the centroid of
the whole set on the output's universe; rules and operators are unchanged.
"""

import numpy as np

from fuzzy.systems import exact
from fuzzy.systems.mamdani import require_centroid_of_union
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.quadrature import Output, defuzzified, is_exact, sampled
from fuzzy.systems.sets import Array, membership
from fuzzy.systems.system import MERGES, FuzzySystem, firing_strengths, joins, memberships, merged


def consequents(system: FuzzySystem, sampling: str, samples: int) -> Array:
    """Coefficients (sets, inputs + 1) of each consequent, one per input and then the constant.

    A set cut by an end of the universe has its centroid off its centre.
    """
    table = np.zeros((len(system.output.sets), len(system.inputs) + 1))
    if not system.is_sugeno:
        table[:, -1] = constants(system, sampling, samples)
        return table
    for k, one in enumerate(system.output.sets):
        table[k, -len(one.parameters) :] = one.parameters
    return table


def constants(system: FuzzySystem, sampling: str, samples: int) -> Array:
    """The constant of each output set: its centroid, or that of the system.

    Shape (sets,); NaN for a set without mass on the universe.
    """
    if is_exact(sampling):
        require_centroid_of_union(system, "sampling = 'exact'")
        whole = np.eye(len(system.output.sets))
        return np.array([exact.centroid(system, heights, membership) for heights in whole])
    quadrature = sampled(system.output, samples, sampling)
    mu = memberships(system.output, quadrature.y, membership)
    return defuzzified(quadrature, mu, system.operators.defuzzification, sampling)


def evaluate(system: FuzzySystem, X: Array, options: InferenceOptions) -> Output:
    """Weighted average (N,) of the consequents for the readings X (N, inputs).

    Aggregation by "sum" weights every rule, as in MATLAB, so that a repeated rule counts twice; by
    "max" every output set counts once, with its strongest rule, as in Mamdani's aggregation and
    Octave.
    """
    strengths = firing_strengths(system, X, membership)
    weights = merged(system, strengths, options.sugeno_aggregation)
    table = consequents(system, options.sampling, options.samples)
    answers = table[:, :-1] @ X.T + table[:, -1:]
    # A set without weight has no say, even if it is off the universe and so without a constant.
    weighted = np.multiply(weights, answers, out=np.zeros_like(weights), where=weights > 0)
    moment, total = weighted.sum(axis=0), weights.sum(axis=0)
    if system.operators.defuzzification == "wtsum":
        return Output(np.where(total > 0, moment, np.nan), None, strengths.max(axis=0))
    value = np.divide(moment, total, out=np.full_like(total, np.nan), where=total > 0)
    return Output(value, None, strengths.max(axis=0))


def method(system: FuzzySystem, options: InferenceOptions) -> str:
    """One sentence that describes Sugeno inference."""
    how = "sum" if system.operators.defuzzification == "wtsum" else "average"
    average = f"weighted {how} over every {MERGES[options.sugeno_aggregation].weighed}"
    if system.is_sugeno:
        return f"Sugeno: {joins(system.operators)}, {average}"
    return f"Sugeno: constants by {options.points} over each output set, {average}"
