"""The paper's ranking over all that the paper leaves open: tables of `robustness` in sentences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib.resources.abc import Traversable
from itertools import groupby

from reports.appearance import SYSTEM_NAMES, system_name
from reports.benchmarks import Line, read
from reports.digits import Table, count, fixed, interval, percent, significant, symbols, words
from reports.paper import TABLE_III
from reports.tables import CURVE_NAMES, MEASURE_NAMES
from study.results import Results

NEAREST, DIFFERENCES, TABLE_THREE, INDICES, DRAWN, UNKNOWNS, SPACING = (
    "ranking_nearest",
    "ranking_differences",
    "ranking_table_iii",
    "ranking_indices",
    "ranking_nearest_draws",
    "ranking_unknowns",
    "ranking_spacing",
)
MOST_NAMED = 4
WIDEST = 0.6
"""Width of the 95 % interval of a total index beyond which it is not printed, as not resolved."""
FEWEST = 64
"""Rows of the design below which a bootstrap over them does not give that interval either."""
CLAIM = "interval-type-2"
"""The system that the paper finds nearest to the benchmark."""


def is_ranked(results: Results) -> bool:
    """Whether a run ranks fuzzy systems by their likeness to the benchmark."""
    names = [model.name for model in results.record.models]
    return "basafa" in names and len(results.record.fuzzy.systems) > 1


def ranking_study(folder: Traversable | None = None) -> dict[str, object] | None:
    """What the study found, as sentences and tables; None where it was not delivered.

    Without a folder, of the tables that come with the program.
    """
    nearest = read(NEAREST, folder)
    if not nearest:
        return None
    return {
        "sentences": list(sentences(folder)),
        "systems": [system_name(system) for system in SYSTEM_NAMES],
        "nearest": nearest_rows(nearest),
        "differences": difference_rows(read(DIFFERENCES, folder)),
        "table_iii": table_iii_rows(read(TABLE_THREE, folder)),
        "unknowns": [unknown_row(line) for line in read(UNKNOWNS, folder)],
    }


def unknown_row(line: Line) -> list[str]:
    """Name of an unknown, its range or alternatives, and what it is, in a reader's units."""
    name = line["unknown"].replace("_", " ")
    return [words(name), words(interval(line["range"])), words(symbols(line["meaning"]))]


def sentences(folder: Traversable | None = None) -> Iterator[str]:
    """Whether the paper's order holds, how far scores lie apart, and what moves them."""
    nearest = read(NEAREST, folder)
    yield _winners(nearest)
    yield _apart(read(DIFFERENCES, folder))
    yield _reproduced(read(TABLE_THREE, folder))
    yield _movers(read(INDICES, folder), int(nearest[0]["draws"]))
    yield from _over_spacing(read(SPACING, folder))


def column(line: Line) -> str:
    """Curve and measure of a line, in print."""
    curve, measure = line["curve"], line["measure"]
    return f"{CURVE_NAMES.get(curve, curve)}, {MEASURE_NAMES.get(measure, measure)}"


def nearest_rows(lines: Sequence[Line]) -> Table:
    """A row a measure: share of draws in which each system is nearest, with its interval; ties."""
    rows = []
    for name, group in groupby(lines, column):
        found = {line["system"]: line for line in group}
        cells = [share(found[system]) for system in SYSTEM_NAMES]
        rows.append([name, *cells, percent(float(next(iter(found.values()))["tied"]))])
    return rows


def share(line: Line, of: str = "share") -> str:
    """A share of a line, by the name of its column, with its interval."""
    low, high = (fixed(100.0 * float(line[key]), 1) for key in ("low", "high"))
    return f"{percent(float(line[of]))} ({low}–{high})"


def difference_rows(lines: Sequence[Line]) -> Table:
    """A row a measure and pair: quantiles of the difference, and the paper's place in them."""
    return [
        [
            column(line),
            f"{system_name(line['system'])} − {system_name(line['other'])}",
            *(fixed(float(line[key]), 4) for key in ("p05", "p25", "p50", "p75", "p95")),
            fixed(float(line["paper"]), 4),
            percent(float(line["within_paper"])),
            percent(float(line["paper_sign"])),
        ]
        for line in lines
    ]


def table_iii_rows(lines: Sequence[Line]) -> Table:
    """A row a measure: how near any draw comes to Table III, and how many come how near."""
    return [
        [
            column(line),
            fixed(float(line["nearest"]), 4),
            *(count(int(line[key])) for key in ("within_rounding", "within_0005", "within_005")),
            count(int(line["in_order_of_those"])),
        ]
        for line in lines
    ]


def _winners(lines: Sequence[Line]) -> str:
    shares = [(float(line["share"]), column(line)) for line in lines if line["system"] == CLAIM]
    low, high = min(shares), max(shares)
    of_system = {
        system: [float(line["share"]) for line in lines if line["system"] == system]
        for system in SYSTEM_NAMES
    }
    most = max(of_system, key=lambda system: sum(of_system[system]))
    return (
        f"In {count(int(lines[0]['draws']))} samples of all parameters that the paper leaves open, "
        f"{system_name(CLAIM)}, first in the paper, is nearest to the benchmark in "
        f"{percent(low[0])} ({low[1]}) to {percent(high[0])} ({high[1]}); most often nearest is "
        f"{system_name(most)}, in "
        f"{percent(min(of_system[most]))} to {percent(max(of_system[most]))}."
    )


