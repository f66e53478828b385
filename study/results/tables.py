"""Rows of the CSV tables of a results folder; the fields are the columns, units in their names."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, get_type_hints


class CurveSample(NamedTuple):
    """One sample of a model's motion at a control point, along the push: curves.csv."""

    model: str
    probe: str
    time_s: float
    displacement_m: float
    velocity_m_per_s: float


class BandSample(NamedTuple):
    """One sample of the motion at both bounds of a stiffness interval: bands.csv."""

    model: str
    probe: str
    time_s: float
    displacement_at_lower_m: float
    displacement_at_upper_m: float
    velocity_at_lower_m_per_s: float
    velocity_at_upper_m_per_s: float


class SimilarityScore(NamedTuple):
    """Score of a model's curve against that of a reference by one measure: similarity.csv."""

    model: str
    reference: str
    probe: str
    curve: str
    measure: str
    score: float


class FieldDifference(NamedTuple):
    """Difference of a model's whole field from that of a reference: errors.csv."""

    model: str
    reference: str
    quantity: str
    value: float


class SensitivityEntry(NamedTuple):
    """What another choice of the fuzzy side changes of an estimate: sensitivity.csv."""

    choice: str
    base: str
    alternative: str
    system: str
    change_at_readings_pa: float
    rms_change_pa: float
    largest_change_pa: float
    readings: float


Entry = TypeVar("Entry", bound=NamedTuple)


def write_table(path: Path, kind: type[Entry], rows: Iterable[Entry]) -> None:
    """Write rows as CSV under the names of their fields."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(kind._fields)
        writer.writerows([_cell(value) for value in row] for row in rows)


def read_table(path: Path, kind: type[Entry]) -> tuple[Entry, ...]:
    """Rows of a table. ValueError naming file and line of what is not one."""
    with path.open(newline="", encoding="utf-8") as file:
        reader = csv.reader(file)
        header = tuple(next(reader, ()))
        if header != kind._fields:
            raise ValueError(f"{path.name} has columns {', '.join(header)}")
        return tuple(_rows(path, kind, reader))


def _rows(path: Path, kind: type[Entry], reader: Iterable[list[str]]) -> Iterator[Entry]:
    hints = get_type_hints(kind)
    convert = [hints[name] for name in kind._fields]
    for number, cells in enumerate(reader, 2):
        try:
            yield kind._make(make(text) for make, text in zip(convert, cells, strict=True))
        except ValueError as error:
            raise ValueError(f"{path.name}, line {number}: {error}") from None


def _cell(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:.12g}"
