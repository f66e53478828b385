"""A fuzzy system: variables with their sets, rules from inputs to one output, and operators.

The three kinds of inference share one `FuzzySystem` and the firing of its rules. Rules with the
same consequent are merged to one height per output set before the output is sampled, since
max_r min(w_r, mu(y)) = min(max_r w_r, mu(y)).
"""

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from itertools import chain
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from fuzzy.systems.sets import FUNCTION_KINDS, Array, FuzzySet

Indices = NDArray[np.int64]
Booleans = NDArray[np.bool_]
Membership = Callable[[FuzzySet, Array], Array]
Connective = Literal["and", "or"]
CONNECTIVES = get_args(Connective)


class Merge(NamedTuple):
    """Merging of the strengths of rules with one consequent; `weighed`: what an average counts."""

    join: np.ufunc
    weighed: str

    @property
    def adds(self) -> bool:
        """Whether every rule counts, and not only the strongest."""
        return self.join is np.add


MERGES: dict[str, Merge] = {
    "max": Merge(np.maximum, "output set, by its strongest rule"),
    "sum": Merge(np.add, "rule"),
}


OPERATORS: dict[str, tuple[str, ...]] = {
    "conjunction": ("min", "prod"),
    "disjunction": ("max", "probor"),
    "implication": ("min", "prod"),
    "aggregation": ("max", "sum", "probor"),
    "defuzzification": ("centroid", "bisector", "mom", "som", "lom", "wtsum"),
}
"""Choices of each operator; wtsum, the weighted sum, is for Sugeno systems only."""


class Term(NamedTuple):
    """One `input is [not] set` of an antecedent, by index."""

    input: int
    set: int
    negated: bool = False


@dataclass(frozen=True)
class Variable:
    """An input or the output on the universe [low, high], with its sets.

    A universe without width, low = high, is unspecified: `reach` is then the whole line. An input
    without sets appears in linear consequents only.
    """

    name: str
    low: float
    high: float
    sets: tuple[FuzzySet, ...]

    def __post_init__(self) -> None:
        if not (np.isfinite([self.low, self.high]).all() and self.low <= self.high):
            raise ValueError(
                f"variable {self.name!r}: low {self.low} must be below {self.high}, which MATLAB "
                "and Octave ask for too; exchange them"
            )
        names = [one.name for one in self.sets]
        if len(set(names)) < len(names):
            raise ValueError(f"variable {self.name!r}: two sets share a name; rename one")

    @property
    def reach(self) -> tuple[float, float]:
        """Range of expected readings: the universe, or the whole line if it has no width."""
        return (self.low, self.high) if self.low < self.high else (-np.inf, np.inf)


@dataclass(frozen=True)
class Rule:
    """Terms joined by one connective, the output set's index, and a weight on the strength."""

    antecedents: tuple[Term, ...]
    consequent: int
    connective: Connective = "and"
    weight: float = 1.0

    def __post_init__(self) -> None:
        if not 0 <= self.weight <= 1:
            raise ValueError(
                f"rule weight {self.weight}: give a number from 0 to 1, as MATLAB asks"
            )
        if self.connective not in CONNECTIVES:
            raise ValueError(f"rule connective {self.connective!r}: use and, or")


class RuleGroup(NamedTuple):
    """Rules with the same connective and number of terms, by index, evaluated together.

    `terms`: for each term in turn, its input, its set, and whether it is negated, in every rule.
    """

    connective: Connective
    rules: Indices
    weights: Array
    terms: tuple[tuple[Indices, Indices, Booleans], ...]


@dataclass(frozen=True)
class Operators:
    """AND, OR, implication, aggregation and defuzzification, by MATLAB's names.

    Aggregation by max merges rules to heights. The default of `defuzzification` is the centroid of
    a curve and, for a Sugeno system, the weighted average.
    """

    conjunction: Literal["min", "prod"] = "min"
    disjunction: Literal["max", "probor"] = "max"
    implication: Literal["min", "prod"] = "min"
    aggregation: Literal["max", "sum", "probor"] = "max"
    defuzzification: Literal["centroid", "bisector", "mom", "som", "lom", "wtsum"] = "centroid"

    def __post_init__(self) -> None:
        for key, allowed in OPERATORS.items():
            if getattr(self, key) not in allowed:
                raise ValueError(
                    f"{key} {getattr(self, key)!r}: functions of one's own and those of Octave "
                    f"alone are not computed; use one of {', '.join(allowed)}"
                )

    @property
    def is_centroid_of_union(self) -> bool:
        """Whether the output is the centroid of the maximum, which can be integrated exactly."""
        return self.aggregation == "max" and self.defuzzification == "centroid"


