"""Comparisons as tables: a CSV file, JSON, and lines for a terminal.

The CSV has a row per comparison: problem, case, faces, model, quantity, unit; measured and its
standard uncertainty; found and its own numerical error, empty where it is not known; modulus_pa,
empty where none matters; fitted, what of the model was fitted to the measurement; within, whether
the difference is explained by twice the uncertainty, once where it is what noise leaves of many
beads, and the numerical error; note.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from pathlib import Path

import numpy as np

from study.system.folders import write_text
from study.validation.comparison import Comparison

COLUMNS = (
    *("problem", "case", "faces", "model", "quantity", "unit", "measured", "uncertainty"),
    *("found", "numerical", "modulus_pa", "fitted", "within", "note"),
)
MANY = 5
"""Number of cases from which the terminal shows their median and range."""
NOTHING = 1e-6
"""An own error that is only rounding."""
WIDTHS = (26, 33, 22, 16, 9)


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
    """A block per problem and condition of the faces, and what was fitted."""
    yield _aligned(("model", "quantity", "model minus measured", "uncertainty", "own error"))
    by_faces = groupby(found, key=lambda one: (one.problem, one.faces))
    for (problem, faces), block in ((key, list(group)) for key, group in by_faces):
        yield f"{problem}, {faces} (fitted: {_fitted(block)})"
        cases = {one.case for one in block}
        yield from _medians(block) if len(cases) >= MANY else map(_line, block)
    judged = [one for one in found if one.judged]
    within, lacking = sum(one.within for one in judged), sum(not one.answered for one in found)
    yield (
        f"{within} of {len(judged)} differences within twice the measurement's uncertainty and "
        f"the model's own error; {lacking} without an answer"
    )


def _fitted(block: list[Comparison]) -> str:
    return "; ".join(dict.fromkeys(one.fitted for one in block if one.fitted)) or "nothing"


def _line(one: Comparison) -> str:
    quantity = f"{one.case}: {one.quantity} [{one.unit}]"
    if not one.answered:
        return _aligned((f"  {one.model}", quantity, f"none: {one.note}", "", ""))
    beside = f"{one.difference:+.3g}" + (f" of {one.measured:.3g}" if one.measured else "")
    known = f"{one.uncertainty:.2g}" if one.judged else "not given"
    cells = (f"  {one.model}", quantity, beside, known, _own(one.numerical))
    return f"{_aligned(cells)}{'  beyond' if one.judged and not one.within else ''}".rstrip()


def _medians(block: list[Comparison]) -> Iterator[str]:
    """Median and range of the relative differences of many cases, and how many lie within."""
    groups: dict[tuple[str, str], list[Comparison]] = {}
    for one in block:
        groups.setdefault((one.model, one.quantity), []).append(one)
    for (model, quantity), group in groups.items():
        answered = [one for one in group if one.answered]
        if not answered:
            yield _aligned((f"  {model}", quantity, f"none: {group[0].note}", "", ""))
            continue
        size = np.array([one.measured for one in answered])
        off = 100.0 * np.array([one.difference for one in answered]) / size
        spread = 100.0 * np.array([one.uncertainty for one in answered]) / size
        own = 100.0 * np.array([one.numerical for one in answered]) / size
        beside = f"{np.median(off):+.1f} % ({off.min():+.0f} to {off.max():+.0f})"
        cells = (f"  {model}", quantity, beside, f"{np.median(spread):.1f} %")
        within = f"  {sum(one.within for one in answered)} of {len(answered)} within"
        yield f"{_aligned((*cells, _own(float(np.median(own)), ' %')))}{within}"


def _own(error: float, unit: str = "") -> str:
    if math.isnan(error):
        return ""
    return f"{error:.2g}{unit}" if error > NOTHING else "0"


def _values(one: Comparison) -> tuple[str | float | bool, ...]:
    within = one.within if one.judged else ""
    numbers = (one.measured, one.uncertainty, one.found, one.numerical, one.modulus)
    words = (one.problem, one.case, one.faces, one.model, one.quantity, one.unit)
    return (*words, *numbers, one.fitted, within, one.note)


def _plain(value: str | float | bool) -> str | float | bool | None:
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _cell(value: str | float | bool) -> str:
    if isinstance(value, float):
        return f"{value:.6g}" if math.isfinite(value) else ""
    return str(value)


def _aligned(cells: Iterable[str]) -> str:
    return "  ".join(f"{cell:<{width}}" for cell, width in zip(cells, WIDTHS, strict=True)).rstrip()
