"""Random places of the tool, in ranges of the largest strain of the linear elements."""

from collections.abc import Iterable, Iterator, Sequence
from statistics import median
from typing import NamedTuple

from docs.figures.formats import percent
from docs.figures.tables import Line, column


class StrainRange(NamedTuple):
    """Strains above one limit and up to another, in the words of the pages."""

    words: str
    above: float
    up_to: float

    def of(self, places: Iterable[Line]) -> list[Line]:
        """The places whose largest strain is in the range."""
        return [one for one in places if self.above < float(one["strain"]) <= self.up_to]


STRAINS = (StrainRange("1 to 5 %", 0.0, 0.05), StrainRange("5 to 20 %", 0.05, 1.0))
SMALL_OR_LARGE = ("small", "large")
"""In the names of figures, by the ranges."""


def place(line: Line) -> tuple[str, str]:
    """Where the tool is, as the tables write it."""
    return line["at_x"], line["at_z"]


def by_strain(
    places: list[Line], columns: Sequence[str], strains: Sequence[StrainRange] = STRAINS
) -> Iterator[list[str]]:
    """A row for each range: its words, the number of places, and "median, worst" of each column."""
    for strain in strains:
        found = strain.of(places)
        yield [strain.words, str(len(found)), *(_median_and_worst(found, c) for c in columns)]


def _median_and_worst(lines: list[Line], name: str) -> str:
    values = column(lines, name)
    return f"{percent(median(values))}, {percent(max(values))}"
