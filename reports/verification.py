"""Verification and cost of the finite-element reference, as the tables of the program have it."""

from __future__ import annotations

import math
import re
from collections import Counter
from itertools import groupby

from reports.benchmarks import Line, read
from reports.digits import DASH, Group, Table, count, fixed, significant, symbols, words

GROWTH = "growth: "
PARTS = ("mesh", "assembly", "solution")
JUDGED = {"True": "passed", "False": "FAILED"}


def verification() -> dict[str, object] | None:
    """Verification and cost of the finite elements as tables by name.

    None where no table was delivered; one that is missing is left out.
    """
    found: dict[str, object] = {}
    if lines := read("verification"):
        found |= {"problems": problems(lines), "outcomes": outcomes(lines)}
    if lines := read("fem_cost"):
        found |= {"contest": contest(lines), "growth": growth(lines)}
        found["machine"] = words(lines[0]["machine"])
    return found or None


def problems(lines: list[Line]) -> list[Group]:
    """Findings of the verification by problem."""
    return [
        {"name": words(name), "rows": [_finding(line) for line in group]}
        for name, group in groupby(lines, lambda line: line["problem"])
    ]


def outcomes(lines: list[Line]) -> str:
    """How many findings passed, failed or were noted, in words."""
    counts = Counter(_outcome(line) for line in lines)
    return ", ".join(f"{number} {outcome}" for outcome, number in counts.most_common())


def _finding(line: Line) -> list[str]:
    """Quantity, exact value, ours, error, order, limit, outcome."""
    return [
        words(in_symbols(line["quantity"])),
        _number(line["exact"], 5),
        _number(line["ours"], 5),
        _number(line["error"], 2),
        fixed(float(line["order"]), 2) if line["order"] else DASH,
        _number(line["limit"], 2),
        _outcome(line),
    ]


def in_symbols(quantity: str) -> str:
    """A quantity with the symbols that its ASCII stands for: "p2, nu 0.3" as "p2, ν 0.3"."""
    text = symbols(quantity.replace("taylor-hood", "Taylor-Hood").replace("c_s", "cₛ"))
    return re.sub(r"\bomega\b", "ω", re.sub(r"\bnu\b", "ν", text))


def _outcome(line: Line) -> str:
    return JUDGED[line["passed"]] if line["limit"] else "noted"


def contest(lines: list[Line]) -> Table:
    """Cost beside other codes: task, program, version, unknowns, seconds, times that of ours."""
    rows: Table = []
    tasks = groupby(lines, lambda line: line["task"])
    for task, group in ((task, list(group)) for task, group in tasks):
        if not task.startswith(GROWTH):
            ours = float(group[0]["least_s"])
            rows += [_contest_row(line, float(line["least_s"]) / ours) for line in group]
    return rows


def _contest_row(line: Line, times: float) -> list[str]:
    return [
        line["task"],
        line["program"],
        line["version"],
        count(int(line["unknowns"])),
        _number(line["least_s"], 2),
        _number(line["median_s"], 2),
        _number(line["compile_s"], 2),
        significant(times, 2),
    ]


def growth(lines: list[Line]) -> Table:
    """Cost as the mesh is refined: unknowns, seconds of each part of a static job, memory."""
    sizes: dict[str, dict[str, Line]] = {}
    for line in lines:
        if line["task"].startswith(GROWTH):
            sizes.setdefault(line["unknowns"], {})[line["task"].removeprefix(GROWTH)] = line
    return [
        [
            count(int(unknowns)),
            *(_number(found[part]["least_s"], 2) for part in PARTS),
            significant(float(found[PARTS[0]]["peak_mib"]), 2),
        ]
        for unknowns, found in sizes.items()
    ]


def _number(text: str, digits: int) -> str:
    """A number of a table, a dash where there is none."""
    return significant(float(text), digits) if text and math.isfinite(float(text)) else DASH
