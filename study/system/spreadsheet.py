"""CSV files as written by spreadsheets, in any locale.

The delimiter is the one of comma, semicolon and tab that divides the header into most columns, or
that of a first line `sep=;`. Empty lines and unnamed columns at the end, as spreadsheets leave
them, are dropped.
"""

import csv
import io
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from study.system.folders import NO_PLACE, write_text

WORKBOOKS = (b"PK\x03\x04", b"\xd0\xcf\x11\xe0")
"""First bytes of .xlsx and .ods, and of .xls."""
DELIMITERS = ",;\t"
_ANNOUNCED = re.compile(r"sep=([,;\t])\r?\n")


class TableError(ValueError):
    """A table that cannot be read or written; the message names file, line and remedy."""


class Table(NamedTuple):
    """Cells of a CSV file, and the lines on which the header and each row begin."""

    file: str
    header_line: int
    header: list[str]
    rows: list[list[str]]
    lines: list[int]
    delimiter: str = ","

    def fault(self, line: int, what: str) -> TableError:
        """A TableError that names a line of the file."""
        return TableError(f"{self.file}:{line}: {what}")


def read_table(path: Path) -> Table:
    """The cells of a CSV file with a header; TableError naming file, line and remedy."""
    text = _text(path)
    announced = _ANNOUNCED.match(text)
    if announced:
        delimiter, text = announced[1], "\n" + text[announced.end() :]
    else:
        delimiter = max(DELIMITERS, key=lambda one: _header_width(text, one))
    found = list(_filled(path, text, delimiter))
    if len(found) < 2:
        raise TableError(f"{path}: holds no numbers; give a header and at least one row")
    lines, rows = [line for line, _ in found], [cells for _, cells in found]
    width = max(i for i, name in enumerate(rows[0], start=1) if name.strip())
    rows = [_without_blanks(cells, width) for cells in rows]
    table = Table(str(path), lines[0], rows[0], rows[1:], lines[1:], delimiter)
    _check_widths(table)
    return table


def _text(path: Path) -> str:
    try:
        with path.open("rb") as file:
            if file.read(4) in WORKBOOKS:
                raise TableError(f"{path}: is a workbook, not a table; save the sheet as CSV")
        with path.open(newline="", encoding="utf-8-sig") as file:
            return file.read()
    except OSError as error:
        raise TableError(f"{path}: cannot be read ({error.strerror}); give a CSV file") from None
    except UnicodeDecodeError:
        raise TableError(f"{path}: is not UTF-8 text; save it as CSV in UTF-8") from None


def _header_width(text: str, delimiter: str) -> int:
    """Number of cells of the first line with content, by a delimiter."""
    try:
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter)
        return next((len(cells) for cells in reader if any(cells)), 0)
    except csv.Error:  # reported when the table is read
        return 0


def _filled(path: Path, text: str, delimiter: str) -> Iterator[tuple[int, list[str]]]:
    """The rows up to the last with a cell that is not blank, and the lines on which they begin.

    A row of blank cells between others counts as a row; an empty line does not.
    """
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, strict=True)
    after, blank = 0, list[tuple[int, list[str]]]()
    try:
        for cells in reader:
            if any(cell.strip() for cell in cells):
                yield from blank
                blank.clear()
                yield after + 1, cells
            elif len(cells) > 1 and after:
                blank.append((after + 1, cells))
            after = reader.line_num
    except csv.Error as error:
        raise TableError(f"{path}:{reader.line_num}: {error}; export the table again") from None


def _without_blanks(cells: list[str], width: int) -> list[str]:
    """The cells up to a width; all of them if a later one is filled."""
    return cells if any(cell.strip() for cell in cells[width:]) else cells[:width]


def _check_widths(table: Table) -> None:
    for cells, line in zip(table.rows, table.lines, strict=True):
        if len(cells) != len(table.header):
            first = table.header[0].strip()[:40]
            remedy = "remove the comment" if first.startswith("#") else "correct the row"
            raise table.fault(
                line,
                f"{len(cells)} cells under {len(table.header)} columns, from {first!r} in line "
                f"{table.header_line} on; {remedy}",
            )


def decimal_commas(table: Table, columns: Iterable[int]) -> bool:
    """Whether numbers of the columns are written with decimal commas, as between semicolons."""
    return table.delimiter != "," and any("," in row[k] for row in table.rows for k in columns)


def number(cell: str, table: Table, line: int, name: str, *, commas: bool) -> float:
    """The finite number in a cell; TableError naming its line and column for what is none.

    `commas`: whether the numbers of the table have decimal commas.
    """
    if commas and "." in cell:
        raise table.fault(
            line, f"{name}: {cell!r} stands beside decimal commas; write it as the others"
        )
    try:
        value = float(cell.replace(",", ".") if commas else cell)
    except ValueError:
        what = f"{cell!r} is no number" if cell.strip() else "the cell is empty"
        remedy = "give a number or remove the row"
        if re.fullmatch(r"\s*[+-]?\d+,\d+\s*", cell):
            remedy = "write a point, or part columns by semicolons for decimal commas"
        raise table.fault(line, f"{name}: {what}; {remedy}") from None
    if not math.isfinite(value) or "_" in cell:
        raise table.fault(line, f"{name}: {cell!r} is no finite number; correct it")
    return value


def write_table(
    path: Path, header: Sequence[str], rows: Iterable[Sequence[str]], delimiter: str
) -> None:
    """Write the file atomically. TableError if it cannot be written."""
    text = io.StringIO()
    writer = csv.writer(text, delimiter=delimiter, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    try:
        write_text(path, text.getvalue())
    except NO_PLACE as error:
        raise TableError(f"{path}: cannot be written ({error.strerror})") from None
