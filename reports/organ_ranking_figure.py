"""Who is nearest to the benchmark over the draws of an organ, and why."""

from __future__ import annotations

from importlib.resources.abc import Traversable
from pathlib import Path
from typing import TYPE_CHECKING

from reports import canvas
from reports.appearance import LOOKS, SYSTEM_NAMES, system_colour
from reports.benchmarks import read
from reports.organ_ranking import INDICES, NAMES, NEAREST
from reports.ranking_study import CLAIM, column
from reports.ranking_study_figure import HEIGHT, draw_indices, draw_shares

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAME = "organ_ranking"
COLOURS = {system: system_colour(system) for system in SYSTEM_NAMES} | {
    "reading": LOOKS["reading"].colour
}


def write_figures(folder: Path) -> list[Path]:
    """Draw the tables of a folder as SVG and PDF into it; none without tables."""
    return canvas.write({folder / NAME: lambda: _figure(folder)})


def organ_figures() -> dict[str, bytes]:
    """The figure of the tables that come with the program as SVG, by name; none without tables."""
    svg = canvas.picture(lambda: _figure(None))
    return {} if svg is None else {NAME: svg}


def _figure(folder: Traversable | None) -> Figure | None:
    nearest, indices = read(NEAREST, folder), read(INDICES, folder)
    if not nearest:
        return None
    figure = canvas.sheet(HEIGHT)
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(1.0, 1.5))
    names = list(dict.fromkeys(map(column, nearest)))
    left.set_yticks(range(len(names)), names)
    left.set_ylim(len(names) - 0.5, -0.5)
    draw_shares(left, nearest, names, {s: (NAMES[s], COLOURS[s]) for s in NAMES})
    draw_indices(right, [i for i in indices if i["output"] == f"mamdani - {CLAIM}"], names)
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower left", ncols=5)
    return figure
