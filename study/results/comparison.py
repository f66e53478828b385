"""Differences between two results folders, for `compare`: numbers, rows, arrays, scene, provenance.

Wall times are omitted, since they vary from run to run.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from study.results.arrays import Arrays
from study.results.results import Results
from study.results.tables import TABLES, TableFile
from study.scene.file import resolved

Floats = NDArray[np.float64]
Flat = dict[str, object]
Series = dict[str, dict[str, float]]
"""Numbers by the name of their series and their place in it."""

WALL = "wall_s"
ONLY = "only in the {}"
WORDS = (
    *("schema_version", "provenance", "title", "assumptions", "notes", "warnings"),
    *("stages", "workers"),
)
"""Entries of results.json that are compared elsewhere, or that are no numbers of the study."""


@dataclass(frozen=True, kw_only=True)
class Difference:
    """The difference of a quantity in two folders.

    `largest`: absolute, in the quantity's unit; `relative`: to the largest absolute value of its
    series, infinite where a number exists in one folder only; `where`: place of the largest
    relative one; `count` of `total` numbers that differ at all.
    """

    quantity: str
    largest: float
    relative: float
    where: str
    count: int
    total: int


def differences(first: Results, second: Results) -> list[Difference]:
    """Quantities that differ, by table and column, array and number of results.json.

    A series is a model's curve at a control point, an array, or otherwise a single number.
    """
    found = [
        *chain.from_iterable(_rows(table, first, second) for table in TABLES),
        *_arrays("fields.npz", first.fields, second.fields),
        *_arrays("fuzzy.npz", first.fuzzy, second.fuzzy),
        *_record(first, second),
    ]
    return [one for one in found if one.count]


def other_words(first: Results, second: Results) -> list[str]:
    """Lines on differences in the scene and in the provenance of the results."""
    scenes = [_flat(resolved(one.scene)) for one in (first, second)]
    origins = [_flat(asdict(one.record.provenance)) for one in (first, second)]
    return [*_changes("scene", *scenes), *_changes("made by", *origins)]


# --- series --------------------------------------------------------------------------------------


def _rows(table: TableFile, first: Results, second: Results) -> Iterator[Difference]:
    """Columns of a table; the samples of a curve make one series."""
    pair = (getattr(results, table.attribute) for results in (first, second))
    one, other = (_columns(rows, table.keys) for rows in pair)
    for column in dict.fromkeys([*one, *other]):
        yield _compared(f"{table.file} {column}", one.get(column, {}), other.get(column, {}))


def _columns(rows: Sequence[Any], keys: int) -> dict[str, Series]:
    """Numbers by column, series and, of a curve, sample."""
    columns: dict[str, Series] = {}
    for row in rows:
        series = " ".join(map(str, row[:keys]))
        for name, value in zip(row._fields[keys:], row[keys:], strict=True):
            place = columns.setdefault(name, {}).setdefault(series, {})
            if value is not None:
                place[f"sample {len(place) + 1}"] = float(value)
    return columns


def _compared(quantity: str, first: Series, second: Series) -> Difference:
    """The largest difference over all series of a quantity."""
    apart: list[tuple[float, float, str]] = []
    total = 0
    for name in dict.fromkeys([*first, *second]):
        one, other = first.get(name, {}), second.get(name, {})
        scale = max(map(abs, [*one.values(), *other.values()]), default=0.0)
        total += len(one.keys() | other.keys())
        apart += _apart(name, one, other, scale)
    largest = max((one for one, _, _ in apart), default=0.0)
    _, relative, where = max(apart, key=lambda one: one[1], default=(0.0, 0.0, ""))
    return Difference(
        quantity=quantity,
        largest=largest,
        relative=relative,
        where=where,
        count=len(apart),
        total=total,
    )


def _apart(
    name: str, one: Mapping[str, float], other: Mapping[str, float], scale: float
) -> Iterator[tuple[float, float, str]]:
    """Absolute and relative difference, and where, of the numbers of a series that differ."""
    single = len(one.keys() | other.keys()) == 1
    for place in dict.fromkeys([*one, *other]):
        where = name if single else f"{name}, {place}"
        if place not in one or place not in other:
            yield (
                math.inf,
                math.inf,
                f"{where}, {ONLY.format('second' if place in other else 'first')}",
            )
        elif one[place] != other[place]:
            gap = abs(one[place] - other[place])
            yield gap, gap / scale, where


# --- arrays --------------------------------------------------------------------------------------


def _arrays(file: str, first: Arrays, second: Arrays) -> Iterator[Difference]:
    for name in dict.fromkeys([*first, *second]):
        yield _array(f"{file} {name}", first.get(name), second.get(name))


def _array(
    quantity: str, first: NDArray[np.generic] | None, second: NDArray[np.generic] | None
) -> Difference:
    """Texts are equal or not; numbers differ relative to the largest; NaN equals NaN."""
    total = max(0 if array is None else array.size for array in (first, second))
    if first is None or second is None or first.shape != second.shape:
        return _whole(quantity, total, _how(first, second))
    differ = first != second
    if first.dtype.kind == "U" or second.dtype.kind == "U":
        return _whole(quantity, int(differ.sum()), "texts") if differ.any() else _same(quantity)
    one, other = (array.astype(np.float64) for array in (first, second))
    gaps = np.where(np.isnan(one) & np.isnan(other), 0.0, np.abs(one - other))
    if np.isnan(gaps).any():
        return _whole(quantity, int((gaps != 0.0).sum()), "NaN in one of them")
    largest = float(gaps.max(initial=0.0))
    scale = max(float(np.nanmax(np.abs(array), initial=0.0)) for array in (one, other))
    return Difference(
        quantity=quantity,
        largest=largest,
        relative=largest / scale if largest else 0.0,
        where=f"index {_index(gaps)}" if gaps.ndim else "",
        count=int((gaps != 0.0).sum()),
        total=total,
    )


def _index(gaps: Floats) -> str:
    found = np.unravel_index(int(gaps.argmax()), gaps.shape) if gaps.size else ()
    return ", ".join(str(int(i)) for i in found)


def _how(first: NDArray[np.generic] | None, second: NDArray[np.generic] | None) -> str:
    if first is None or second is None:
        return ONLY.format("second" if first is None else "first")
    return f"shapes {first.shape} and {second.shape}"


def _whole(quantity: str, count: int, where: str) -> Difference:
    """A difference that no tolerance covers."""
    return Difference(
        quantity=quantity,
        largest=math.inf,
        relative=math.inf,
        where=where,
        count=max(1, count),
        total=max(1, count),
    )


def _same(quantity: str) -> Difference:
    return Difference(quantity=quantity, largest=0.0, relative=0.0, where="", count=0, total=0)


# --- results.json --------------------------------------------------------------------------------


def _record(first: Results, second: Results) -> Iterator[Difference]:
    """Numbers and texts of the record but for wall times, models by their names."""
    one, other = _numbers(first), _numbers(second)
    for key in dict.fromkeys([*one, *other]):
        pair = one.get(key), other.get(key)
        if pair[0] == pair[1]:
            continue
        quantity = f"results.json {key}"
        if all(isinstance(value, int | float) for value in pair):
            a, b = ({"": float(str(value))} for value in pair)
            yield _compared(quantity, {"": a}, {"": b})
        else:
            yield _whole(quantity, 1, f"{pair[0]} and {pair[1]}")


def _numbers(results: Results) -> Flat:
    plain = asdict(results.record)
    plain["models"] = {model["name"]: model for model in plain["models"]}
    compared = {key: value for key, value in plain.items() if key not in WORDS}
    return {key: value for key, value in _flat(compared).items() if not key.endswith(WALL)}


def _flat(table: object, before: str = "") -> Flat:
    """Values of nested tables and lists by their dotted keys."""
    if isinstance(table, dict):
        members: Iterable[tuple[object, object]] = table.items()
    elif isinstance(table, list | tuple):
        members = enumerate(table)
    else:
        return {before: table}
    found: Flat = {}
    for key, value in members:
        found |= _flat(value, f"{before}.{key}" if before else str(key))
    return found


def _changes(what: str, first: Flat, second: Flat) -> Iterator[str]:
    for key in dict.fromkeys([*first, *second]):
        if first.get(key) != second.get(key):
            yield f"{what}: {key}: {_shown(first, key)} -> {_shown(second, key)}"


def _shown(table: Flat, key: str) -> str:
    return str(table[key]) if key in table else "none"
