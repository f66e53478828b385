"""Conversion of Mamdani systems to and from scikit-fuzzy's `control`.

scikit-fuzzy stores every set as samples on its universe and interpolates between them, so outputs
agree within the sampling error. Features that one side lacks are refused, never approximated.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import reduce
from operator import and_, or_
from typing import Any, NamedTuple

import networkx as nx
import numpy as np
from skfuzzy import control
from skfuzzy.control import antecedent_consequent as accumulation
from skfuzzy.control.term import Term as SampledTerm

from fuzzy.systems.recognition import recognised
from fuzzy.systems.sets import Array, membership
from fuzzy.systems.system import (
    Connective,
    FuzzySystem,
    Operators,
    Rule,
    Term,
    Variable,
    memberships,
)


class ListedRules(control.ControlSystem):  # type: ignore[misc]  # scikit-fuzzy has no types
    """A control system with its rules in the given order.

    scikit-fuzzy sorts all rules again whenever one is added, and at every evaluation. Here all
    rules read inputs and write the output, so that any order is valid.
    """

    def __init__(self, variables: Sequence[Any], rules: Sequence[Any]) -> None:
        super().__init__()
        self._rules = tuple(rules)
        self.graph = nx.compose_all([variable.graph for variable in variables])
        for rule in rules:
            self.graph.add_edges_from((term, rule) for term in rule.antecedent_terms)
            self.graph.add_edges_from((rule, weighted.term) for weighted in rule.consequent)

    @property
    def rules(self) -> tuple[Any, ...]:
        """The rules of the control system in the order given."""
        return self._rules


# --- to scikit-fuzzy ---------------------------------------------------------------------------


def to_skfuzzy(system: FuzzySystem, points: int = 1001) -> control.ControlSystem:
    """The system's rules on principal membership functions, as a scikit-fuzzy ControlSystem.

    Give it to `skfuzzy.control.ControlSystemSimulation`, set `simulation.input[name]`, call
    `compute()`, read `simulation.output[name]`. Every set is stored as `points` samples of its
    universe. A simulation clamps readings to their universes and omits the output where no rule
    fires. ValueError for features that scikit-fuzzy lacks: Sugeno consequents, implication by
    product, an output with the name of an input.
    """
    _check(system)
    antecedents = [_sampled(control.Antecedent, one, points) for one in system.inputs]
    consequent = _sampled(control.Consequent, system.output, points)
    rules = [
        _control_rule(system, rule, f"rule {number}", antecedents, consequent)
        for number, rule in enumerate(system.rules, start=1)
    ]
    return ListedRules([*antecedents, consequent], rules)


def _check(system: FuzzySystem) -> None:
    if system.is_sugeno:
        raise ValueError(
            f"{system.name}: scikit-fuzzy has no Sugeno inference; give the output membership "
            "functions"
        )
    if not system.operators.is_centroid_of_union:
        raise ValueError(
            f"aggregation {system.operators.aggregation}, defuzzification "
            f"{system.operators.defuzzification}: only max and centroid are handed on; use these"
        )
    for variable in (*system.inputs, system.output):
        if variable.low == variable.high:
            raise ValueError(
                f"{variable.name}: its universe has no width, on which scikit-fuzzy cannot sample "
                "its sets; widen it"
            )
    if system.operators.implication != "min":
        raise ValueError("implication 'prod': scikit-fuzzy clips only; use min")
    if system.output.name in {variable.name for variable in system.inputs}:
        raise ValueError(
            f"output {system.output.name!r} has the name of an input, which scikit-fuzzy cannot "
            "distinguish; rename one"
        )


def _sampled(kind: Any, variable: Variable, points: int) -> Any:
    universe = np.linspace(variable.low, variable.high, points)
    sampled = kind(universe, variable.name)
    for one, mu in zip(variable.sets, memberships(variable, universe, membership), strict=True):
        sampled[one.name] = mu
    return sampled


def _control_rule(
    system: FuzzySystem, rule: Rule, label: str, antecedents: Sequence[Any], consequent: Any
) -> Any:
    operators = system.operators
    named = [
        (antecedents[t.input][system.inputs[t.input].sets[t.set].name], t.negated)
        for t in rule.antecedents
    ]
    terms = [~term if negated else term for term, negated in named]
    result = consequent[system.output.sets[rule.consequent].name]
    return control.Rule(
        reduce(and_ if rule.connective == "and" else or_, terms),
        result % float(rule.weight),
        label,
        and_func=np.fmin if operators.conjunction == "min" else np.multiply,
        or_func=np.fmax if operators.disjunction == "max" else _probor,
    )


def _probor(one: Array, other: Array) -> Array:
    return one + other - one * other


# --- from scikit-fuzzy -------------------------------------------------------------------------

CONJUNCTIONS: dict[Callable[..., Any], str] = {
    np.fmin: "min",
    np.minimum: "min",
    np.multiply: "prod",
    accumulation.accumulation_mult: "prod",
}
DISJUNCTIONS: dict[Callable[..., Any], str] = {
    np.fmax: "max",
    np.maximum: "max",
    accumulation.accumulation_max: "max",
    _probor: "probor",
}
DUAL = {"min": "max", "max": "min", "prod": "probor", "probor": "prod"}
"""De Morgan's duals: 1 - min(a, b) = max(1 - a, 1 - b), and so on."""


