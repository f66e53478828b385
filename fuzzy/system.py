"""A fuzzy system: variables with their sets, and rules from inputs to one output.

One `System` serves the three kinds of inference; they share the firing of the rules. Rules with the
same consequent meet only through their strengths, max_r min(w_r, mu(y)) = min(max_r w_r, mu(y)), so
they are merged to one height per output set before the output is sampled.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fuzzy.sets import Array, FuzzySet

Membership = Callable[[FuzzySet, Array], Array]
Merge = Literal["max", "sum"]

# Below this height the clipped sets are flat and the centroid is that of the universe: no answer.
LEAST_HEIGHT = 1e-12


@dataclass(frozen=True)
class Variable:
    """An input or the output on the universe [low, high], with its sets."""

    name: str
    low: float
    high: float
    sets: tuple[FuzzySet, ...]

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise ValueError(f"variable {self.name!r}: low {self.low} must be below {self.high}")
        if not self.sets:
            raise ValueError(f"variable {self.name!r}: has no set; give at least one")


@dataclass(frozen=True)
class Rule:
    """Antecedents as (input, set) indices joined by one connective, and the output set's index."""

    antecedents: tuple[tuple[int, int], ...]
    consequent: int
    connective: Literal["and", "or"] = "and"


@dataclass(frozen=True)
class System:
    """Inputs, output and rules; every index of every rule is checked."""

    inputs: tuple[Variable, ...]
    output: Variable
    rules: tuple[Rule, ...]

    def __post_init__(self) -> None:
        if not self.rules:
            raise ValueError("the system has no rules: give at least one")
        for number, rule in enumerate(self.rules, start=1):
            if not _fits(rule, self):
                raise ValueError(
                    f"rule {number}: {rule} names an input or a set the system does not have"
                )


def _fits(rule: Rule, system: System) -> bool:
    known = all(
        0 <= i < len(system.inputs) and 0 <= s < len(system.inputs[i].sets)
        for i, s in rule.antecedents
    )
    return bool(rule.antecedents) and known and 0 <= rule.consequent < len(system.output.sets)


def grid(variable: Variable, samples: int) -> Array:
    """The universe at `samples` equidistant points, both ends included, shape (samples,)."""
    return np.linspace(variable.low, variable.high, samples)


def memberships(variable: Variable, x: Array, membership: Membership) -> Array:
    """Membership of x (M,) in every set of the variable, shape (sets, M)."""
    return np.array([membership(fuzzy_set, x) for fuzzy_set in variable.sets])


def firing_strengths(system: System, X: Array, membership: Membership) -> Array:
    """Strength of every rule at the readings X (N, inputs), shape (rules, N).

    Raises ValueError, naming the input, if X has the wrong width or a number that is not finite.
    """
    _require_readings(system, X)
    degrees = [
        memberships(variable, X[:, i], membership) for i, variable in enumerate(system.inputs)
    ]
    join = {"and": np.minimum, "or": np.maximum}
    return np.array(
        [join[r.connective].reduce([degrees[i][s] for i, s in r.antecedents]) for r in system.rules]
    )


def heights(system: System, X: Array, membership: Membership, merge: Merge = "max") -> Array:
    """Strength of every output set at the readings X (N, inputs), shape (sets, N)."""
    strengths = firing_strengths(system, X, membership)
    consequents = np.array([rule.consequent for rule in system.rules])
    join = np.maximum if merge == "max" else np.add
    return np.array(
        [
            join.reduce(strengths[consequents == k], axis=0, initial=0.0)
            for k in range(len(system.output.sets))
        ]
    )


def require_firing(system: System, X: Array, fired: Array) -> None:
    """ValueError naming the readings of the first row where no output set in `fired` is reached."""
    silent = np.flatnonzero(fired.max(axis=0) < LEAST_HEIGHT)
    if silent.size:
        readings = ", ".join(
            f"{variable.name} = {value:g}"
            for variable, value in zip(system.inputs, X[silent[0]], strict=True)
        )
        raise ValueError(
            f"no rule fires for {readings} (row {silent[0]}): "
            "add a rule or widen a set that covers these readings"
        )


def union(fired: Array, output: Array) -> Array:
    """Max of the output sets (K, M) clipped at the heights (K, N), shape (N, M)."""
    return np.asarray(np.minimum(fired[:, :, None], output[:, None, :]).max(axis=0))


def _require_readings(system: System, X: Array) -> None:
    if X.ndim != 2 or X.shape[1] != len(system.inputs):
        raise ValueError(f"readings have shape {X.shape}; give (N, {len(system.inputs)})")
    bad = np.argwhere(~np.isfinite(X))
    if bad.size:
        row, column = bad[0]
        raise ValueError(
            f"{system.inputs[column].name} = {X[row, column]} (row {row}): give a finite reading"
        )
