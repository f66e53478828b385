"""Comparison of several runs as a PDF: overlaid curves, and a table of differences."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from reports import canvas, several
from reports.appearance import other_look
from reports.digits import short, significant, words
from reports.motion_figures import MILLI, peak
from reports.page.answer import curve_error
from reports.ranking import tool_probe
from reports.report import compile_pdf
from reports.several import Compared
from study.results import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TEMPLATE = "several.typ"
COLUMNS = 3
LOOKS_FROM = 4
"""The first of the looks of runs, whose colours are told apart best."""
MOST_PANELS, MOST_ROWS = 9, 30
PANEL_HEIGHT, LEGEND_HEIGHT = 1.8, 0.35


def several_pdf(names: Sequence[str], runs: Sequence[Results], rows: Sequence[Compared]) -> bytes:
    """The document; the same runs give the same bytes."""
    table = several.cells(rows)
    names = [words(short(name, 24)) for name in names]
    content: dict[str, object] = {
        "title": "comparison of runs",
        "names": names,
        "header": [*several.HEADER, *names, "verdict"],
        "rows": [[words(cell) for cell in row] for row in table[:MOST_ROWS]],
        "left_out": max(0, len(table) - MOST_ROWS),
        "said": several.said(names, runs, rows),
        "alternative": alternative(names, runs),
    }
    figure = curves_figure(names, runs)
    return compile_pdf(content, {"curves": [] if figure is None else [figure]}, TEMPLATE)


def shared_models(runs: Sequence[Results]) -> list[str]:
    """Labels of the models that two runs have moved, in order."""
    found = [label for run in runs for label in moved(run)]
    return [label for label in dict.fromkeys(found) if found.count(label) > 1]


def moved(run: Results) -> dict[str, str]:
    """Name of each model with a curve at the tool, by its label."""
    probe = tool_probe(run)
    return {
        one.label: one.name
        for one in run.record.models
        if run.curve(one.name, probe).displacement.size
    }


def curves_figure(names: Sequence[str], runs: Sequence[Results]) -> bytes | None:
    """A panel for each shared model with a line for each run; None where no model is shared."""
    labels = shared_models(runs)[:MOST_PANELS]
    if not labels:
        return None

    def draw() -> Figure:
        rows = -(-len(labels) // COLUMNS)
        figure = canvas.sheet(LEGEND_HEIGHT + rows * PANEL_HEIGHT)
        grid = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
        lines = {}
        for axes, label in zip(grid, labels, strict=False):
            for k, (name, run) in enumerate(zip(names, runs, strict=True)):
                if label in moved(run):
                    lines[k] = _draw(axes, run, moved(run)[label], k, name)
            axes.set_title(label, loc="left", fontweight="bold")
            axes.set(xlabel="time [s]", ylabel="displacement [mm]")
        for axes in grid[len(labels) :]:
            axes.set_axis_off()
        shown = [lines[k] for k in sorted(lines)]
        figure.legend(handles=shown, loc="outside upper center", ncols=4, handlelength=3.2)
        return figure

    return canvas.picture(draw)


def _draw(axes: Axes, run: Results, model: str, k: int, name: str) -> object:
    """A run's curve at its tool, with the error of its peak."""
    probe, look = tool_probe(run), other_look(k + LOOKS_FROM)
    curve = run.curve(model, probe)
    style = look.line | {"linewidth": 1.4}
    (line,) = axes.plot(curve.time, MILLI * curve.displacement, label=name, **style)
    share = curve_error(run.model(model), probe)
    if share:
        at = int(np.abs(curve.displacement).argmax())
        largest = MILLI * float(curve.displacement[at])
        error = abs(largest) * share
        axes.errorbar(curve.time[at], largest, error, color=look.colour, capsize=2, lw=0.8)
    return line


def alternative(names: Sequence[str], runs: Sequence[Results]) -> str:
    """The largest displacement of each model in each run, for readers who cannot see the curves."""
    parts = []
    for label in shared_models(runs):
        told = []
        for name, run in zip(names, runs, strict=True):
            model = moved(run).get(label)
            largest = None if model is None else peak(run, model, tool_probe(run))
            if largest is not None:
                told.append(f"{name} {significant(MILLI * largest)} mm")
        parts.append(f"{label}: {', '.join(told)}")
    return f"Displacement at the tool over time. Largest: {'; '.join(parts)}"