def _apart(lines: Sequence[Line]) -> str:
    pair = [line for line in lines if {line["system"], line["other"]} == {CLAIM, "mamdani"}]
    shares = [float(line["within_paper"]) for line in pair]
    printed = abs(TABLE_III[CLAIM] - TABLE_III["mamdani"])
    signs = [float(line["paper_sign"]) for line in pair]
    return (
        f"The two highest scores of the paper differ by {fixed(printed, 4)}. In "
        f"{percent(min(shares))} to {percent(max(shares))} of the samples, depending on the "
        f"measure, the difference is not larger, and in {percent(min(signs))} to "
        f"{percent(max(signs))} the order is that of the paper."
    )


def _reproduced(lines: Sequence[Line]) -> str:
    exact = sum(int(line["within_rounding"]) for line in lines)
    best = min(lines, key=lambda line: float(line["nearest"]))
    close, draws = sum(int(line["within_005"]) for line in lines), int(lines[0]["draws"])
    verb = "reproduces" if exact < 2 else "reproduce"
    number = "No sample" if exact == 0 else count(exact)
    return (
        f"{number} of {count(draws)} {verb} Table III to its four digits by any of the "
        f"{len(lines)} measures; the smallest difference is "
        f"{significant(float(best['nearest']), 2)} ({column(best)}), and {count(close)} of "
        f"{count(draws * len(lines))} scores of all three systems are within 0.005 of it."
    )


def _movers(lines: Sequence[Line], draws: int) -> str:
    """The unknowns with the largest total indices on the lead of the paper's best two."""
    return movers(
        lines, draws, f"mamdani - {CLAIM}", f"The lead of {system_name(CLAIM)} over Mamdani"
    )


def movers(lines: Sequence[Line], draws: int, output: str, name: str) -> str:
    """The unknowns with the largest total indices on an output of that name.

    Those whose interval is too wide to mean anything are counted and not printed; none are of a
    design of few rows, which has two independent `draws` each.
    """
    found: dict[str, list[Line]] = {}
    for line in lines:
        if line["output"] == output:
            found.setdefault(line["unknown"], []).append(line)
    known = {unknown: of for unknown, of in found.items() if _width(of) <= WIDEST}
    if draws < 2 * FEWEST or not known:
        return (
            f"{name}: too few samples to estimate its Sobol' indices, which need at least {FEWEST} "
            f"rows of the design and 95 % intervals no wider than {WIDEST:g}."
        )
    named = sorted(known, key=lambda unknown: -_mean(known[unknown], "total"))[:MOST_NAMED]
    parts = ", ".join(f"{words(one.replace('_', ' '))} {_index(known[one])}" for one in named)
    lost = len(found) - len(known)
    most = "mainly on" if lost == 0 else "among others on"
    return (
        f"{name} depends {most} (total Sobol' index and its 95 % interval, means over measures): "
        f"{parts}{_untold(lost)}."
    )


def _untold(unknowns: int) -> str:
    if unknowns == 0:
        return ""
    return f"; the intervals of {count(unknowns)} more are wider than {WIDEST:g}"


def _width(lines: Sequence[Line]) -> float:
    return _mean(lines, "total_high") - _mean(lines, "total_low")


def _index(lines: Sequence[Line]) -> str:
    total, low, high = (fixed(_mean(lines, key), 2) for key in ("total", "total_low", "total_high"))
    return f"{total} ({low}–{high})"


def _mean(lines: Sequence[Line], column: str) -> float:
    return sum(float(line[column]) for line in lines) / len(lines)


def _over_spacing(lines: Sequence[Line]) -> Iterator[str]:
    """Within which reference spacings each system wins, by how many measures."""
    if not lines:
        return
    wins = winners_over_spacing(lines)
    spacings = sorted({spacing for spacing, _ in wins})
    low, high = 1e3 * spacings[0], 1e3 * spacings[-1]
    found = sorted(set(wins.values()))
    parts = "; ".join(f"{system_name(system)} {_where(wins, system)}" for system in found)
    yield (
        f"If only the reference spacing of the paper scene is varied, from {fixed(low, 1)} to "
        f"{fixed(high, 1)} mm, the nearest system changes: {parts}."
    )


def winners_over_spacing(lines: Sequence[Line]) -> dict[tuple[float, str], str]:
    """The system with the highest score at each spacing [m] by each measure in print."""
    best: dict[tuple[float, str], tuple[float, str]] = {}
    for line in lines:
        key = float(line["spacing_m"]), column(line)
        best[key] = max(best.get(key, (-1.0, "")), (float(line["score"]), line["system"]))
    return {key: system for key, (_, system) in best.items()}


def _where(wins: dict[tuple[float, str], str], system: str) -> str:
    where = [spacing for (spacing, _), winner in wins.items() if winner == system]
    span = f"from {fixed(1e3 * min(where), 1)} to {fixed(1e3 * max(where), 1)} mm"
    share = len(where) / len(wins)
    return f"{span} ({percent(share)} of spacings and measures)"
