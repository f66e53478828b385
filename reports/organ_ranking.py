"""The ranking of the fuzzy systems on an organ: tables of `robustness SCENE` in sentences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib.resources.abc import Traversable
from itertools import groupby

from reports.appearance import SYSTEM_NAMES
from reports.benchmarks import Line, read
from reports.digits import Table, count, fixed, percent, spread
from reports.ranking_study import CLAIM, column, movers, share, unknown_row

NEAREST, DIFFERENCES, INDICES, FINER, UNKNOWNS = (
    "organ_nearest",
    "organ_differences",
    "organ_indices",
    "organ_finer",
    "organ_unknowns",
)
NAMES = {**SYSTEM_NAMES, "reading": "the reading"}


def organ_ranking(folder: Traversable | None = None) -> dict[str, object] | None:
    """What the study of an organ found, as sentences and tables; None where it was not delivered.

    Without a folder, of the tables that come with the program.
    """
    nearest = read(NEAREST, folder)
    if not nearest:
        return None
    return {
        "sentences": list(sentences(folder)),
        "systems": list(NAMES.values()),
        "nearest": nearest_rows(nearest, read(FINER, folder)),
        "unknowns": [unknown_row(line) for line in read(UNKNOWNS, folder)],
    }


def sentences(folder: Traversable | None = None) -> Iterator[str]:
    """Who is nearest how often, how far scores lie apart, what moves them, what coarse costs."""
    nearest = read(NEAREST, folder)
    draws = int(nearest[0]["draws"])
    yield _winners(nearest)
    yield _apart(read(DIFFERENCES, folder))
    lead = f"mamdani - {CLAIM}", f"The lead of {NAMES[CLAIM]} over Mamdani"
    yield movers(read(INDICES, folder), draws, *lead)
    yield _coarse(read(FINER, folder))


def nearest_rows(lines: Sequence[Line], finer: Sequence[Line]) -> Table:
    """A row a measure: share of draws in which each is nearest, ties, and what finer changes."""
    changed = {column(line): line for line in finer}
    rows = []
    for name, group in groupby(lines, column):
        found = {line["system"]: line for line in group}
        tied = percent(float(next(iter(found.values()))["tied"]))
        cells = [share(found[system]) for system in NAMES]
        rows.append(
            [name, *cells, tied, share(changed[name], "changed") if name in changed else "–"]
        )
    return rows


def _winners(lines: Sequence[Line]) -> str:
    parts = [
        f"{name} in {_range([float(line['share']) for line in lines if line['system'] == system])}"
        for system, name in NAMES.items()
    ]
    tied = _range(sorted({float(line["tied"]) for line in lines}))
    return (
        f"In {count(int(lines[0]['draws']))} independent samples of an organ, nearest to the "
        f"benchmark is, depending on the measure, {', '.join(parts)} (no difference in {tied})."
    )


def _range(shares: Sequence[float]) -> str:
    return spread([percent(min(shares)), percent(max(shares))])


def _apart(lines: Sequence[Line]) -> str:
    pair = [line for line in lines if (line["system"], line["other"]) == ("mamdani", CLAIM)]
    within = [float(line["within_paper"]) for line in pair]
    printed = abs(float(pair[0]["paper"]))
    widest = max(max(abs(float(line[key])) for key in ("p05", "p95")) for line in pair)
    return (
        f"The scores of {NAMES[CLAIM]} and Mamdani differ by no more than in the paper, "
        f"{fixed(printed, 4)}, in {_range(within)} of the samples depending on the measure, and by "
        f"no more than {fixed(widest, 4)} in nine of ten."
    )


def _coarse(lines: Sequence[Line]) -> str:
    if not lines:
        return (
            "The effect of the coarse lattice on this ranking is not known: no sample was repeated "
            "(--again)."
        )
    changed = [float(line["changed"]) for line in lines]
    most = max(lines, key=lambda line: float(line["changed"]))
    times = fixed(float(lines[0]["times"]), 0)
    return (
        f"On lattices {times} times as fine, another is nearest in {_range(changed)} of "
        f"{spread(sorted({line['draws'] for line in lines}, key=int))} repeated samples, depending "
        f"on the measure (largest: {share(most, 'changed')}, {column(most)}). This share of the "
        "ranking is due to the coarse lattice."
    )