@dataclass(frozen=True)
class FuzzySystem:
    """Inputs, output, rules and operators; every index of every rule is checked.

    With `constant` or `linear` output sets it is a Sugeno system; with membership functions it is a
    Mamdani or type-2 system, which Sugeno inference converts.
    """

    inputs: tuple[Variable, ...]
    output: Variable
    rules: tuple[Rule, ...]
    operators: Operators = Operators()
    name: str = "system"

    def __post_init__(self) -> None:
        names = [variable.name for variable in self.inputs]
        if not names or len(set(names)) < len(names):
            raise ValueError("inputs: give at least one, each with a name of its own")
        _check_output(self.output)
        if not self.rules:
            raise ValueError("the system has no rules: give at least one")
        _check_rules(self)
        _check_kinds(self)
        _check_operators(self)

    @cached_property
    def rule_groups(self) -> tuple[RuleGroup, ...]:
        """The rules in groups that are evaluated together."""
        groups = defaultdict[tuple[Connective, int], list[int]](list)
        for number, rule in enumerate(self.rules):
            groups[rule.connective, len(rule.antecedents)].append(number)
        return tuple(_alike(self.rules, connective, n) for (connective, _), n in groups.items())

    @property
    def is_sugeno(self) -> bool:
        """Whether the consequents are functions of the inputs instead of fuzzy sets."""
        return self.output.sets[0].kind in FUNCTION_KINDS


def _alike(rules: Sequence[Rule], connective: Connective, numbers: list[int]) -> RuleGroup:
    alike = [rules[n] for n in numbers]
    flat = np.fromiter(chain.from_iterable(chain.from_iterable(r.antecedents for r in alike)), int)
    terms = flat.reshape(len(alike), -1, len(Term._fields))
    return RuleGroup(
        connective,
        np.array(numbers),
        np.array([rule.weight for rule in alike]),
        tuple((one[:, 0], one[:, 1], one[:, 2].astype(bool)) for one in terms.swapaxes(0, 1)),
    )


def _check_rules(system: FuzzySystem) -> None:
    counts = np.array([len(variable.sets) for variable in system.inputs])
    outputs = len(system.output.sets)
    fit = np.array([0 <= rule.consequent < outputs for rule in system.rules])
    for group in system.rule_groups:
        fit[group.rules] &= bool(group.terms)  # every rule has an antecedent
        for inputs, sets, _ in group.terms:
            known = (inputs >= 0) & (inputs < len(counts))
            of_input = np.where(known, inputs, 0)
            fit[group.rules] &= known & (sets >= 0) & (sets < counts[of_input])
    for number in np.flatnonzero(~fit):
        raise ValueError(
            f"rule {number + 1}: {system.rules[number]} names an input or a set the system does "
            "not have"
        )


def _check_output(output: Variable) -> None:
    if not output.sets:
        raise ValueError(f"output {output.name!r}: has no set; give at least one")
    if output.low == output.high and output.sets[0].kind not in FUNCTION_KINDS:
        raise ValueError(
            f"output {output.name!r}: the universe {output.low:g} to {output.high:g} has no width, "
            "and so no area whose centroid could be the answer (Octave refuses it too); widen it"
        )


def _check_operators(system: FuzzySystem) -> None:
    aggregation, defuzzification = system.operators.aggregation, system.operators.defuzzification
    if system.is_sugeno and (aggregation != "max" or defuzzification not in ("centroid", "wtsum")):
        raise ValueError(
            f"output {system.output.name!r}: a Sugeno system has no curve for aggregation "
            f"{aggregation} and defuzzification {defuzzification}; leave them out, or take wtsum"
        )
    if not system.is_sugeno and defuzzification == "wtsum":
        raise ValueError(
            f"output {system.output.name!r}: wtsum is for constants; choose another defuzzification"
        )


