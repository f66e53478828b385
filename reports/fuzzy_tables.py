"""Tables of the fuzzy systems: sources of their sets, and sensitivity of their estimates."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from reports.appearance import system_name
from reports.digits import DASH, PA_PER_KPA, Table, fixed, percent, words
from study.results import Results
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


def system_changes(results: Results) -> Table:
    """Differences [kPa] between the estimates of two systems: here, rms and largest."""
    return [_system_row(one) for one in results.sensitivity if one.choice == SYSTEM]


def _kilo(value: float) -> str:
    return fixed(value / PA_PER_KPA, 2)


def _system_row(entry: SensitivityEntry) -> list[str]:
    pair = f"{system_name(entry.base)} → {system_name(entry.alternative)}"
    changes = (entry.change_at_readings_pa, entry.rms_change_pa, entry.largest_change_pa)
    return [pair, *map(_kilo, changes)]


def sensitivity_sentences(results: Results) -> list[str]:
    """Choices that change the estimate by more than the choice of system does."""
    span = between_systems(results.sensitivity)
    if span is None:
        return []
    low, high = (_kilo(value) for value in span)
    others = sorted(within_systems(results.sensitivity), key=lambda entry: -entry.rms_change_pa)
    above = [entry for entry in others if entry.rms_change_pa > span[1]]
    lesser = {entry.choice for entry in others if entry.rms_change_pa > span[0]}
    lesser -= {entry.choice for entry in above}
    first = (
        f"Open choices: the estimates of two systems differ by {low} to {high} kPa (rms over "
        "sampled readings)."
    )
    return [" ".join([first, *_larger(above), *_lesser(lesser)])]


def _larger(above: Sequence[SensitivityEntry]) -> Iterator[str]:
    """The largest effect of each choice, of entries in falling order."""
    if not above:
        yield "No choice within a system has a larger effect."
        return
    largest: dict[str, SensitivityEntry] = {}
    for entry in above:
        largest.setdefault(entry.choice, entry)
    parts = [
        words(f"{heading(entry)} {entry.alternative} ({system_name(entry.system)}, ")
        + f"{_kilo(entry.rms_change_pa)} kPa)"
        for entry in largest.values()
    ]
    yield f"Choices with a larger effect: {'; '.join(parts)}."


def _lesser(choices: set[str]) -> Iterator[str]:
    names = [choice_name(choice) for choice in CHOICE_NAMES if choice in choices]
    if names:
        yield f"Choices with an effect within that range: {', '.join(names)}."


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
