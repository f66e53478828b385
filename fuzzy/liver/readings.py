"""Readings of Table I that reach the paper's 247 rules.

The paper states neither its rules nor the number of fuzzy sets of an input. Here every cell of
Table I expands to the full grid of the sets of its diseases; which cells count, and how, is open.
Several readings give 247 rules, so the count does not determine the authors' choice.
"""

from dataclasses import dataclass
from math import prod
from typing import Literal

from fuzzy.liver.table1 import AETIOLOGIES, Cell, cells, is_odd

Diagonal = Literal["single", "square"]
OddCell = Literal["missing-triple", "literal", "pair", "drop"]
Duplicates = Literal["keep", "drop"]

MISSING_TRIPLE = ("ald", "cld", "nafld")
"""The only triple that Table I lacks."""


@dataclass(frozen=True)
class TableReading:
    """One way of reading the rules off Table I.

    `counts`: fuzzy sets of each aetiology, in the order of AETIOLOGIES. `sizes`: the cells that
    count, by their number of diseases. `diagonal`: a cell of a disease with itself is one term, or
    (`square`) two terms of that disease. `odd_cell`: N-C x NAFLD, which names NAFLD twice, is the
    triple that the table lacks, two NAFLD terms beside one of HCV, the pair HCV and NAFLD, or
    nothing. `duplicates`: whether the triple that the table marks twice enters twice.
    """

    counts: tuple[int, int, int, int, int]
    sizes: tuple[int, ...] = (1, 2, 3, 4)
    diagonal: Diagonal = "single"
    odd_cell: OddCell = "missing-triple"
    duplicates: Duplicates = "keep"


SINGLES_TO_TRIPLES = (1, 2, 3)
PAIRS_AND_TRIPLES = (2, 3)

READINGS: dict[str, TableReading] = {
    "R1": TableReading((2, 3, 2, 2, 2)),
    "R1-no-duplicates": TableReading((2, 3, 2, 2, 2), duplicates="drop"),
    "R1-literal": TableReading((2, 3, 2, 2, 2), odd_cell="literal"),
    "R1-literal-hcv3": TableReading((3, 2, 2, 2, 2), odd_cell="literal"),
    "R2": TableReading((2, 2, 2, 2, 3), diagonal="square", odd_cell="pair"),
    "R3-pair": TableReading((3, 2, 2, 2, 2), diagonal="square", odd_cell="pair", duplicates="drop"),
    "R3-literal": TableReading(
        (2, 2, 2, 2, 3), diagonal="square", odd_cell="literal", duplicates="drop"
    ),
    "R4-drop": TableReading((2, 3, 2, 3, 3), PAIRS_AND_TRIPLES, odd_cell="drop"),
    "R4-pair": TableReading((3, 2, 2, 3, 3), PAIRS_AND_TRIPLES, odd_cell="pair"),
    "R5-hbv4": TableReading((2, 4, 3, 2, 2), SINGLES_TO_TRIPLES, odd_cell="drop"),
    "R5-hcv4": TableReading((4, 3, 2, 2, 2), SINGLES_TO_TRIPLES, odd_cell="drop"),
    "R5-pair": TableReading((4, 2, 3, 2, 2), SINGLES_TO_TRIPLES, odd_cell="pair"),
}
"""Readings supported by the data; all give 247 rules except R1-no-duplicates with 235."""

UNSUPPORTED = {
    "R6": "singles, pairs and quadruples, one term on the diagonal, need four sets of ALD, CLD "
    "or NAFLD",
    "R7": "pairs alone need six sets of some aetiology",
    "R8": "singles and pairs need at least five sets of some aetiology",
}
"""Readings that give 247 rules with sets for which there are no data, and what they need."""


def reading_named(name: str) -> TableReading:
    """The reading of a name. ValueError for an unknown name or one not supported by the data."""
    if name in READINGS:
        return READINGS[name]
    lacking = next((f"{x}: {need}" for x, need in UNSUPPORTED.items() if name.startswith(x)), None)
    reason = f" ({lacking}, which no data describe)" if lacking else ""
    raise ValueError(f"reading = {name!r}{reason}: use one of {', '.join(READINGS)}")


def disease_sets(reading: TableReading) -> list[Cell]:
    """Diseases of the antecedents, one entry per cell that counts, in the order of Table I."""
    printed = list(dict.fromkeys(cells())) if reading.duplicates == "drop" else list(cells())
    odd = [_odd(cell, reading.odd_cell) if is_odd(cell) else cell for cell in printed]
    counted = [cell for cell in odd if len(cell) in reading.sizes]
    squared = reading.diagonal == "square"
    return [2 * cell if squared and len(cell) == 1 else cell for cell in counted]


def _odd(cell: Cell, meaning: OddCell) -> Cell:
    match meaning:
        case "missing-triple":
            return MISSING_TRIPLE
        case "literal":
            return cell
        case "pair":
            return tuple(dict.fromkeys(cell))
    return ()


def rule_count(reading: TableReading) -> int:
    """Number of rules that a reading of Table I gives, by counting grids."""
    counts = dict(zip(AETIOLOGIES, reading.counts, strict=True))
    return sum(prod(counts[disease] for disease in cell) for cell in disease_sets(reading))
