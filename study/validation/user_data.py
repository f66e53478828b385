"""A user's own measurements: curves over time and displacements of markers, from CSV files.

A curve has the columns `time_s` and either `displacement_m`, of a control point along the tool's
push, or `force_N`, with which a tool that is moved is pushed; `uncertainty`, in the unit of the
curve and one standard uncertainty of each value, if it is known. `markers.csv` has `x_m`, `y_m`,
`z_m`, where markers were before the load, and `ux_m`, `uy_m`, `uz_m`, how far they had moved when
it was largest, and `uncertainty`. A column of another name is refused: it may be one of these that
is misspelt. Columns are separated by commas, or by semicolons or tabs, where decimal commas are
read too.
"""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from study.system.spreadsheet import Table, decimal_commas, number, read_table

Floats = NDArray[np.float64]

TIME, UNCERTAINTY = "time_s", "uncertainty"
CURVES = {"displacement_m": "m", "force_N": "N"}
"""Columns of curves, and their units."""
PLACES, MOVES = ("x_m", "y_m", "z_m"), ("ux_m", "uy_m", "uz_m")
FEWEST = 3


@dataclass(frozen=True)
class Curve:
    """Values (k,) of a column at increasing times [s] (k,); their standard uncertainty, or None.

    `lines` (k,): their lines in the file, for messages.
    """

    column: str
    times: Floats
    values: Floats
    uncertainty: Floats | None
    lines: tuple[int, ...] = ()

    @property
    def unit(self) -> str:
        """Unit of the values."""
        return CURVES[self.column]


@dataclass(frozen=True)
class UserMarkers:
    """Places and displacements [m] (m, 3) of markers; their standard uncertainty [m] (m,).

    `lines` (m,): line numbers in the file, for messages.
    """

    places: Floats
    moved: Floats
    uncertainty: Floats | None
    lines: tuple[int, ...] = ()


def read_curve(path: Path) -> Curve:
    """A curve from a CSV file; ValueError naming file, line and column if it is malformed."""
    table = read_table(path)
    if TIME not in map(str.strip, table.header):
        present = ", ".join(repr(name.strip()) for name in table.header)
        raise table.fault(
            table.header_line,
            f"the column {TIME} is missing among {present}; {_missing_time(table.header)}",
        )
    names = _names(table, (TIME, *CURVES, UNCERTAINTY))
    found = [name for name in CURVES if name in names]
    if len(found) != 1:
        raise table.fault(
            table.header_line, f"give one of the columns {' and '.join(CURVES)} beside {TIME}"
        )
    times, values = _numbers(table, names, (TIME, found[0])).T
    late = np.flatnonzero(np.diff(times) <= 0.0)
    if len(late):
        line = table.lines[int(late[0]) + 1]
        raise table.fault(line, f"{TIME} does not grow; sort the lines by it")
    return Curve(found[0], times, values, _uncertainty(table, names), tuple(table.lines))


def _missing_time(header: Sequence[str]) -> str:
    """What to do about a header without the column of the times."""
    if len(header) == 1:
        return "begin with the names of the columns, separated by commas, semicolons or tabs"
    near = difflib.get_close_matches(TIME, [name.strip().lower() for name in header], 1)
    if near:
        return f"name it {TIME}, in seconds"
    return "for a force over depth give the times at which the scene's tool has that depth"


def read_markers(path: Path) -> UserMarkers:
    """Markers from a CSV file; ValueError naming file, line and column if it is malformed."""
    table = read_table(path)
    names = _names(table, (*PLACES, *MOVES, UNCERTAINTY))
    numbers = _numbers(table, names, (*PLACES, *MOVES))
    spread = _uncertainty(table, names)
    return UserMarkers(numbers[:, :3], numbers[:, 3:], spread, tuple(table.lines))


def _names(table: Table, known: Sequence[str]) -> list[str]:
    """Names of the columns, each a known one that appears once."""
    names = [name.strip() for name in table.header]
    for name in names:
        if name not in known:
            near = difflib.get_close_matches(name, [one for one in known if one not in names], 1)
            what = (
                f"did you mean {near[0]}? Convert its numbers to that unit and rename it"
                if near
                else "rename or remove it"
            )
            raise table.fault(
                table.header_line, f"column {name!r} is none of {', '.join(known)}; {what}"
            )
        if names.count(name) > 1:
            raise table.fault(
                table.header_line, f"column {name!r} appears twice; rename or remove one"
            )
    return names


def _uncertainty(table: Table, names: list[str]) -> Floats | None:
    if UNCERTAINTY not in names:
        return None
    found = _numbers(table, names, (UNCERTAINTY,))[:, 0]
    wrong = np.flatnonzero(found <= 0.0)
    if len(wrong):
        raise table.fault(
            table.lines[int(wrong[0])],
            f"{UNCERTAINTY} must be above 0; remove the column where it is not known",
        )
    return found


def _numbers(table: Table, names: list[str], columns: Sequence[str]) -> Floats:
    """Numbers (rows, columns) of the columns of these names."""
    for name in columns:
        if name not in names:
            raise table.fault(
                table.header_line, f"the column {name} is missing; give {', '.join(columns)}"
            )
    if len(table.rows) < FEWEST:
        raise table.fault(
            table.lines[-1], f"{len(table.rows)} lines of numbers; give {FEWEST} or more"
        )
    commas = decimal_commas(table, range(len(names)))
    places = [names.index(name) for name in columns]
    return np.array(
        [
            [number(cells[k], table, line, names[k], commas=commas) for k in places]
            for cells, line in zip(table.rows, table.lines, strict=True)
        ]
    )