def _check_kinds(system: FuzzySystem) -> None:
    for variable in system.inputs:
        for one in variable.sets:
            if one.kind in FUNCTION_KINDS:
                raise ValueError(
                    f"input {variable.name!r}: set {one.name!r} is {one.kind}, which only an "
                    "output can be; give it a membership function"
                )
    functions = [one.kind in FUNCTION_KINDS for one in system.output.sets]
    if any(functions) and not all(functions):
        raise ValueError(
            f"output {system.output.name!r} mixes membership functions with constants; "
            "use one or the other"
        )
    width = len(system.inputs) + 1
    for one in system.output.sets:
        if one.kind == "linear" and len(one.parameters) != width:
            raise ValueError(
                f"output set {one.name!r}: linear takes {width} parameters, one per input and the "
                f"constant, got {len(one.parameters)}; it does not say which are missing, "
                "and MATLAB and Octave refuse it too"
            )


def joins(operators: Operators) -> str:
    """Description of a system's operators."""
    return (
        f"AND {operators.conjunction}, OR {operators.disjunction}, "
        f"implication {operators.implication}, aggregation {operators.aggregation}"
    )


def memberships(variable: Variable, x: Array, membership: Membership) -> Array:
    """Membership of x (M,) in every set of the variable, shape (sets, M)."""
    return np.array([membership(fuzzy_set, x) for fuzzy_set in variable.sets])


def firing_strengths(
    system: FuzzySystem, X: Array, membership: Membership, opposite: Membership | None = None
) -> Array:
    """Strength of every rule at the readings X (N, inputs), shape (rules, N).

    `opposite` gives the degrees for negated terms: the upper bound of NOT A is 1 minus the lower
    bound of A.
    """
    degrees = _degrees(system, X, membership)
    others = degrees if opposite is None else _degrees(system, X, opposite)
    sizes = [len(variable.sets) for variable in system.inputs]
    starts = np.cumsum([0, *sizes[:-1]])
    strengths = np.empty((len(system.rules), len(X)))
    for group in system.rule_groups:
        join = _join(group.connective, system.operators)
        terms = (
            _of_terms(starts[inputs] + sets, negated, degrees, others)
            for inputs, sets, negated in group.terms
        )
        strengths[group.rules] = group.weights[:, None] * reduce(join, terms)
    return strengths


def _degrees(system: FuzzySystem, X: Array, membership: Membership) -> Array:
    """Degrees (sets of all inputs, N), input by input."""
    inputs = [(i, variable) for i, variable in enumerate(system.inputs) if variable.sets]
    return np.concatenate([memberships(one, X[:, i], membership) for i, one in inputs])


def _of_terms(sets: Indices, negated: Booleans, degrees: Array, others: Array) -> Array:
    """Degree of one term of each of several rules, shape (rules, N); `sets` are rows of degrees."""
    found = degrees[sets]
    if negated.any():
        found[negated] = 1.0 - others[sets[negated]]
    return np.asarray(found)


def _join(connective: Connective, operators: Operators) -> Callable[[Array, Array], Array]:
    if connective == "and":
        return np.minimum if operators.conjunction == "min" else np.multiply
    if operators.disjunction == "max":
        return np.maximum
    # Folded, for 1 - (1 - a)(1 - b) would lose the digits of small degrees.
    return lambda a, b: a + b * (1.0 - a)


def merged(system: FuzzySystem, strengths: Array, merge: str = "max") -> Array:
    """Strength of every output set from those of the rules (rules, N), shape (sets, N)."""
    consequents = np.array([rule.consequent for rule in system.rules])
    join = MERGES[merge].join
    return np.array(
        [
            join.reduce(strengths[consequents == k], axis=0, initial=0.0)
            for k in range(len(system.output.sets))
        ]
    )


def union(fired: Array, output: Array, operators: Operators) -> Array:
    """Max of the output sets (K, M) implied at the heights (K, N), shape (N, M)."""
    imply = np.minimum if operators.implication == "min" else np.multiply
    return np.asarray(imply(fired[:, :, None], output[:, None, :]).max(axis=0))


def aggregated(system: FuzzySystem, strengths: Array, output: Array) -> Array:
    """The curve (N, M) of the rules at their strengths (rules, N), from the output sets (K, M)."""
    if system.operators.aggregation == "max":
        return union(merged(system, strengths), output, system.operators)
    imply = np.minimum if system.operators.implication == "min" else np.multiply
    curve = np.zeros((strengths.shape[1], output.shape[1]))
    for rule, strength in zip(system.rules, strengths, strict=True):
        part = imply(strength[:, None], output[rule.consequent])
        curve += part if system.operators.aggregation == "sum" else part * (1.0 - curve)
    return curve
