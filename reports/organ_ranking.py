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
NAMES = {**SYSTEM_NAMES, "reading": "the reading as it is"}


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
        f"In {count(int(lines[0]['draws']))} draws of an organ that have no unknown in common, "
        f"nearest to the benchmark is, by measure, {', '.join(parts)} (no one in {tied})."
    )


def _range(shares: Sequence[float]) -> str:
    return spread([percent(min(shares)), percent(max(shares))])


def _apart(lines: Sequence[Line]) -> str:
    pair = [line for line in lines if (line["system"], line["other"]) == ("mamdani", CLAIM)]
    within = [float(line["within_paper"]) for line in pair]
    printed = abs(float(pair[0]["paper"]))
    widest = max(max(abs(float(line[key])) for key in ("p05", "p95")) for line in pair)
    return (
        f"{NAMES[CLAIM]} and Mamdani lie no further apart than in the paper, {fixed(printed, 4)}, "
        f"in {_range(within)} of them by measure, and in nine of ten no further than "
        f"{fixed(widest, 4)}."
    )


def _coarse(lines: Sequence[Line]) -> str:
    if not lines:
        return (
            "What coarse lattices do to this ranking is not known: no draw was repeated (--again)."
        )
    changed = [float(line["changed"]) for line in lines]
    most = max(lines, key=lambda line: float(line["changed"]))
    times = fixed(float(lines[0]["times"]), 0)
    return (
        f"On lattices {times} times as fine another is nearest in {_range(changed)} of "
        f"{spread(sorted({line['draws'] for line in lines}, key=int))} draws repeated, by measure "
        f"(the most {share(most, 'changed')} by {column(most)}): so much of the ranking is of the "
        "coarse lattice."
    )
