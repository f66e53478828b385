"""Evaluation of a fuzzy system for the readings of a CSV file."""

import difflib
import math
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fuzzy.systems.inference import Inferred, infer
from fuzzy.systems.kinds import check_kind
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.sets import Array
from fuzzy.systems.system import FuzzySystem
from study.system.spreadsheet import (
    Table,
    TableError,
    decimal_commas,
    number,
    read_table,
    write_table,
)

VALUE = "estimate"
BOUNDS = ("lower", "upper")

_ROW = r"\(row (\d+)(?: of \d+)?"


class Blanks(NamedTuple):
    """Meaning of a blank cell: `value` replaces the reading, with a `note`.

    `system` returns the system for rows in which only the given inputs have a reading.
    """

    value: float
    system: Callable[[tuple[str, ...]], FuzzySystem]
    note: str


class _Group(NamedTuple):
    """Rows (n,) of a table for one system, and their readings (n, inputs)."""

    system: FuzzySystem
    rows: list[int]
    X: Array


def evaluate_table(
    system: FuzzySystem,
    csv_in: Path,
    csv_out: Path,
    kind: str,
    options: InferenceOptions | None = None,
    unit: str = "",
    plausible: tuple[float, float] = (-math.inf, math.inf),
    blanks: Blanks | None = None,
) -> tuple[str, ...]:
    """Write the table with the column `estimate`, for type-2 also `lower` and `upper`; its notes.

    Columns are identified by the names of the inputs, in their units. All columns are copied with
    their delimiter; empty lines are dropped. A blank cell is refused unless `blanks` defines it. An
    existing `csv_out` is replaced once everything is computed; it must not be `csv_in`. ValueError
    with file, line, column and remedy, also for a reading outside the `plausible` range.
    """
    check_kind(system, kind)
    if csv_out.resolve() == csv_in.resolve():
        raise TableError(f"{csv_out}: is the table itself; write the answers to another file")
    table = read_table(csv_in)
    added = (VALUE, *BOUNDS) if kind == "interval-type-2" else (VALUE,)
    _check_header(table, added)
    columns = _input_columns(table, system, blanks=blanks is not None)
    X = _readings(table, columns, blanks=blanks is not None)
    _check_plausible(X, table, system, plausible, unit)
    answers = np.empty((len(X), len(added)))
    notes = [] if blanks is None else _on_blanks(X, table, system, blanks)
    for group in _groups(X, table, system, blanks):
        part = table._replace(lines=[table.lines[row] for row in group.rows])
        try:
            inferred = infer(group.system, group.X, kind, options, unit)
        except ValueError as error:
            raise TableError(f"{table.file}: {_with_lines(str(error), part, system)}") from error
        answers[group.rows] = _columns(inferred)
        notes += [_with_lines(note, part, system) for note in inferred.notes]
    point = "," if decimal_commas(table, columns) else "."
    texts = ([repr(x).replace(".", point) for x in row] for row in answers.tolist())
    rows = (cells + answer for cells, answer in zip(table.rows, texts, strict=True))
    write_table(csv_out, [*table.header, *added], rows, table.delimiter)
    return tuple(dict.fromkeys(notes))


def _on_blanks(X: Array, table: Table, system: FuzzySystem, blanks: Blanks) -> list[str]:
    notes = []
    for i, variable in enumerate(system.inputs):
        rows = np.flatnonzero(np.isnan(X[:, i]))
        if rows.size:
            more = f" and {rows.size - 1} more" if rows.size > 1 else ""
            line = table.lines[rows[0]]
            notes.append(f"{variable.name}: no reading (line {line}{more}); {blanks.note}")
    return notes


