"""An explanation as plain arrays, for plots of the rules."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fuzzy.systems.explain import Explanation, Firing, shown_rules
from fuzzy.systems.kinds import SYSTEMS
from fuzzy.systems.rule_text import rule_text
from fuzzy.systems.sets import Array
from fuzzy.systems.system import Variable, memberships

VIEW_RULES = 6
VIEW_POINTS = 301


def drawing_arrays(explanation: Explanation, unit: str = "") -> dict[str, NDArray[Any]]:
    """Arrays of a rule plot, with names that begin with view.KIND.

    R rules, T terms, D inputs, K output sets, P and M points:
    `inputs`, `readings` (D,), `x` (D, P), `y` (M,), `unit`;
    `rules.number`, `.lower`, `.upper`, `.share`, `.consequent`, `.sets_height`, `.text` (R,);
    `terms.rule`, `.input`, `.set`, `.negated`, `.degree_lower`, `.degree_upper` (T,),
    `terms.lower`, `.upper` (T, P), a negated term as 1 less the membership;
    `outputs` (K,), `outputs.height_lower`, `.height_upper`, `.constant`, `.share` (K,),
    `outputs.lower`, `.upper` (K, M); `lower`, `upper` (M,) of the union;
    `answer` (), `interval` (2,) and `switches` (2, 2).
    Arrays that the kind of system does not have are empty.
    """
    shown = shown_rules(explanation, VIEW_RULES)
    parts: dict[str, Any] = {
        "unit": unit,
        "inputs": [variable.name for variable in explanation.system.inputs],
        "readings": explanation.readings,
        "answer": explanation.answer,
        "interval": explanation.interval or (),
        "switches": [(s.before, s.after) for s in explanation.switches or ()],
        **_drawn_rules(explanation, shown),
        **_drawn_terms(explanation, shown),
        **_drawn_outputs(explanation),
    }
    return {f"view.{explanation.kind}.{name}": np.asarray(part) for name, part in parts.items()}


def _drawn_rules(explanation: Explanation, shown: Sequence[Firing]) -> dict[str, Any]:
    return {
        "rules.number": [firing.number for firing in shown],
        "rules.lower": [firing.lower for firing in shown],
        "rules.upper": [firing.upper for firing in shown],
        "rules.share": [firing.share for firing in shown if firing.share is not None],
        "rules.consequent": [firing.rule.consequent for firing in shown],
        "rules.sets_height": [firing.sets_lower or firing.sets_upper for firing in shown],
        "rules.text": [rule_text(firing.rule, explanation.system) for firing in shown],
    }


def _drawn_terms(explanation: Explanation, shown: Sequence[Firing]) -> dict[str, Any]:
    system, (low, high) = explanation.system, SYSTEMS[explanation.kind].bounds
    x = np.array([_line(variable) for variable in system.inputs])
    terms = [(i, term) for i, firing in enumerate(shown) for term in firing.rule.antecedents]
    sets = [system.inputs[term.input].sets[term.set] for _, term in terms]
    at = [np.append(x[term.input], explanation.readings[term.input]) for _, term in terms]
    lower, upper = (
        np.array([bound(one, points) for one, points in zip(sets, at, strict=True)])
        for bound in (low, high)
    )
    negated = np.array([term.negated for _, term in terms])
    flipped = negated[:, np.newaxis]
    lower, upper = np.where(flipped, 1 - upper, lower), np.where(flipped, 1 - lower, upper)
    return {
        "x": x,
        "terms.rule": [i for i, _ in terms],
        "terms.input": [term.input for _, term in terms],
        "terms.set": [one.name for one in sets],
        "terms.negated": negated,
        "terms.lower": lower[:, :-1],
        "terms.upper": upper[:, :-1],
        "terms.degree_lower": lower[:, -1],
        "terms.degree_upper": upper[:, -1],
    }


def _line(variable: Variable) -> Array:
    return np.linspace(variable.low, variable.high, VIEW_POINTS)


def _drawn_outputs(explanation: Explanation) -> dict[str, Any]:
    system, outputs, curve = explanation.system, explanation.outputs, explanation.curve
    y = _line(system.output) if curve is None else curve.y
    bounds = () if system.is_sugeno else SYSTEMS[explanation.kind].bounds
    sets = [memberships(system.output, y, bound) for bound in bounds]
    return {
        "y": y,
        "lower": () if curve is None else curve.lower,
        "upper": () if curve is None else curve.upper,
        "outputs": [one.name for one in outputs],
        "outputs.height_lower": [one.lower for one in outputs],
        "outputs.height_upper": [one.upper for one in outputs],
        "outputs.constant": [one.constant for one in outputs if one.constant is not None],
        "outputs.share": [one.share for one in outputs if one.share is not None],
        "outputs.lower": sets[0] if sets else (),
        "outputs.upper": sets[1] if sets else (),
    }
