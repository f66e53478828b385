"""Rules from the paper's Table I.

Reading R1: every 1 in the table is a set of diseases, and each expands to the full grid of the
fuzzy sets of its diseases, joined by AND. (2, 3, 2, 2, 2) sets then give the paper's 247 rules.
The paper prints no consequents; that the stiffest cause governs is a choice of this study.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Literal

from fuzzy.system import Rule, Variable

OddCell = Literal["missing-triple", "literal"]
Duplicates = Literal["keep", "drop"]
Consequent = Literal["max", "mean"]

LETTERS = {"C": "hcv", "B": "hbv", "A": "ald", "L": "cld", "N": "nafld"}
AETIOLOGIES = tuple(LETTERS.values())

# Cell N-C x NAFLD names NAFLD twice; this is the only triple the table otherwise lacks.
MISSING_TRIPLE = ("ald", "cld", "nafld")


def cells(table: Sequence[Mapping[str, str]]) -> list[tuple[str, ...]]:
    """Aetiologies of every 1 in Table I, row by row; a name stands twice in the odd cell only."""
    return [
        _diseases(row["INPUTS"], column)
        for row in table
        for column, mark in row.items()
        if mark == "1"
    ]


def _diseases(row: str, column: str) -> tuple[str, ...]:
    column = column.lower()
    if row.lower() == column:
        return (column,)
    named = (
        (row.lower(),) if row.lower() in AETIOLOGIES else tuple(LETTERS[x] for x in row.split("-"))
    )
    return (*named, column)


def disease_sets(table: Sequence[Mapping[str, str]], odd_cell: OddCell) -> list[tuple[str, ...]]:
    """The cells with the odd one replaced by the missing triple, or kept as printed."""
    return [
        MISSING_TRIPLE if odd_cell == "missing-triple" and len(set(cell)) < len(cell) else cell
        for cell in cells(table)
    ]


def expand(
    diseases: Sequence[str], inputs: Sequence[Variable], output: Variable, consequent: Consequent
) -> list[Rule]:
    """One AND rule for every combination of the fuzzy sets of the given diseases."""
    positions = {variable.name: i for i, variable in enumerate(inputs)}
    chosen = sorted(positions[disease] for disease in diseases)
    grids = [range(len(inputs[i].sets)) for i in chosen]
    return [
        _rule(tuple(zip(chosen, combination, strict=True)), inputs, output, consequent)
        for combination in product(*grids)
    ]


def _rule(
    antecedents: tuple[tuple[int, int], ...],
    inputs: Sequence[Variable],
    output: Variable,
    consequent: Consequent,
) -> Rule:
    scale = [fuzzy_set.name for fuzzy_set in output.sets]
    severities = [scale.index(inputs[i].sets[s].name) for i, s in antecedents]
    return Rule(antecedents, governing(severities, consequent))


def governing(severities: Sequence[int], consequent: Consequent) -> int:
    """Severity of a combination: that of its stiffest member, or the mean rounded up."""
    if consequent == "max":
        return max(severities)
    return math.ceil(sum(severities) / len(severities))


def rule_base(
    table: Sequence[Mapping[str, str]],
    inputs: Sequence[Variable],
    output: Variable,
    *,
    odd_cell: OddCell,
    duplicates: Duplicates,
    consequent: Consequent,
) -> tuple[Rule, ...]:
    """All rules of Table I; the sets of inputs and output share the names mild to severe."""
    rules = [
        rule
        for diseases in disease_sets(table, odd_cell)
        for rule in expand(diseases, inputs, output, consequent)
    ]
    return tuple(rules if duplicates == "keep" else dict.fromkeys(rules))
