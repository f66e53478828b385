"""Tables of readings: a CSV file in, the same file with the answers of a fuzzy system out."""

import csv
import difflib
import math
import re
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fuzzy.systems.inference import Inferred, infer
from fuzzy.systems.kinds import check_kind
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.sets import Array
from fuzzy.systems.system import FuzzySystem

VALUE = "estimate"
BOUNDS = ("lower", "upper")

_ROW = r"\(row (\d+)(?: of \d+)?"


class TableError(ValueError):
    """A table that cannot be read or written; the message names file, line and remedy."""


class Table(NamedTuple):
    """Cells of a CSV file, and the lines on which the header and each row begin."""

    file: str
    header_line: int
    header: list[str]
    rows: list[list[str]]
    lines: list[int]

    def fault(self, line: int, what: str) -> TableError:
        """The TableError that blames a line of the file."""
        return TableError(f"{self.file}:{line}: {what}")


def evaluate_table(
    system: FuzzySystem,
    csv_in: Path,
    csv_out: Path,
    kind: str,
    options: InferenceOptions | None = None,
    unit: str = "",
    plausible: tuple[float, float] = (-math.inf, math.inf),
) -> tuple[str, ...]:
    """Write the table with the column `estimate`, for type-2 also `lower` and `upper`; its notes.

    Columns are found by the names of the inputs, in their units; all columns are passed on as they
    are, empty lines are left out. An earlier `csv_out` is replaced once everything is computed; it
    may not be `csv_in`. Raises ValueError naming file, line, column and remedy, also for a reading
    outside the `plausible` ones.
    """
    check_kind(system, kind)
    if csv_out.resolve() == csv_in.resolve():
        raise TableError(f"{csv_out}: is the table itself; write the answers to another file")
    table = read_table(csv_in)
    added = (VALUE, *BOUNDS) if kind == "interval-type-2" else (VALUE,)
    _check_header(table, added)
    X = _readings(table, system)
    _check_plausible(X, table, system, plausible, unit)
    try:
        inferred = infer(system, X, kind, options, unit)
    except ValueError as error:
        raise TableError(f"{table.file}: {_with_lines(str(error), table, system)}") from error
    answers = _columns(inferred).tolist()
    rows = (cells + answer for cells, answer in zip(table.rows, answers, strict=True))
    _write(csv_out, [*table.header, *added], rows)
    return tuple(_with_lines(note, table, system) for note in inferred.notes)


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


def read_readings(path: Path, system: FuzzySystem) -> Array:
    """The readings of a table, shape (rows, inputs), in the order of the system's inputs."""
    return _readings(read_table(path), system)


def read_table(path: Path) -> Table:
    """The cells of a CSV file with a header; TableError naming file, line and remedy."""
    lines: list[int] = []
    rows: list[list[str]] = []
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file, strict=True)
            after = 0
            for cells in reader:
                if cells:
                    rows.append(cells)
                    lines.append(after + 1)
                after = reader.line_num
    except OSError as error:
        raise TableError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise TableError(f"{path}: is not UTF-8 text; save it as CSV in UTF-8") from None
    except csv.Error as error:
        raise TableError(f"{path}:{reader.line_num}: {error}; export the table again") from None
    if len(rows) < 2:
        raise TableError(f"{path}: holds no readings; give a header and at least one row")
    table = Table(str(path), lines[0], rows[0], rows[1:], lines[1:])
    _check_widths(table)
    return table


def _check_widths(table: Table) -> None:
    for cells, line in zip(table.rows, table.lines, strict=True):
        if len(cells) != len(table.header):
            raise table.fault(
                line, f"{len(cells)} cells under {len(table.header)} columns; correct the row"
            )


def _check_header(table: Table, added: Sequence[str]) -> None:
    names = [name.strip() for name in table.header]
    for name in names:
        if names.count(name) > 1:
            raise table.fault(
                table.header_line, f"column {name!r} stands there twice; rename or remove one"
            )
        if name in added:
            raise table.fault(
                table.header_line, f"there is a column {name!r} already; rename or remove it"
            )


def _readings(table: Table, system: FuzzySystem) -> Array:
    """The columns of the inputs as numbers, shape (rows, inputs)."""
    names = [name.strip() for name in table.header]
    inputs = [variable.name for variable in system.inputs]
    columns = [_column(name, names, inputs, table) for name in inputs]
    return np.array(
        [
            [_reading(cells[column], table, line, names[column]) for column in columns]
            for cells, line in zip(table.rows, table.lines, strict=True)
        ]
    )


def _column(name: str, names: list[str], inputs: list[str], table: Table) -> int:
    if name in names:
        return names.index(name)
    if len(names) == 1 and ";" in names[0]:
        raise table.fault(
            table.header_line, "columns are parted by semicolons; export with commas and points"
        )
    # Never another input's column: two diseases may have names alike.
    folded = {present.casefold(): present for present in names if present not in inputs}
    closest = difflib.get_close_matches(name.casefold(), folded, 1)
    hint = f"; did you mean {folded[closest[0]]!r}? Rename it" if closest else "; add it"
    present = ", ".join(repr(one) for one in names)
    raise table.fault(table.header_line, f"no column {name!r} among {present}{hint}")


def _reading(cell: str, table: Table, line: int, name: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        what = f"{cell!r} is no number" if cell.strip() else "the cell is empty"
        raise table.fault(line, f"{name}: {what}; give a number or remove the row") from None
    if not math.isfinite(value) or "_" in cell:
        raise table.fault(line, f"{name}: {cell!r} is no finite number; correct it")
    return value


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


def _write(path: Path, header: Sequence[str], rows: Iterable[Sequence[str | float]]) -> None:
    """Write the file aside and move it into place; numbers with all their digits."""
    try:
        with tempfile.TemporaryDirectory(prefix=f".{path.name}.", dir=path.parent) as aside:
            partial = Path(aside) / path.name
            with partial.open("w", newline="", encoding="utf-8") as file:
                writer = csv.writer(file, lineterminator="\n")
                writer.writerow(header)
                writer.writerows(rows)
            partial.replace(path)
    except OSError as error:
        raise TableError(f"{path}: cannot be written ({error.strerror})") from None
