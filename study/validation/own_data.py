"""A user's own measurements: curves over time and displacements of markers, from CSV files.

A curve has the columns `time_s` and either `displacement_m`, of a control point along the tool's
push, or `force_N`, with which a tool that is moved is pushed; `uncertainty`, in the unit of the
curve and one standard uncertainty of each value, if it is known. `markers.csv` has `x_m`, `y_m`,
`z_m`, where markers were before the load, and `ux_m`, `uy_m`, `uz_m`, how far they had moved when
it was largest, and `uncertainty`.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

TIME, UNCERTAINTY = "time_s", "uncertainty"
CURVES = {"displacement_m": "m", "force_N": "N"}
"""Columns of curves, and their units."""
PLACES, MOVES = ("x_m", "y_m", "z_m"), ("ux_m", "uy_m", "uz_m")
FEWEST = 3


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
    """Places and displacements [m] (m, 3) of markers; their standard uncertainty [m] (m,)."""

    places: Floats
    moved: Floats
    uncertainty: Floats | None


def read_curve(path: Path) -> Curve:
    """A curve from a CSV file; ValueError naming file, line and column for one that is none."""
    columns = _header(path)
    found = [name for name in CURVES if name in columns]
    if len(found) != 1:
        raise ValueError(f"{path}: give one of the columns {' and '.join(CURVES)} beside {TIME}")
    numbers = _read(path, (TIME, found[0]))
    times = numbers[:, 0]
    late = np.flatnonzero(np.diff(times) <= 0.0)
    if len(late):
        raise ValueError(f"{path}: line {late[0] + 3}: {TIME} does not grow; sort the lines by it")
    return Curve(found[0], times, numbers[:, 1], _uncertainty(path))


def read_markers(path: Path) -> OwnMarkers:
    """Markers from a CSV file; ValueError naming file, line and column for a file without."""
    numbers = _read(path, (*PLACES, *MOVES))
    return OwnMarkers(numbers[:, :3], numbers[:, 3:], _uncertainty(path))


def _uncertainty(path: Path) -> Floats | None:
    if UNCERTAINTY not in _header(path):
        return None
    found = _read(path, (UNCERTAINTY,))[:, 0]
    wrong = np.flatnonzero(found <= 0.0)
    if len(wrong):
        raise ValueError(f"{path}: line {wrong[0] + 2}: {UNCERTAINTY} must be above 0")
    return found


def _header(path: Path) -> Sequence[str]:
    reader = csv.reader(_text(path).splitlines())
    return [name.strip() for name in next(reader, [])]


def _read(path: Path, columns: tuple[str, ...]) -> Floats:
    """Numbers (lines, columns) of the named columns."""
    header = _header(path)
    lacking = [name for name in columns if name not in header]
    if lacking:
        raise ValueError(f"{path}: line 1: the column {lacking[0]} is missing; give {columns}")
    places = [header.index(name) for name in columns]
    rows = list(_rows(path, header, places))
    if len(rows) < FEWEST:
        raise ValueError(f"{path}: {len(rows)} lines of numbers; give {FEWEST} or more")
    return np.array(rows)


def _rows(path: Path, header: Sequence[str], places: list[int]) -> Iterator[list[float]]:
    lines = csv.reader(_text(path).splitlines())
    next(lines)
    for number, cells in enumerate(lines, 2):
        if not cells:
            continue
        if len(cells) != len(header):
            raise ValueError(
                f"{path}: line {number}: {len(cells)} cells, the first line has {len(header)}"
            )
        yield [_number(path, number, header[place], cells[place]) for place in places]


def _number(path: Path, line: int, column: str, text: str) -> float:
    try:
        found = float(text)
    except ValueError:
        found = math.nan
    if not math.isfinite(found):
        raise ValueError(f"{path}: line {line}: {column}: {text.strip()!r} is not a finite number")
    return found


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError(f"{path}: not a text in UTF-8; save it as CSV") from None
    except (FileNotFoundError, IsADirectoryError, NotADirectoryError):
        raise ValueError(f"{path}: there is no such file; give a CSV file") from None
