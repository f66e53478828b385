"""Rows of the CSV tables of a results folder; the fields are the columns, units in their names."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, get_type_hints


class CurveSample(NamedTuple):
    """One sample of a model's motion at a control point, along the push: curves.csv."""

    model: str
    probe: str
    time_s: float
    displacement_m: float
    velocity_m_per_s: float


class ToolForceSample(NamedTuple):
    """One sample of what a rigid tool does to a model's body: tool_force.csv.

    `travel_m` of the tool and `force_n` are along its axis, `tangential_n` is across.
    """

    model: str
    tool: str
    time_s: float
    travel_m: float
    force_n: float
    tangential_n: float


class ToolForceScore(NamedTuple):
    """Score of the force of a tool in a model against that in a reference: tool_similarity.csv."""

    model: str
    reference: str
    tool: str
    curve: str
    measure: str
    score: float


class BandSample(NamedTuple):
    """One sample of the motion at both bounds of a stiffness interval: bands.csv."""

    model: str
    probe: str
    time_s: float
    displacement_at_lower_m: float
    displacement_at_upper_m: float
    velocity_at_lower_m_per_s: float
    velocity_at_upper_m_per_s: float


class CertifiedSample(NamedTuple):
    """Bound on the displacement error of a superposition against the unreduced model.

    A row of certified.csv. The magnitude of the error vector is at most this at that time.
    """

    model: str
    probe: str
    time_s: float
    displacement_bound_m: float


class SimilarityScore(NamedTuple):
    """Score of a model's curve against that of a reference by one measure: similarity.csv."""

    model: str
    reference: str
    probe: str
    curve: str
    measure: str
    score: float


class Iso18571Rating(NamedTuple):
    """The parts of a score by ISO/TS 18571, each in [0, 1]: iso_18571.csv."""

    model: str
    reference: str
    probe: str
    curve: str
    corridor: float
    phase: float
    magnitude: float
    slope: float

    @property
    def overall(self) -> float:
        """The score that these are the parts of."""
        return 0.4 * self.corridor + 0.2 * (self.phase + self.magnitude + self.slope)


class ScoreError(NamedTuple):
    """What a score depends on besides the two models, and the ranks it leaves: score_errors.csv.

    `low` and `high` bound the 95 % block interval; see `study.similarity.uncertainty` for it, for
    `resampled`, `window` and `normalised`. `numerical`: sum of the relative errors of both curves,
    None if one is not estimated. `first_rank` to `last_rank` of the models scored beside it.
    """

    model: str
    reference: str
    probe: str
    curve: str
    measure: str
    low: float
    high: float
    resampled: float
    window: float
    normalised: float
    numerical: float | None
    first_rank: float
    last_rank: float


class ScoreDifference(NamedTuple):
    """A model's score less that of another, each part of its error paired: score_differences.csv.

    Blocks, samples, windows and axes are the same for both, so that what affects both alike
    cancels. `numerical`: sum of the relative errors of the three curves.
    """

    model: str
    other: str
    reference: str
    probe: str
    curve: str
    measure: str
    difference: float
    low: float
    high: float
    resampled: float
    window: float
    normalised: float
    numerical: float | None

    @property
    def is_beyond_sampling(self) -> bool:
        """Whether zero is outside of the interval and every second sample moves it by less."""
        return (self.low > 0.0 or self.high < 0.0) and abs(self.difference) > self.resampled

    @property
    def is_resolved(self) -> bool | None:
        """Whether it exceeds each of its errors; None if the numerical one is not known."""
        if not self.is_beyond_sampling:
            return False
        return None if self.numerical is None else abs(self.difference) > self.numerical


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


Key = tuple[str, str, str]
"""Model, reference and control point of a scored curve."""
QUANTITIES = (
    *("field-relative-l2-peak", "field-relative-l2-final", "field-l2-final-over-peak"),
    *("field-best-factor-peak", "field-relative-l2-peak-at-best-factor"),
)
"""Quantities of errors.csv, in the order of its rows."""


