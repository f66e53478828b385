"""Comparisons as tables: a CSV file, JSON, and lines for a terminal.

The CSV has a row per comparison: problem, case, faces, model, quantity, unit; measured and its
standard uncertainty; found and its numerical error, empty where it is not known; modulus_pa, empty
where none matters; fitted, what of the model was fitted to the measurement; verdict of
`Comparison`; note.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from pathlib import Path

import numpy as np

from study.system.folders import write_text
from study.validation.comparison import Comparison

COLUMNS = (
    *("problem", "case", "faces", "model", "quantity", "unit", "measured", "uncertainty"),
    *("found", "numerical", "modulus_pa", "fitted", "verdict", "note"),
)
MANY = 5
"""Number of cases from which the terminal shows their median and range."""
NOTHING = 1e-6
"""A numerical error that is only rounding."""
HEAD = (
    *("model", "quantity", "measured", "model - measured"),
    *("standard uncertainty", "numerical error", ""),
)

Row = tuple[str, ...]


def write(found: Iterable[Comparison], path: Path) -> None:
    """Write one row per comparison, with the columns `COLUMNS`."""
    text = io.StringIO()
    rows = ([_cell(value) for value in _values(one)] for one in found)
    csv.writer(text, lineterminator="\n").writerows([COLUMNS, *rows])
    write_text(path, text.getvalue())


def as_json(found: Sequence[Comparison]) -> str:
    """Comparisons as JSON; an unknown number is null."""
    records = [
        {name: _plain(value) for name, value in zip(COLUMNS, _values(one), strict=True)}
        for one in found
    ]
    return json.dumps({"comparisons": records}, indent=2, allow_nan=False)


def lines(found: Sequence[Comparison]) -> Iterator[str]:
    """A table per problem and condition of the faces, and how many predictions agree."""
    by_faces = groupby(found, key=lambda one: (one.problem, one.faces))
    for (problem, faces), block in ((key, list(group)) for key, group in by_faces):
        yield f"{problem}, {faces} (fitted: {_fitted(block)})"
        cases = {one.case for one in block}
        rows = list(_medians(block)) if len(cases) >= MANY else list(map(_row, block))
        yield from _aligned([HEAD, *rows])
        yield ""
    count = Counter(one.verdict for one in found)
    predictions = count["agrees"] + count["differs"] + count["not resolved"]
    if predictions:
        yield (
            f"{count['agrees']} of {predictions} predictions agree with the measurement within its "
            "expanded uncertainty plus the numerical error"
        )
    elif any(one.answered and not one.calibrated for one in found):
        yield "agreement is not judged: no measurement has a known uncertainty"
    if count["not resolved"]:
        yield (
            f"{count['not resolved']} are not resolved: their numerical error exceeds the "
            "expanded uncertainty"
        )
    if lacking := sum(not one.answered for one in found):
        yield f"{lacking} have no result"


def _fitted(block: list[Comparison]) -> str:
    return "; ".join(dict.fromkeys(one.fitted for one in block if one.fitted)) or "nothing"


def _row(one: Comparison) -> Row:
    quantity = f"{one.case}: {one.quantity} [{one.unit}]"
    if not one.answered:
        return one.model, quantity, "", "", "", "", f"no result: {one.note}"
    measured = f"{one.measured:.3g}" if one.measured else ""
    known = f"{one.uncertainty:.2g}" if math.isfinite(one.uncertainty) else "not given"
    off = "0" if one.calibrated else f"{one.difference:+.3g}"
    return one.model, quantity, measured, off, known, _own(one.numerical), one.verdict or ""


def _medians(block: list[Comparison]) -> Iterator[Row]:
    """Of many cases: median and range of relative differences, and how many agree."""
    groups: dict[tuple[str, str], list[Comparison]] = {}
    for one in block:
        groups.setdefault((one.model, one.quantity), []).append(one)
    for (model, quantity), group in groups.items():
        answered = [one for one in group if one.answered]
        if not answered:
            yield model, quantity, "", "", "", "", f"no result: {group[0].note}"
            continue
        size = np.array([one.measured for one in answered])
        off = 100.0 * np.array([one.difference for one in answered]) / size
        spread = 100.0 * np.array([one.uncertainty for one in answered]) / size
        own = 100.0 * np.array([one.numerical for one in answered]) / size
        measured = f"{size.min():.3g} to {size.max():.3g} {group[0].unit}"
        beside = f"{np.median(off):+.1f} % ({off.min():+.0f} to {off.max():+.0f})"
        known, numerical = f"{np.median(spread):.1f} %", _own(float(np.median(own)), " %")
        yield model, quantity, measured, beside, known, numerical, _counts(answered)


def _counts(found: list[Comparison]) -> str:
    count = Counter(one.verdict for one in found)
    text = f"{count['agrees']} of {len(found)} agree"
    unresolved = count["not resolved"]
    return f"{text}, {unresolved} not resolved" if unresolved else text


def _own(error: float, unit: str = "") -> str:
    if math.isnan(error):
        return ""
    return f"{error:.2g}{unit}" if error > NOTHING else "0"


def _aligned(rows: Sequence[Row]) -> Iterator[str]:
    """Rows with columns as wide as their widest cell; the last one runs on."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)][:-1]
    for *cells, last in rows:
        padded = (f"{cell:<{width}}" for cell, width in zip(cells, widths, strict=True))
        yield "  ".join(["", *padded, last]).rstrip()


def _values(one: Comparison) -> tuple[str | float | bool, ...]:
    numbers = (one.measured, one.uncertainty, one.found, one.numerical, one.modulus)
    words = (one.problem, one.case, one.faces, one.model, one.quantity, one.unit)
    return (*words, *numbers, one.fitted, one.verdict or "", one.note)


def _plain(value: str | float | bool) -> str | float | bool | None:
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _cell(value: str | float | bool) -> str:
    if isinstance(value, float):
        return f"{value:.6g}" if math.isfinite(value) else ""
    return str(value)
