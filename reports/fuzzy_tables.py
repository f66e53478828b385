"""Tables of the fuzzy systems: where their sets come from, and what moves their estimates."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from operator import attrgetter

from reports.appearance import system_name
from reports.digits import DASH, PA_PER_KPA, Group, Table, fixed, percent, words
from study.results.folder import Results
from study.results.records import StiffnessSet
from study.results.tables import SensitivityEntry

SYSTEM = "system"
SOURCED_MARKS = {"yes": "", "partly": " †", "weak": " ‡", "no": " §"}
"""After the name of a set; the template's caption says what each mark means."""
CHOICE_NAMES = {
    "knowledge": "knowledge base",
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


def between_systems(found: Iterable[SensitivityEntry]) -> tuple[float, float] | None:
    """Smallest and largest rms difference [Pa] between two systems."""
    values = [entry.rms_change_pa for entry in found if entry.choice == SYSTEM]
    return (min(values), max(values)) if values else None


def choice_name(choice: str) -> str:
    """Name of a choice in a table or figure."""
    return CHOICE_NAMES.get(choice, choice)


def heading(entry: SensitivityEntry) -> str:
    """Name of a choice and the base value that its alternatives replace."""
    return words(f"{choice_name(entry.choice)}: {entry.base} →")


def within_systems(found: Iterable[SensitivityEntry]) -> list[SensitivityEntry]:
    """Entries of the choices that are made within a system."""
    return [entry for entry in found if entry.choice != SYSTEM]


def sensitivity_table(results: Results) -> dict[str, object] | None:
    """Sensitivity of the estimates [kPa] to each choice as grouped rows, or None without any.

    `systems`: names of the columns' groups; `groups`: name of the choice and its rows, each the
    alternative, per system the change at the readings, rms and largest, and the count of readings.
    """
    found = within_systems(results.sensitivity)
    if not found:
        return None
    systems = list(dict.fromkeys(entry.system for entry in found))
    groups: list[Group] = [
        {"name": name, "rows": list(_alternative_rows(members, systems))}
        for name, members in groupby(found, heading)
    ]
    return {
        "systems": [system_name(system) for system in systems],
        "groups": groups,
        "between": [_system_row(e) for e in results.sensitivity if e.choice == SYSTEM],
    }


def _alternative_rows(
    members: Iterable[SensitivityEntry], systems: list[str]
) -> Iterator[list[str]]:
    for alternative, group in groupby(members, attrgetter("alternative")):
        found = {entry.system: entry for entry in group}
        cells = [cell for system in systems for cell in _cells(found.get(system))]
        yield [words(alternative), *cells, fixed(next(iter(found.values())).readings, 0)]


def _cells(entry: SensitivityEntry | None) -> list[str]:
    if entry is None:
        return [DASH] * 3
    changes = (entry.change_at_readings_pa, entry.rms_change_pa, entry.largest_change_pa)
    return [_kilo(change) for change in changes]


def _kilo(value: float) -> str:
    return fixed(value / PA_PER_KPA, 2)


def _system_row(entry: SensitivityEntry) -> list[str]:
    pair = f"{system_name(entry.base)} → {system_name(entry.alternative)}"
    return [pair, *_cells(entry), fixed(entry.readings, 0)]


def sensitivity_sentences(results: Results) -> list[str]:
    """Which choices move the estimate more than the choice of system does."""
    span = between_systems(results.sensitivity)
    if span is None:
        return []
    low, high = (_kilo(value) for value in span)
    others = sorted(within_systems(results.sensitivity), key=lambda entry: -entry.rms_change_pa)
    above = [entry for entry in others if entry.rms_change_pa > span[1]]
    lesser = {entry.choice for entry in others if entry.rms_change_pa > span[0]}
    lesser -= {entry.choice for entry in above}
    first = (
        f"Open choices: two systems differ by {low} to {high} kPa (rms over a spread of readings)."
    )
    return [" ".join([first, *_movers(above), *_lesser(lesser)])]


def _movers(above: Sequence[SensitivityEntry]) -> Iterator[str]:
    """The largest of each choice, of entries in falling order."""
    if not above:
        yield "No choice within a system moves its estimate further."
        return
    largest: dict[str, SensitivityEntry] = {}
    for entry in above:
        largest.setdefault(entry.choice, entry)
    parts = [
        words(f"{heading(entry)} {entry.alternative} ({system_name(entry.system)} ")
        + f"by {_kilo(entry.rms_change_pa)} kPa)"
        for entry in largest.values()
    ]
    yield f"Further than that move an estimate: {'; '.join(parts)}."


def _lesser(choices: set[str]) -> Iterator[str]:
    names = [choice_name(choice) for choice in CHOICE_NAMES if choice in choices]
    if names:
        yield f"Between the two lie: {', '.join(names)}."


def set_rows(results: Results) -> Table:
    """Stiffness sets: variable, centre, placement, spread and its kind, footprint, n and source.

    The set's name bears a mark unless centre and spread are published for it. Variables whose sets
    are the same share their rows.
    """
    alike: dict[tuple[str, ...], list[str]] = {}
    for name, *rest in map(_set_row, results.record.fuzzy.stiffness_sets):
        alike.setdefault(tuple(rest), []).append(name)
    return [[", ".join(dict.fromkeys(names)), *rest] for rest, names in alike.items()]


def _set_row(one: StiffnessSet) -> list[str]:
    return [
        words(one.aetiology),
        f"{one.stage}{SOURCED_MARKS.get(one.sourced, ' §')}",
        fixed(one.centre, 1),
        words(one.placement),
        fixed(one.within_stage_sd, 1),
        words(one.sd_kind),
        percent(one.between_study),
        percent(one.between_operator),
        DASH if one.n is None else fixed(one.n, 0),
        words(one.centre_source),
    ]


def unsourced_count(results: Results) -> tuple[int, int]:
    """Sets in use whose centre or spread is not published for them, and all sets."""
    sets = results.record.fuzzy.stiffness_sets
    return sum(one.sourced != "yes" for one in sets), len(sets)
