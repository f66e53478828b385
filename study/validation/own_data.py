"""A user's own measurements: curves over time and displacements of markers, from CSV files.

A curve has the columns `time_s` and either `displacement_m`, of a control point along the tool's
push, or `force_N`, with which a tool that is moved is pushed; `uncertainty`, in the unit of the
curve and one standard uncertainty of each value, if it is known. `markers.csv` has `x_m`, `y_m`,
`z_m`, where markers were before the load, and `ux_m`, `uy_m`, `uz_m`, how far they had moved when
it was largest, and `uncertainty`. Columns are parted by commas, or by semicolons or tabs, where
decimal commas are read too.
"""

from __future__ import annotations

import csv
import io
import math
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

TIME, UNCERTAINTY = "time_s", "uncertainty"
CURVES = {"displacement_m": "m", "force_N": "N"}
"""Columns of curves, and their units."""
PLACES, MOVES = ("x_m", "y_m", "z_m"), ("ux_m", "uy_m", "uz_m")
FEWEST = 3
DELIMITERS = ",;\t"


@dataclass(frozen=True)
class Curve:
    """Values (k,) of a column at times [s] (k,) that grow; their standard uncertainty, or None."""

    column: str
    times: Floats
    values: Floats
    uncertainty: Floats | None

    @property
    def unit(self) -> str:
        """Of the values."""
        return CURVES[self.column]


@dataclass(frozen=True)
class OwnMarkers:
    """Places and displacements [m] (m, 3) of markers; their standard uncertainty [m] (m,).

    `lines` (m,) of the file that they stand in, for messages.
    """

    places: Floats
    moved: Floats
    uncertainty: Floats | None
    lines: tuple[int, ...] = ()


def read_curve(path: Path) -> Curve:
    """A curve from a CSV file; ValueError naming file, line and column for one that is none."""
    table = _table(path)
    found = [name for name in CURVES if name in table.header]
    if len(found) != 1:
        raise ValueError(
            f"{path}: give one of the columns {' and '.join(CURVES)} beside {TIME}, and not "
            f"{', '.join(table.header)}"
        )
    if TIME not in table.header:
        raise ValueError(
            f"{path}: line 1: {TIME} is missing; give it beside {found[0]}: a force over depth has "
            "the times at which the scene's tool is so deep"
        )
    times, values = table.numbers((TIME, found[0])).T
    late = np.flatnonzero(np.diff(times) <= 0.0)
    if len(late):
        raise table.fault(int(late[0]) + 1, f"{TIME} does not grow; sort the lines by it")
    return Curve(found[0], times, values, _uncertainty(table))


def read_markers(path: Path) -> OwnMarkers:
    """Markers from a CSV file; ValueError naming file, line and column for a file without."""
    table = _table(path)
    numbers = table.numbers((*PLACES, *MOVES))
    return OwnMarkers(numbers[:, :3], numbers[:, 3:], _uncertainty(table), table.lines)


def _uncertainty(table: _Table) -> Floats | None:
    if UNCERTAINTY not in table.header:
        return None
    found = table.numbers((UNCERTAINTY,))[:, 0]
    wrong = np.flatnonzero(found <= 0.0)
    if len(wrong):
        raise table.fault(int(wrong[0]), f"{UNCERTAINTY} must be above 0")
    return found


class _Table(NamedTuple):
    """Cells of a CSV file: its header, the rows that hold any, and the lines on which they end."""

    path: Path
    header: list[str]
    rows: list[list[str]]
    lines: tuple[int, ...]
    decimal: str

    def fault(self, row: int, what: str) -> ValueError:
        """The error that blames a row."""
        return ValueError(f"{self.path}: line {self.lines[row]}: {what}")

    def numbers(self, columns: tuple[str, ...]) -> Floats:
        """Numbers (rows, columns) of the named columns."""
        for name in columns:
            if self.header.count(name) != 1:
                said = "stands there twice" if name in self.header else "is missing"
                raise ValueError(
                    f"{self.path}: line 1: the column {name} {said}; give {', '.join(columns)}"
                )
        if len(self.rows) < FEWEST:
            raise ValueError(
                f"{self.path}: {len(self.rows)} lines of numbers; give {FEWEST} or more"
            )
        places = [self.header.index(name) for name in columns]
        return np.array(
            [[self._number(row, place) for place in places] for row in range(len(self.rows))]
        )

    def _number(self, row: int, place: int) -> float:
        cells = self.rows[row]
        if len(cells) != len(self.header):
            raise self.fault(row, f"{len(cells)} cells, the first line has {len(self.header)}")
        try:
            found = float(cells[place].replace(self.decimal, "."))
        except ValueError:
            found = math.nan
        if not math.isfinite(found):
            name, text = self.header[place], cells[place].strip()
            raise self.fault(row, f"{name}: {text!r} is not a finite number")
        return found


def _table(path: Path) -> _Table:
    """The cells, parted by commas, semicolons or tabs, whichever parts the header into most.

    Where it is not commas, they may stand in numbers as decimal ones.
    """
    text = _text(path)
    delimiter = max(DELIMITERS, key=text.partition("\n")[0].count)
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter)
    try:
        filled = [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    except csv.Error as error:
        raise ValueError(f"{path}: line {reader.line_num}: {error}; export it again") from None
    header = [name.strip() for name in filled[0][1]] if filled else []
    rows = [row for _, row in filled[1:]]
    decimal = "." if delimiter == "," else ","
    return _Table(path, header, rows, tuple(line for line, _ in filled[1:]), decimal)


def _text(path: Path) -> str:
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            return file.read()
    except UnicodeDecodeError:
        raise ValueError(f"{path}: not a text in UTF-8; save it as CSV in UTF-8") from None
    except (FileNotFoundError, IsADirectoryError, NotADirectoryError):
        raise ValueError(f"{path}: there is no such file; give a CSV file") from None
    except OSError as error:
        raise ValueError(f"{path}: cannot be read ({error.strerror}); give a CSV file") from None
