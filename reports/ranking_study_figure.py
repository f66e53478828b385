"""Who is nearest to the benchmark over all draws and over the reference spacing, and why."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from reports import canvas
from reports.appearance import SYSTEM_LOOKS, SYSTEM_NAMES, system_colour, system_name
from reports.benchmarks import Line, read
from reports.digits import words
from reports.paper import TABLE_III
from reports.ranking_study import (
    CLAIM,
    INDICES,
    NEAREST,
    SPACING,
    WIDEST,
    column,
    winners_over_spacing,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

RANKING, OVER_SPACING = "ranking", "ranking_spacing"
HEIGHT = 2.5
DRAWN = ("displacement", "relative-l2"), ("phase-plane", "pcm")
"""Curve and measure of the scores drawn over the spacing: one of a time history, one of a loop."""
TIED = "#dddddd"
Look = tuple[str, str]
"""Label and colour of a system."""
FUZZY = {system: (system_name(system), system_colour(system)) for system in SYSTEM_NAMES}


def write_figures(folder: Path) -> list[Path]:
    """Draw the tables of a folder as SVG and PDF into it; none without tables."""
    return canvas.write(
        {folder / RANKING: lambda: _ranking(folder), folder / OVER_SPACING: lambda: _over(folder)}
    )


def ranking_figures() -> dict[str, bytes]:
    """Figures of the tables that come with the program as SVG, by name."""
    drawn = {
        RANKING: canvas.picture(lambda: _ranking(None)),
        OVER_SPACING: canvas.picture(lambda: _over(None)),
    }
    return {name: svg for name, svg in drawn.items() if svg is not None}


def _ranking(folder: Traversable | None) -> Figure | None:
    return ranking_figure(read(NEAREST, folder), read(INDICES, folder), FUZZY)


def ranking_figure(
    nearest: Sequence[Line], indices: Sequence[Line], systems: Mapping[str, Look]
) -> Figure | None:
    """Who is nearest to the benchmark by measure, and what decides it; None without draws.

    `systems`: those that may be nearest, by name.
    """
    if not nearest:
        return None
    figure = canvas.sheet(HEIGHT)
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(1.0, 1.5))
    names = list(dict.fromkeys(map(column, nearest)))
    left.set_yticks(range(len(names)), names)
    left.set_ylim(len(names) - 0.5, -0.5)
    draw_shares(left, nearest, names, systems)
    draw_indices(right, [line for line in indices if line["output"] == f"mamdani - {CLAIM}"], names)
    entries = left.get_legend_handles_labels()
    figure.legend(*entries, loc="outside lower left", ncols=len(systems) + 1)
    return figure


def draw_shares(
    axes: Axes,
    lines: Sequence[Line],
    names: Sequence[str],
    systems: Mapping[str, Look],
) -> None:
    """Stacked shares of draws by the nearest of systems, which are given by name.

    The draws in which no system is nearest are stacked last.
    """
    start = np.zeros(len(names))
    for system, (label, colour) in systems.items():
        width = np.array([float(line["share"]) for line in lines if line["system"] == system])
        axes.barh(range(len(names)), width, left=start, height=0.8, color=colour, label=label)
        start += width
    axes.barh(
        range(len(names)), 1.0 - start, left=start, height=0.8, color=TIED, label="no difference"
    )
    axes.set(xlim=(0.0, 1.0), xlabel="share of samples in which it is nearest")


def draw_indices(axes: Axes, lines: Sequence[Line], names: Sequence[str]) -> None:
    """Total index of the lead on each unknown, a column each, by measure.

    Empty where its 95 % interval is wider than WIDEST.
    """
    unknowns = list(dict.fromkeys(line["unknown"] for line in lines))
    values = np.full((len(names), len(unknowns)), np.nan)
    for line in lines:
        if float(line["total_high"]) - float(line["total_low"]) <= WIDEST:
            values[names.index(column(line)), unknowns.index(line["unknown"])] = float(
                line["total"]
            )
    shown = np.clip(values, 0.0, 1.0)
    axes.imshow(shown, cmap="Greys", vmin=0.0, vmax=1.0, aspect="auto")
    for (y, x), value in np.ndenumerate(shown):
        if value >= 0.05:
            ink = "white" if value > 0.5 else "black"
            axes.text(x, y, f"{value:.1f}", ha="center", va="center", color=ink)
        if np.isnan(value):
            axes.text(x, y, "?", ha="center", va="center", color="grey")
    axes.set_xticks(range(len(unknowns)), [name.replace("_", " ") for name in unknowns])
    axes.tick_params(axis="x", rotation=60, length=0)
    for label in axes.get_xticklabels():
        label.set_horizontalalignment("right")
        label.set_rotation_mode("anchor")
    axes.grid(visible=False)
    axes.set_title("total Sobol index of type-2’s lead over Mamdani")


def _over(folder: Traversable | None) -> Figure | None:
    lines = read(SPACING, folder)
    if not lines:
        return None
    figure = canvas.sheet(HEIGHT)
    strips, *panels = figure.subplots(1, 1 + len(DRAWN), width_ratios=(1.3, 1.0, 1.0))
    draw_winners(strips, lines)
    for axes, (curve, measure) in zip(panels, DRAWN, strict=True):
        chosen = [line for line in lines if (line["curve"], line["measure"]) == (curve, measure)]
        draw_curves(axes, chosen)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def draw_winners(axes: Axes, lines: Sequence[Line]) -> None:
    """Colour of the nearest system over the spacing, a strip a measure."""
    wins = winners_over_spacing(lines)
    names = list(dict.fromkeys(map(column, lines)))
    spacings = sorted({spacing for spacing, _ in wins})
    at = 1e3 * np.array(spacings)
    edges = np.concatenate([at[:1], np.sqrt(at[1:] * at[:-1]), at[-1:]])
    for y, name in enumerate(names):
        colours = [system_colour(wins[spacing, name]) for spacing in spacings]
        axes.barh([y] * len(at), np.diff(edges), left=edges[:-1], height=0.8, color=colours)
    axes.set_yticks(range(len(names)), names)
    axes.set(ylim=(len(names) - 0.5, -0.5), xlabel="reference spacing h₀ [mm]", title="nearest")


def draw_curves(axes: Axes, lines: Sequence[Line]) -> None:
    """Score of each system over the spacing, and what the paper prints for it."""
    for system in SYSTEM_NAMES:
        own = [line for line in lines if line["system"] == system]
        x = [1e3 * float(line["spacing_m"]) for line in own]
        y = [float(line["score"]) for line in own]
        axes.plot(x, y, **SYSTEM_LOOKS[system].line, label=system_name(system))
    low, high = min(TABLE_III.values()), max(TABLE_III.values())
    axes.axhspan(low, high, color="black", linewidth=0.4, alpha=0.5, label="Table III")
    axes.set(xlabel="reference spacing h₀ [mm]", title=words(column(lines[0])), ylim=(0.0, 1.0))
