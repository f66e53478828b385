"""The committed tables: lines by the names of their columns."""

import csv
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TypeVar

ROOT = Path(__file__).parents[2]

Line = dict[str, str]
Key = TypeVar("Key")


def read(path: str) -> list[Line]:
    """Lines of a table by the names of its columns; a path from the root."""
    with (ROOT / path).open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def measured(name: str) -> list[Line]:
    """A table that a benchmark of this study wrote."""
    return read(f"reports/data/{name}.csv")


def column(lines: Iterable[Line], name: str) -> list[float]:
    """The numbers of a column."""
    return [float(line[name]) for line in lines]


def ratios(lines: Iterable[Line], name: str, over: str) -> list[float]:
    """One column over another, line by line."""
    return [float(line[name]) / float(line[over]) for line in lines]


def grouped(lines: Iterable[Line], key: Callable[[Line], Key]) -> dict[Key, list[Line]]:
    """The lines by a key, groups in the order of their first lines."""
    groups: dict[Key, list[Line]] = {}
    for line in lines:
        groups.setdefault(key(line), []).append(line)
    return groups


def machine_and_load(lines: list[Line]) -> str:
    """The machine on which a table was measured, and the largest load of it meanwhile."""
    (machine,) = {line["machine"].partition(",")[0] for line in lines}
    return f"{machine}, load {max(column(lines, 'load')):.1f}"
