"""Rules of the liver: the full grid of fuzzy sets for every cell of Table I that counts.

The paper prints no consequents; that the severest antecedent governs is a choice of this study.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Literal

from fuzzy.liver.table1 import AETIOLOGIES, Cell
from fuzzy.systems.system import Rule, Term

Consequent = Literal["max", "mean"]


def rule_base(
    antecedents: Sequence[Cell], severities: Mapping[str, Sequence[int]], consequent: Consequent
) -> tuple[Rule, ...]:
    """One AND rule for every combination of the fuzzy sets of every cell's diseases.

    `severities` holds, for each aetiology, the severity of each of its sets: the index of the
    output set it stands for.
    """
    return tuple(
        _rule(terms, severities, consequent)
        for cell in antecedents
        for terms in product(*(_terms(disease, len(severities[disease])) for disease in cell))
    )


def _terms(disease: str, sets: int) -> list[Term]:
    return [Term(AETIOLOGIES.index(disease), s) for s in range(sets)]


def _rule(
    terms: tuple[Term, ...], severities: Mapping[str, Sequence[int]], consequent: Consequent
) -> Rule:
    named = [severities[AETIOLOGIES[term.input]][term.set] for term in terms]
    return Rule(terms, governing(named, consequent))


def governing(severities: Sequence[int], consequent: Consequent) -> int:
    """Severity of a combination: that of its severest member, or the mean rounded up."""
    if consequent == "max":
        return max(severities)
    return math.ceil(sum(severities) / len(severities))
