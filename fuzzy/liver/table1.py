"""The paper's Table I: which diseases occur together in an antecedent."""

from functools import cache

from fuzzy.liver.knowledge import rows

LETTERS = {"C": "hcv", "B": "hbv", "A": "ald", "L": "cld", "N": "nafld"}
AETIOLOGIES = tuple(LETTERS.values())
"""The five inputs, in the order of the columns of Table I."""

Cell = tuple[str, ...]
"""Diseases of a cell, in the order of AETIOLOGIES."""


@cache
def cells() -> tuple[Cell, ...]:
    """Diseases of every 1 in Table I, row by row; one stands twice in the odd cell N-C x NAFLD."""
    return tuple(
        _cell(row["INPUTS"], column)
        for row in rows("table1.csv")
        for column, mark in row.items()
        if mark == "1"
    )


def _cell(row: str, column: str) -> Cell:
    column = column.lower()
    if row.lower() == column:
        return (column,)
    named = [row.lower()] if row.lower() in AETIOLOGIES else [LETTERS[x] for x in row.split("-")]
    return tuple(sorted([*named, column], key=AETIOLOGIES.index))


def is_odd(cell: Cell) -> bool:
    """Whether a cell of Table I names a disease twice."""
    return len(set(cell)) < len(cell)
