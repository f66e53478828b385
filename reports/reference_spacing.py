"""The benchmark's unit of length on the first page: which system it makes the nearest one.

The paper does not print the reference spacing h_0 at which its Table II holds, and the ranking
hangs on it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from importlib.resources.abc import Traversable
from itertools import groupby, pairwise
from typing import TYPE_CHECKING

from reports import canvas
from reports.appearance import system_name
from reports.benchmarks import Line, read
from reports.digits import fixed
from reports.paper import TABLE_III
from reports.ranking_study import SPACING, column, is_ranked, winners_over_spacing
from reports.ranking_study_figure import draw_curves, draw_winners
from study.results.folder import Results

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAME = "reference_spacing"
DRAWN = ("displacement", "iso-18571")
"""Curve and measure that are drawn: one whose scores come as high as the paper's."""
HEIGHT, WIDTH = 1.35, 3.9
MILLI = 1e3


def reference_spacing(results: Results, folder: Traversable | None = None) -> str | None:
    """The sentence of the first page; None for a run without benchmark, or without the table."""
    lines = read(SPACING, folder)
    if not lines or not is_ranked(results):
        return None
    own = results.scene.damping.reference_spacing
    modulus = 2.5 * results.scene.basafa.k1 / own**2
    return (
        "Against which benchmark? The paper does not print the reference spacing h₀ at which its "
        "Table II holds, and the benchmark's modulus goes as 1/h₀²: here h₀ is "
        f"{fixed(MILLI * own, 1)} mm and the modulus {fixed(modulus / 1e3, 1)} kPa, by choice. In "
        f"the paper's scene, with all else as it is, {_spans(lines)}. The paper's order rests on "
        f"margins of {_margins()}."
    )


def _spans(lines: Sequence[Line]) -> str:
    """Ranges of the spacing, and the system that is nearest by the most measures in each."""
    wins = winners_over_spacing(lines)
    spacings = sorted({spacing for spacing, _ in wins})
    count = len({measure for _, measure in wins})
    parts = []
    for system, group in groupby(spacings, lambda spacing: _leader(wins, spacing)[0]):
        found = list(group)
        votes = [_leader(wins, spacing)[1] for spacing in found]
        span = f"h₀ of {fixed(MILLI * found[0], 1)} to {fixed(MILLI * found[-1], 1)} mm"
        times = str(max(votes)) if min(votes) == max(votes) else f"{min(votes)} to {max(votes)}"
        parts.append(f"{system_name(system)} is nearest by {times} of {count} measures at {span}")
    return ", ".join(parts)


def _leader(wins: dict[tuple[float, str], str], spacing: float) -> tuple[str, int]:
    """The system that is nearest by the most measures at a spacing, and by how many."""
    counts = Counter(system for (at, _), system in wins.items() if at == spacing)
    return max(counts.items(), key=lambda one: (one[1], one[0]))


def _margins() -> str:
    ordered = sorted(TABLE_III.values(), reverse=True)
    gaps = [fixed(a - b, 4) for a, b in pairwise(ordered)]
    return " and ".join(gaps)


def reference_spacing_figure(results: Results) -> bytes | None:
    """The small figure of the first page as SVG; None where there is no sentence."""
    if reference_spacing(results) is None:
        return None
    own = results.scene.damping.reference_spacing
    return canvas.picture(lambda: _figure(read(SPACING), own))


def _figure(lines: Sequence[Line], own: float) -> Figure:
    figure = canvas.sheet(HEIGHT, WIDTH)
    strips, scores = figure.subplots(1, 2, width_ratios=(1.0, 1.1))
    draw_winners(strips, lines)
    chosen = [line for line in lines if (line["curve"], line["measure"]) == DRAWN]
    draw_curves(scores, chosen)
    for axes in (strips, scores):
        axes.axvline(MILLI * own, color="black", linewidth=0.6, linestyle=":")
        axes.set_xlabel("h₀ [mm]")
    strips.set_yticklabels([name.replace("phase plane", "loop") for name in _names(lines)])
    strips.tick_params(axis="y", labelsize=5.0)
    figure.legend(*scores.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def _names(lines: Sequence[Line]) -> list[str]:
    return list(dict.fromkeys(map(column, lines)))
