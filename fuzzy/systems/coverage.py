"""Reachability of rules, and coverage of the readings by rules."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import groupby, product
from typing import NamedTuple

import numpy as np

from fuzzy.systems.policy import LEAST_STRENGTH
from fuzzy.systems.sets import Array, corners, lower_membership, membership, upper_membership
from fuzzy.systems.spread import spread
from fuzzy.systems.system import FuzzySystem, Rule, Variable, firing_strengths, memberships

POINTS = 1001
TOGETHER = 64
"""Rules evaluated per batch; of a batch of m readings, each rule needs only one."""
MOST_INPUTS_WITH_CORNERS = 12


class Gap(NamedTuple):
    """An interval of one input in which none of its sets exceeds a threshold."""

    input: str
    low: float
    high: float


class Coverage(NamedTuple):
    """Share of sampled readings that fire no rule above a threshold, and the least covered one."""

    uncovered: float
    least_covered: tuple[float, ...]
    least_strength: float


def unreachable(system: FuzzySystem) -> tuple[int, ...]:
    """Rules that no reading in the universe fires, regardless of their weight.

    For each input, the reading with the largest degree of the rule's terms is found. Inputs are
    independent, so together they are the reading with the largest strength of the rule.
    """
    best, rules = _best_readings(system), [replace(rule, weight=1.0) for rule in system.rules]
    strongest = np.zeros(len(rules))
    for first in range(0, len(rules), TOGETHER):
        part = slice(first, first + TOGETHER)
        some = replace(system, rules=tuple(rules[part]))
        strongest[part] = _strengths(some, best[part]).diagonal()
    return tuple(map(int, np.flatnonzero(strongest < LEAST_STRENGTH)))


def _best_readings(system: FuzzySystem) -> Array:
    """Reading at which each rule is strongest, shape (rules, inputs)."""
    best = np.tile(_ends(system)[0], (len(system.rules), 1))
    for i, variable in enumerate(system.inputs):
        alike: dict[Rule, list[int]] = {}  # a few parts of rules recur in thousands of them
        for r, rule in enumerate(system.rules):
            if terms := tuple(term for term in rule.antecedents if term.input == i):
                part = replace(rule, antecedents=terms, consequent=0, weight=1.0)
                alike.setdefault(part, []).append(r)
        if not alike:
            continue
        x = _points(variable)
        X = np.tile(_ends(system)[0], (x.size, 1))
        X[:, i] = x
        strengths = _strengths(replace(system, rules=tuple(alike)), X)
        for where, rules in zip(strengths.argmax(axis=1), alike.values(), strict=True):
            best[rules, i] = x[where]
    return best


def _strengths(system: FuzzySystem, X: Array) -> Array:
    return firing_strengths(system, X, upper_membership, lower_membership)


def _points(variable: Variable) -> Array:
    """Dense points of the universe, including the kinks of the sets."""
    kinks = np.array([x for one in variable.sets for x in corners(one)])
    inside = kinks[(variable.low <= kinks) & (kinks <= variable.high)]
    return np.sort(np.concatenate([np.linspace(variable.low, variable.high, POINTS), inside]))


def gaps(system: FuzzySystem, threshold: float) -> tuple[Gap, ...]:
    """Gaps of each input alone, with ends accurate to a thousandth of the universe."""
    judged = (one for one in system.inputs if one.sets and one.low < one.high)
    return tuple(gap for variable in judged for gap in _gaps_of(variable, threshold))


def _gaps_of(variable: Variable, threshold: float) -> Iterator[Gap]:
    x = np.linspace(variable.low, variable.high, POINTS)
    empty = memberships(variable, x, membership).max(axis=0) <= threshold
    for is_gap, run in groupby(range(POINTS), key=lambda k: bool(empty[k])):
        places = list(run)
        if is_gap:
            yield Gap(variable.name, float(x[places[0]]), float(x[places[-1]]))


def coverage(system: FuzzySystem, samples: int, threshold: float) -> Coverage:
    """Coverage of quasi-random readings, and of corners of the universe."""
    X = np.concatenate([spread_readings(system, samples), _corner_readings(system)])
    strongest = firing_strengths(system, X, membership).max(axis=0)
    least = int(strongest.argmin())
    return Coverage(
        uncovered=float((strongest[:samples] <= threshold).mean()),
        least_covered=tuple(float(x) for x in X[least]),
        least_strength=float(strongest[least]),
    )


def spread_readings(system: FuzzySystem, samples: int) -> Array:
    """Quasi-random readings of the universe, shape (samples, inputs)."""
    low, high = _ends(system)
    return np.asarray(low + (high - low) * spread(samples, len(system.inputs)))


def _corner_readings(system: FuzzySystem) -> Array:
    """All combinations of the ends of the universes; for many inputs the two extreme ones only."""
    low, high = _ends(system)
    if len(system.inputs) > MOST_INPUTS_WITH_CORNERS:
        return np.array([low, high])
    return np.array(list(product(*zip(low, high, strict=True))))


def _ends(system: FuzzySystem) -> tuple[Array, Array]:
    low = np.array([variable.low for variable in system.inputs])
    high = np.array([variable.high for variable in system.inputs])
    return low, high