class _Clause(NamedTuple):
    """Part of an antecedent: an OR of ANDs of terms, and the AND and OR functions it takes."""

    alternatives: tuple[tuple[Term, ...], ...]
    conjunctions: frozenset[str] = frozenset()
    disjunctions: frozenset[str] = frozenset()


def from_skfuzzy(system: control.ControlSystem, name: str = "control-system") -> FuzzySystem:
    """The system of a scikit-fuzzy ControlSystem, its inputs in the order of `antecedents`.

    Sets are recognised in their samples, see `fuzzy.systems.recognition`. Antecedents may nest
    AND, OR and NOT; one that mixes AND and OR becomes several rules, a rule with several
    consequents one for each. ValueError, naming variable, set or rule, for what a FuzzySystem does
    not have: sets of another kind, several outputs, chained rules, AND and OR by functions other
    than min or product and max or probabilistic sum, the same in all rules, another accumulation
    than max or defuzzification than centroid.
    """
    inputs, output = list(system.antecedents), _only_output(system)
    clauses = [_named(rule, inputs) for rule in system.rules]
    operators = _operators([clause for clause, _ in clauses])
    return FuzzySystem(
        tuple(_variable(one) for one in inputs),
        _variable(output),
        tuple(
            one
            for clause, rule in clauses
            for terms, connective in _antecedents(clause, operators, rule)
            for one in _rules(terms, connective, rule, output)
        ),
        operators,
        name,
    )


def _only_output(system: Any) -> Any:
    outputs = list(system.consequents)
    if len(outputs) != 1:
        names = ", ".join(repr(one.label) for one in outputs) or "none"
        raise ValueError(f"outputs {names}: give a control system with one output")
    (output,) = outputs
    if output.defuzzify_method != "centroid":
        raise ValueError(
            f"output {output.label!r}: defuzzification by {output.defuzzify_method!r} is not "
            "computed here; use centroid"
        )
    if DISJUNCTIONS.get(output.accumulation_method) != "max":
        raise ValueError(f"output {output.label!r}: accumulates by another function than max")
    return output


def _variable(variable: Any) -> Variable:
    universe = np.asarray(variable.universe, dtype=np.float64)
    if universe.ndim != 1 or universe.size < 2 or not (np.diff(universe) > 0).all():
        raise ValueError(f"{variable.label}: its universe does not rise; sort it")
    try:
        sets = tuple(
            recognised(label, universe, np.asarray(term.mf, dtype=np.float64))
            for label, term in variable.terms.items()
        )
    except ValueError as error:
        raise ValueError(f"{variable.label}: {error}") from error
    return Variable(str(variable.label), float(universe[0]), float(universe[-1]), sets)


