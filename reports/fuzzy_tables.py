"""Tables of the fuzzy systems: where their sets come from, and what moves their estimates."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from itertools import groupby
from typing import Any, NamedTuple

from reports.appearance import system_name
from reports.digits import DASH, PA_PER_KPA, Table, fixed, percent, words
from study.results.folder import Results

SYSTEM = "system"
SOURCED_MARKS = {"yes": "", "partly": " †", "weak": " ‡", "no": " §"}
"""After the name of a set; the template's caption says what each mark means."""
CHOICE_NAMES = {
    "reading": "reading of Table I",
    "consequent": "consequent of mixed stages",
    "placement": "centres of the sets",
    "absent": "aetiology without a reading",
    "footprint": "kind of footprint",
    "footprint_factor": "size of footprint",
    "reducer": "type reducer",
    "sugeno_aggregation": "Sugeno's weights",
    "sampling": "integration",
    "samples": "points on the output",
    SYSTEM: "fuzzy system",
}


class Change(NamedTuple):
    """A row of the table `sensitivity`: one choice changed, for one system, in Pa.

    `base_width` and `width`, the mean width of the interval before and after, are NaN but for
    type-2.
    """

    choice: str
    base: str
    alternative: str
    system: str
    at_readings: float
    rms: float
    largest: float
    rows: float
    base_width: float = math.nan
    width: float = math.nan


def changes(results: Results) -> list[Change]:
    """Every row of the sensitivity table, in order; none where it was not computed."""
    rows: list[Any] = results.tables.get("sensitivity", [])
    return [Change(*row) for row in rows]


def between_systems(found: list[Change]) -> tuple[float, float] | None:
    """Smallest and largest rms difference [Pa] between two systems."""
    values = [change.rms for change in found if change.choice == SYSTEM]
    return (min(values), max(values)) if values else None


def choice_name(choice: str) -> str:
    """Name of a choice in a table or figure."""
    return CHOICE_NAMES.get(choice, choice)


def heading(change: Change) -> str:
    """Name of a choice and the base value that its alternatives replace."""
    return words(f"{choice_name(change.choice)}: {change.base} →")


def sensitivity_systems(results: Results) -> list[str]:
    """Systems that have a column of their own in the sensitivity table, in order."""
    found = (change.system for change in changes(results) if change.choice != SYSTEM)
    return list(dict.fromkeys(found))


def sensitivity_table(results: Results) -> dict[str, Any] | None:
    """Grouped rows [kPa], or None: per system the change at the readings, rms and largest.

    `systems`: names of the columns' groups; `groups`: name of the choice and its rows, each the
    alternative, three cells per system, the width of the type-2 interval where that is known, and
    the number of rows.
    """
    found = [change for change in changes(results) if change.choice != SYSTEM]
    if not found:
        return None
    systems = sensitivity_systems(results)
    has_widths = any(math.isfinite(change.width) for change in found)
    groups = [
        {"name": name, "rows": list(_alternative_rows(members, systems, has_widths))}
        for name, members in groupby(found, heading)
    ]
    return {
        "systems": [system_name(system) for system in systems],
        "groups": groups,
        "between": [_system_row(c) for c in changes(results) if c.choice == SYSTEM],
        "has_widths": has_widths,
    }


def _alternative_rows(
    members: Iterable[Change], systems: list[str], has_widths: bool
) -> Iterator[list[str]]:
    for alternative, group in groupby(members, lambda change: change.alternative):
        found = {change.system: change for change in group}
        cells = [cell for system in systems for cell in _cells(found.get(system))]
        widths = [_width(change) for change in found.values() if math.isfinite(change.width)]
        count = fixed(next(iter(found.values())).rows, 0)
        yield [words(alternative), *cells, *((widths or [DASH]) if has_widths else []), count]


def _cells(change: Change | None) -> list[str]:
    if change is None:
        return [DASH] * 3
    return [_kilo(value) for value in (change.at_readings, change.rms, change.largest)]


def _kilo(value: float) -> str:
    return fixed(value / PA_PER_KPA, 2)


def _width(change: Change) -> str:
    return f"{fixed(change.base_width / PA_PER_KPA, 1)} → {fixed(change.width / PA_PER_KPA, 1)}"


def _system_row(change: Change) -> list[str]:
    pair = f"{system_name(change.base)} → {system_name(change.alternative)}"
    return [pair, *_cells(change), fixed(change.rows, 0)]


def sensitivity_sentences(results: Results) -> list[str]:
    """Which choices move the estimate more than the choice of system does."""
    found = changes(results)
    span = between_systems(found)
    if span is None:
        return []
    low, high = (_kilo(value) for value in span)
    others = [change for change in found if change.choice != SYSTEM]
    above = sorted((c for c in others if c.rms > span[1]), key=lambda c: -c.rms)
    lesser = {c.choice for c in others if c.rms > span[0]} - {c.choice for c in above}
    first = (
        f"Open choices: two systems differ by {low} to {high} kPa (rms over a spread of readings)."
    )
    return [" ".join([first, *_movers(above), *_lesser(lesser)])]


def _movers(above: list[Change]) -> Iterator[str]:
    if not above:
        yield "No choice within a system moves its estimate further."
        return
    largest = {change.choice: change for change in reversed(above)}
    parts = [
        words(f"{heading(change)} {change.alternative} ({system_name(change.system)} ")
        + f"by {_kilo(change.rms)} kPa)"
        for change in sorted(largest.values(), key=lambda change: -change.rms)
    ]
    yield f"Further than that move an estimate: {'; '.join(parts)}."


def _lesser(choices: set[str]) -> Iterator[str]:
    names = [choice_name(choice) for choice in CHOICE_NAMES if choice in choices]
    if names:
        yield f"Between the two lie: {', '.join(names)}."


def set_rows(results: Results) -> Table:
    """Variable, set, centre, placement, spread and its kind, footprint's parts, n and source.

    The set's name bears a mark unless centre and spread are published for it.
    """
    return [_set_row(record) for record in results.numbers.get("stiffness_sets", [])]


def _set_row(record: dict[str, Any]) -> list[str]:
    n = record.get("n")
    return [
        words(str(record["aetiology"])),
        f"{record['stage']}{SOURCED_MARKS.get(record['sourced'], ' §')}",
        fixed(record["centre"], 1),
        words(str(record["placement"])),
        fixed(record["within_stage_sd"], 1),
        words(str(record["sd_kind"])),
        percent(record["between_study"]),
        percent(record["between_operator"]),
        DASH if n is None else fixed(n, 0),
        words(str(record["centre_source"])),
    ]


def unsourced_count(results: Results) -> tuple[int, int]:
    """Sets in use whose centre or spread is not published for them, and all sets."""
    records = results.numbers.get("stiffness_sets", [])
    return sum(record["sourced"] != "yes" for record in records), len(records)
