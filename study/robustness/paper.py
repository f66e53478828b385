"""The paper's printed rules and ranking, and the sources of what it leaves out."""

from fuzzy.liver.knowledge import rows

TABLE_III = {"interval-type-2": 0.8598, "mamdani": 0.8580, "sugeno": 0.8549}
"""Similarity of each fuzzy model to the benchmark, by a measure that the paper does not define."""


def table_i() -> list[list[str]]:
    """Table I of the paper as rows of cells, the header first."""
    found = rows("table1.csv")
    return [list(found[0]), *(list(row.values()) for row in found)]


def elastography_sources() -> list[tuple[str, str]]:
    """Citation and identifier of each published source of the elastography data."""
    published = [row for row in rows("sources.csv") if row["identifier"] != "none"]
    return [(row["citation"], row["identifier"]) for row in published]