def _groups(X: Array, table: Table, system: FuzzySystem, blanks: Blanks | None) -> Iterator[_Group]:
    """The rows grouped by system, without blanks."""
    if blanks is None or not np.isnan(X).any():
        yield _Group(system, list(range(len(X))), X)
        return
    known = ~np.isnan(X)
    systems: dict[tuple[bool, ...], FuzzySystem] = {}
    rows: dict[FuzzySystem, list[int]] = {}
    for row, mask in enumerate(map(tuple, known.tolist())):
        if mask not in systems:
            names = (one.name for one, has in zip(system.inputs, mask, strict=True) if has)
            try:
                systems[mask] = blanks.system(tuple(names))
            except ValueError as error:
                raise table.fault(table.lines[row], str(error)) from error
        rows.setdefault(systems[mask], []).append(row)
    filled = np.where(known, X, blanks.value)
    for one, places in rows.items():
        yield _Group(one, places, filled[places])


def _check_plausible(
    X: Array, table: Table, system: FuzzySystem, plausible: tuple[float, float], unit: str
) -> None:
    low, high = plausible
    beyond = np.argwhere((low > X) | (high < X))
    if beyond.size:
        row, i = beyond[0]
        raise table.fault(
            table.lines[row],
            f"{system.inputs[i].name}: {X[row, i]:g} cannot be; give {low:g} to {high:g} {unit}",
        )


def read_readings(path: Path, system: FuzzySystem, *, blanks: bool = False) -> Array:
    """The readings of a table, shape (rows, inputs), in the order of the system's inputs.

    With `blanks`, NaN where there is none.
    """
    table = read_table(path)
    return _readings(table, _input_columns(table, system, blanks=blanks), blanks=blanks)


def _check_header(table: Table, added: Sequence[str]) -> None:
    names = [name.strip() for name in table.header]
    for name in names:
        if name and names.count(name) > 1:
            raise table.fault(
                table.header_line, f"column {name!r} appears twice; rename or remove one"
            )
        if name in added:
            raise table.fault(
                table.header_line, f"there is a column {name!r} already; rename or remove it"
            )


def _readings(table: Table, columns: list[int], *, blanks: bool) -> Array:
    """The columns as numbers, shape (rows, inputs); NaN where blank, if allowed."""
    names = [name.strip() for name in table.header]
    commas = decimal_commas(table, columns)
    return np.array(
        [
            [
                math.nan
                if blanks and not cells[column].strip()
                else number(cells[column], table, line, names[column], commas=commas)
                for column in columns
            ]
            for cells, line in zip(table.rows, table.lines, strict=True)
        ]
    )


def _input_columns(table: Table, system: FuzzySystem, *, blanks: bool) -> list[int]:
    names = [name.strip() for name in table.header]
    inputs = [variable.name for variable in system.inputs]
    add = "add it, with blank cells where there is no reading" if blanks else "add it"
    return [_column(name, names, inputs, table, add) for name in inputs]


def _column(name: str, names: list[str], inputs: list[str], table: Table, add: str) -> int:
    if name.strip() in names:
        return names.index(name.strip())
    # Never another input's column: two diseases may have names alike.
    folded = {present.casefold(): present for present in names if present not in inputs}
    longer = [one for one in folded if re.match(rf"{re.escape(name.casefold())}[\W_]", one)]
    closest = longer or difflib.get_close_matches(name.casefold(), folded, 1)  # "hcv [kPa]"
    hint = f"; did you mean {folded[closest[0]]!r}? Rename it" if closest else f"; {add}"
    present = ", ".join(repr(one) for one in names)
    raise table.fault(table.header_line, f"no column {name!r} among {present}{hint}")


def _with_lines(message: str, table: Table, system: FuzzySystem) -> str:
    """The message with the line of the file where it names a row."""
    # Names are matched too, and left alone, for one may itself look like the number of a row.
    names = [re.escape(variable.name) for variable in (*system.inputs, system.output)]
    pattern = "|".join([*sorted(names, key=len, reverse=True), _ROW])

    def line(found: re.Match[str]) -> str:
        return found[0] if found[1] is None else f"(line {table.lines[int(found[1]) - 1]}"

    return re.sub(pattern, line, message)


def _columns(inferred: Inferred) -> Array:
    value = inferred.value[:, None]
    return value if inferred.interval is None else np.hstack([value, inferred.interval])
