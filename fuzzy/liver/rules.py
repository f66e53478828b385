"""Rules of the liver: the full grid of fuzzy sets for every cell of Table I that counts.

The paper states no consequents; that the most severe antecedent governs is a choice of this study.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import NamedTuple

from fuzzy.liver.table1 import AETIOLOGIES, Cell
from fuzzy.systems.system import Rule, Term


class Consequent(NamedTuple):
    """Consequent of a combination: the governing severity of its members, and its description."""

    governing: Callable[[Sequence[int]], int]
    words: str


def _mean(severities: Sequence[int]) -> int:
    return math.ceil(sum(severities) / len(severities))


CONSEQUENTS: dict[str, Consequent] = {
    "max": Consequent(max, "the severest antecedent governs the consequent"),
    "mean": Consequent(_mean, "the consequent is the mean severity of the antecedents, rounded up"),
}


def rule_base(
    antecedents: Sequence[Cell], severities: Mapping[str, Sequence[int]], consequent: str
) -> tuple[Rule, ...]:
    """One AND rule for every combination of the fuzzy sets of every cell's diseases.

    `severities`: severity of each set of each aetiology, as the index of its output set.
    """
    return tuple(
        _rule(terms, severities, consequent)
        for cell in antecedents
        for terms in product(*(_terms(disease, len(severities[disease])) for disease in cell))
    )


def _terms(disease: str, sets: int) -> list[Term]:
    return [Term(AETIOLOGIES.index(disease), s) for s in range(sets)]


def _rule(
    terms: tuple[Term, ...], severities: Mapping[str, Sequence[int]], consequent: str
) -> Rule:
    named = [severities[AETIOLOGIES[term.input]][term.set] for term in terms]
    return Rule(terms, CONSEQUENTS[consequent].governing(named))