def _named(rule: Any, inputs: Sequence[Any]) -> tuple[_Clause, Any]:
    try:
        return _clause(rule.antecedent, rule, inputs, negated=False), rule
    except ValueError as error:
        raise ValueError(f"rule {rule.label}: {error}") from error


def _clause(node: Any, rule: Any, inputs: Sequence[Any], *, negated: bool) -> _Clause:
    """The clause of a term or of an aggregate of terms, with every NOT moved to the terms."""
    if isinstance(node, SampledTerm):
        return _Clause(((_term(node, inputs, negated),),))
    if node.kind == "not":
        return _clause(node.term1, rule, inputs, negated=not negated)
    parts = [_clause(part, rule, inputs, negated=negated) for part in (node.term1, node.term2)]
    used = _function(node.kind, rule)
    if (node.kind == "and") == negated:
        either = sum((part.alternatives for part in parts), ())
        found = _Clause(either, disjunctions=frozenset([DUAL[used] if negated else used]))
    else:
        first, second = (part.alternatives for part in parts)
        both = tuple(one + other for one in first for other in second)
        found = _Clause(both, conjunctions=frozenset([DUAL[used] if negated else used]))
    return _Clause(
        found.alternatives,
        found.conjunctions.union(*(part.conjunctions for part in parts)),
        found.disjunctions.union(*(part.disjunctions for part in parts)),
    )


def _term(term: Any, inputs: Sequence[Any], negated: bool) -> Term:
    variable = term.parent
    if variable not in inputs:
        raise ValueError(f"{variable.label!r} is an output of other rules; chains are not computed")
    return Term(inputs.index(variable), list(variable.terms).index(term.label), negated)


def _function(kind: str, rule: Any) -> str:
    known, function = (
        (CONJUNCTIONS, rule.and_func) if kind == "and" else (DISJUNCTIONS, rule.or_func)
    )
    if function not in known:
        allowed = "min or product" if kind == "and" else "max or that of to_skfuzzy"
        raise ValueError(f"{kind.upper()} by {function!r} is not computed here; use {allowed}")
    return known[function]


def _operators(clauses: Sequence[_Clause]) -> Operators:
    """The operators common to all rules."""
    chosen: Any = {}
    for key, found in (
        ("conjunction", frozenset().union(*(clause.conjunctions for clause in clauses))),
        ("disjunction", frozenset().union(*(clause.disjunctions for clause in clauses))),
    ):
        if len(found) > 1:
            raise ValueError(f"{key} by {' and '.join(sorted(found))}: use one in all rules")
        for function in found:
            chosen[key] = function
    return Operators(**chosen)


def _antecedents(
    clause: _Clause, operators: Operators, rule: Any
) -> Iterator[tuple[tuple[Term, ...], Connective]]:
    """Antecedents that are together as strong as the clause, where strengths merge by max."""
    if len(clause.alternatives) > 1 and all(len(terms) == 1 for terms in clause.alternatives):
        yield sum(clause.alternatives, ()), "or"
        return
    if len(clause.alternatives) > 1 and operators.disjunction != "max":
        raise ValueError(
            f"rule {rule.label}: mixes AND with OR by probabilistic sum; use max, or part the rule"
        )
    for terms in clause.alternatives:
        yield terms, "and"


def _rules(
    terms: tuple[Term, ...], connective: Connective, rule: Any, output: Any
) -> Iterator[Rule]:
    sets = list(output.terms)
    for weighted in rule.consequent:
        try:
            yield Rule(terms, sets.index(weighted.term.label), connective, float(weighted.weight))
        except ValueError as error:
            raise ValueError(f"rule {rule.label}: {error}") from error
