"""Models beside measurements, as the table that comes with the program has it.

`liver-study validate --out` writes such a table; none of the figures is of the run reported.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib.resources.abc import Traversable
from statistics import median
from typing import NamedTuple

from reports.benchmarks import Line, read
from reports.digits import DASH, Group, Table, fixed, percent, significant, words

NAME = "validation"
CYLINDERS, CANTILEVER, CUBE = "cylinders", "cantilever", "cube"
ROUNDING = 1e-9
"""An own error that is only this, relative."""
ONE_AXIS = "rms residual along"
"""How quantities begin that the table has of each axis beside the whole."""
AGREES = "agrees"
SHORT = {
    "frequency of free vibration": "free vibration",
    "tip deflection, mean of markers": "tip",
    "rms error of the markers": "markers",
    "rms residual of the beads": "beads",
}
"""Names of quantities in the table of bodies, whose caption says what they mean."""


class Median(NamedTuple):
    """Of many cases: median, least and largest relative difference, and how many agree.

    `uncertainty` and `own`: medians of the measurement's and of the model's numerical error,
    relative. Only the `answered` of all `cases` count.
    """

    difference: float
    least: float
    largest: float
    uncertainty: float
    own: float | None
    agreeing: int
    answered: int
    cases: int


def validation() -> dict[str, object] | None:
    """Tables by name; None where no table was delivered."""
    lines = read(NAME)
    if not lines:
        return None
    return {
        "cylinders": cylinder_rows(lines),
        "bodies": [
            {"name": words(f"{problem}, {faces}"), "rows": rows}
            for problem in (CANTILEVER, CUBE)
            for faces, rows in _by_faces(lines, problem)
        ],
        "agreeing": _agreeing(lines),
        "unresolved": sum(line["verdict"] == "not resolved" for line in lines),
    }


def cylinder_rows(lines: list[Line]) -> list[Group]:
    """By what the plates do: model, quantity, median and range, uncertainty, error, agreeing."""
    groups: list[Group] = []
    for faces in _faces(lines, CYLINDERS):
        rows: Table = []
        before = ""
        for (model, quantity), own in of_cylinders(lines, faces).items():
            found = summed(own)
            cells = [model if model != before else "", quantity]
            rows.append([*cells, *_median_cells(found)] if found else [*cells, *_none(own)])
            before = model
        groups.append({"name": f"faces {faces}", "rows": rows})
    return groups


def of_cylinders(lines: list[Line], faces: str) -> dict[tuple[str, str], list[Line]]:
    """Lines of all materials by model and quantity."""
    found: dict[tuple[str, str], list[Line]] = {}
    for line in lines:
        if (line["problem"], line["faces"]) == (CYLINDERS, faces):
            found.setdefault((line["model"], line["quantity"]), []).append(line)
    return found


def summed(lines: list[Line]) -> Median | None:
    """The median of lines of one quantity; None if no line has an answer."""
    answered = [line for line in lines if line["found"]]
    if not answered:
        return None
    off = [_number(line, "found") / _number(line, "measured") - 1.0 for line in answered]
    spread = [_number(line, "uncertainty") / _number(line, "measured") for line in answered]
    own = [
        _number(line, "numerical") / _number(line, "measured")
        for line in answered
        if line["numerical"]
    ]
    agreeing = sum(line["verdict"] == AGREES for line in answered)
    return Median(
        median(off),
        min(off),
        max(off),
        median(spread),
        median(own) if own else None,
        agreeing,
        len(answered),
        len(lines),
    )


def of_body(lines: list[Line], problem: str, quantity: str) -> list[Line]:
    """Lines of a quantity of one body."""
    return [line for line in lines if (line["problem"], line["quantity"]) == (problem, quantity)]


def _median_cells(found: Median) -> list[str]:
    answered = f"{found.agreeing} of {found.answered}"
    lacking = found.cases - found.answered
    return [
        _signed(found.difference),
        f"{_signed(found.least)} to {_signed(found.largest)}",
        percent(found.uncertainty),
        DASH if found.own is None else percent(found.own if found.own > ROUNDING else 0.0),
        answered + (f", {lacking} without a result" if lacking else ""),
    ]


def _none(lines: list[Line]) -> list[str]:
    return [words(lines[0]["note"]), DASH, DASH, DASH, "no result"]


def _by_faces(lines: list[Line], problem: str) -> Iterator[tuple[str, Table]]:
    for faces in _faces(lines, problem):
        own = [line for line in lines if (line["problem"], line["faces"]) == (problem, faces)]
        yield faces, [_body_row(x) for x in own if not x["quantity"].startswith(ONE_AXIS)]


def _body_row(line: Line) -> list[str]:
    """Model, case, quantity, measured, model, difference, uncertainty, own error, verdict."""
    found, measured = line["found"], _number(line, "measured")
    off = DASH
    if found:
        gap = _number(line, "found") - measured
        off = f"{_sign(gap)}{fixed(abs(gap), 2)}"
    return [
        line["model"],
        line["case"],
        words(f"{SHORT.get(line['quantity'], line['quantity'])} [{line['unit']}]"),
        significant(measured, 3) if measured else "0",
        significant(float(found), 3) if found else DASH,
        off,
        significant(_number(line, "uncertainty"), 2),
        significant(float(line["numerical"]), 2) if line["numerical"] else DASH,
        line["verdict"] or DASH if found else words(line["note"]),
    ]


def _faces(lines: list[Line], problem: str) -> list[str]:
    return list(dict.fromkeys(line["faces"] for line in lines if line["problem"] == problem))


def _agreeing(lines: list[Line]) -> str:
    predicted = [line for line in lines if line["verdict"] not in {"", "fitted"}]
    return f"{sum(line['verdict'] == AGREES for line in predicted)} of {len(predicted)}"


def _signed(share: float) -> str:
    return f"{_sign(share)}{fixed(abs(100.0 * share), 1)} %"


def _sign(value: float) -> str:
    """The printed sign of a difference."""
    return "−" if value < 0.0 else "+"


def _number(line: Line, column: str) -> float:
    return float(line[column])


def table(folder: Traversable | None = None) -> list[Line]:
    """The table that comes with the program, or that of a folder."""
    return read(NAME, folder)
