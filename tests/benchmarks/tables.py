"""Tables of named tuples as CSV files, read back by the types of the fields."""

from __future__ import annotations

import csv
import sys
from collections.abc import Callable, Hashable, Iterable, Mapping
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, NamedTuple, TypeVar, get_type_hints

R = TypeVar("R", bound=NamedTuple)
K = TypeVar("K", bound=Hashable)


def read(path: Path, row: type[R]) -> list[R]:
    """Rows of a table as written; none without it.

    Their fields are of type str, int, float or bool, or of one that may be None, if empty.
    """
    if not path.exists():
        return []
    kinds = get_type_hints(row)
    with path.open(newline="", encoding="utf-8") as file:
        return [
            row(**{name: _value(kinds[name], text) for name, text in line.items()})
            for line in csv.DictReader(file)
        ]


def _value(kind: Any, text: str) -> Any:
    if isinstance(kind, UnionType):
        (kind,) = set(kind.__args__) - {NoneType}
        if not text:
            return None
    return text == "True" if kind is bool else kind(text)


def write(path: Path, rows: Iterable[R], digits: int = 4) -> list[R]:
    """Write rows as they come, floats to so many digits, and return them."""
    written: list[R] = []
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        for one in rows:
            if not written:
                table.writerow(one._fields)
            table.writerow(cells(one, digits))
            file.flush()
            written.append(one)
    return written


def cells(row: NamedTuple, digits: int = 4) -> list[object]:
    """Values of a row as a table shows them."""
    return [f"{value:.{digits}g}" if isinstance(value, float) else value for value in row]


def complete(
    path: Path,
    row: type[R],
    tasks: Mapping[K, Callable[[], Iterable[R]]],
    key: Callable[[R], K],
) -> list[R]:
    """Compute the rows of every task that a table lacks, and write it after each.

    A benchmark that was stopped resumes with the first task that is missing.
    """
    found = read(path, row)
    for name, compute in tasks.items():
        if name not in {key(one) for one in found}:
            found = write(path, [*found, *compute()])
            sys.stdout.write(f"{name}\n")
            sys.stdout.flush()
    return found
