"""A Mamdani system as a simulation of scikit-fuzzy's `control`, for those who work there.

scikit-fuzzy sorts all rules anew for every rule it is given and at every evaluation. Here all rules
read inputs and write the output, so that any order will do and they are handed over as a list.
"""

from collections.abc import Sequence
from functools import reduce
from operator import and_, or_
from typing import Any

import networkx as nx
import numpy as np
from skfuzzy import control

from fuzzy.systems.sets import Array, membership
from fuzzy.systems.system import FuzzySystem, Rule, Variable, memberships


class ListedRules(control.ControlSystem):  # type: ignore[misc]  # scikit-fuzzy has no types
    """A control system whose rules keep the order in which they are given, all at once."""

    def __init__(self, variables: Sequence[Any], rules: Sequence[Any]) -> None:
        super().__init__()
        self._rules = tuple(rules)
        self.graph = nx.compose_all([variable.graph for variable in variables])
        for rule in rules:
            self.graph.add_edges_from((term, rule) for term in rule.antecedent_terms)
            self.graph.add_edges_from((rule, weighted.term) for weighted in rule.consequent)

    @property
    def rules(self) -> tuple[Any, ...]:
        """The rules as given."""
        return self._rules


def control_system(system: FuzzySystem, points: int = 1001) -> control.ControlSystemSimulation:
    """Simulation of the system's rules on principal membership functions.

    Set `simulation.input[name]`, call `compute()`, read `simulation.output[name]`. scikit-fuzzy
    interpolates every set between `points` samples of its universe, moves readings into their
    universes, and leaves the output out where no rule fires. ValueError for what it does not have:
    Sugeno consequents, implication by product, an output with the name of an input.
    """
    _check(system)
    antecedents = [_sampled(control.Antecedent, one, points) for one in system.inputs]
    consequent = _sampled(control.Consequent, system.output, points)
    rules = [
        _rule(system, rule, f"rule {number}", antecedents, consequent)
        for number, rule in enumerate(system.rules, start=1)
    ]
    return control.ControlSystemSimulation(ListedRules([*antecedents, consequent], rules))


def _check(system: FuzzySystem) -> None:
    if system.is_sugeno:
        raise ValueError(
            f"{system.name}: scikit-fuzzy has no Sugeno inference; give the output membership "
            "functions"
        )
    if system.operators.implication != "min":
        raise ValueError("implication 'prod': scikit-fuzzy clips only; use min")
    if system.output.name in {variable.name for variable in system.inputs}:
        raise ValueError(
            f"output {system.output.name!r} has the name of an input, which scikit-fuzzy cannot "
            "tell apart; rename one"
        )


def _sampled(kind: Any, variable: Variable, points: int) -> Any:
    universe = np.linspace(variable.low, variable.high, points)
    sampled = kind(universe, variable.name)
    for one, mu in zip(variable.sets, memberships(variable, universe, membership), strict=True):
        sampled[one.name] = mu
    return sampled


def _rule(
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
        result % rule.weight,
        label,
        and_func=np.fmin if operators.conjunction == "min" else np.multiply,
        or_func=np.fmax if operators.disjunction == "max" else _probor,
    )


def _probor(one: Array, other: Array) -> Array:
    return one + other - one * other