def pairs(models: Sequence[str], references: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Candidate and reference: every model against each reference, and no pair the other way."""
    for rank, reference in enumerate(references):
        for model in models:
            if reference in models and model not in references[: rank + 1]:
                yield model, reference


def paired(keys: Sequence[Key]) -> Iterator[tuple[Key, Key]]:
    """Every two models that are scored against one reference at one control point."""
    for place in dict.fromkeys(key[1:] for key in keys):
        yield from combinations([key for key in keys if key[1:] == place], 2)


class TableFile(NamedTuple):
    """A CSV table of a results folder: its file, the attribute of `Results`, and the kind of row.

    `keys`: number of first columns that name a row, or the curve that a sample is of; `of_tools`:
    whether only scenes with rigid tools have it.
    """

    file: str
    attribute: str
    kind: type[Any]
    keys: int
    of_tools: bool = False


TABLES = (
    TableFile("curves.csv", "curves", CurveSample, 2),
    TableFile("bands.csv", "bands", BandSample, 2),
    TableFile("certified.csv", "certified", CertifiedSample, 2),
    TableFile("tool_force.csv", "tool_forces", ToolForceSample, 2, of_tools=True),
    TableFile("tool_similarity.csv", "tool_scores", ToolForceScore, 5, of_tools=True),
    TableFile("similarity.csv", "scores", SimilarityScore, 5),
    TableFile("iso_18571.csv", "ratings", Iso18571Rating, 4),
    TableFile("score_errors.csv", "score_errors", ScoreError, 5),
    TableFile("score_differences.csv", "score_differences", ScoreDifference, 6),
    TableFile("errors.csv", "field_differences", FieldDifference, 3),
    TableFile("sensitivity.csv", "sensitivity", SensitivityEntry, 4),
)
"""All CSV tables; a table is written, read, compared and summed up by its line here."""

Entry = TypeVar("Entry", bound=NamedTuple)


def write_table(path: Path, kind: type[Entry], rows: Iterable[Entry]) -> None:
    """Write rows as CSV under the names of their fields."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(kind._fields)
        writer.writerows([_cell(value) for value in row] for row in rows)


def read_table(path: Path, kind: type[Entry]) -> tuple[Entry, ...]:
    """Rows of a table. ValueError naming file and line of what is not one."""
    text = path.read_bytes()
    reader = csv.reader(io.StringIO(_text(path, text), newline=""))
    header = tuple(next(reader, ()))
    if header != kind._fields:
        raise ValueError(
            f"{path.name}, line 1: columns {', '.join(header) or 'none'}, not "
            f"{', '.join(kind._fields)}"
        )
    rows = tuple(_rows(path, kind, reader))
    if not text.endswith(b"\n"):
        raise ValueError(f"{path.name}, line {len(rows) + 1}: is cut, it has no end of line")
    return rows


def _text(path: Path, data: bytes) -> str:
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ValueError(f"{path.name}, line {line}: is no text in UTF-8") from None


def _rows(path: Path, kind: type[Entry], reader: Iterable[list[str]]) -> Iterator[Entry]:
    hints, number = get_type_hints(kind), 1
    try:
        for cells in reader:
            number += 1
            yield kind._make(_values(kind._fields, hints, cells))
    except csv.Error as error:
        raise ValueError(f"{path.name}, line {number + 1}: {error}") from None
    except ValueError as error:
        raise ValueError(f"{path.name}, line {number}: {error}") from None


def _values(names: Sequence[str], kinds: Mapping[str, object], cells: list[str]) -> list[object]:
    if len(cells) != len(names):
        raise ValueError(f"{len(cells)} cells, not {len(names)}")
    return [_value(name, kinds[name], text) for name, text in zip(names, cells, strict=True)]


def _value(name: str, kind: object, text: str) -> object:
    """A name, a finite number, or None where it may be. ValueError naming the column of others."""
    if kind is str:
        return text
    if kind == float | None and not text:
        return None
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"{name} is {text!r}, no finite number")
    return value


def _cell(value: str | float | None) -> str:
    if value is None:
        return ""
    return value if isinstance(value, str) else f"{value:.12g}"
