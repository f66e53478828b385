"""Contact force of rigid tools over time and over travel, and its largest value."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reports import canvas
from reports.appearance import labels, looks
from reports.digits import DASH, Table, fixed, short, significant, with_error
from reports.score_digits import LARGEST, NOT_RESOLVED, UNKNOWN, decimals
from study.results import Results
from study.results.records import ToolForce

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_TOOLS = 4
ROW_HEIGHT, LEGEND_HEIGHT, LEGEND_COLUMNS = 1.95, 0.3, 5
MILLI = 1e3


def tools(results: Results) -> list[str]:
    """Names of the rigid tools of a scene."""
    return list(dict.fromkeys(one.tool for one in results.record.tools))


def force_figure(results: Results) -> bytes | None:
    """Force of each tool over time and over its travel, a row a tool; None without rigid tools."""
    shown = tools(results)[:MOST_TOOLS]
    if not shown:
        return None

    def draw() -> Figure:
        figure = canvas.sheet(LEGEND_HEIGHT + ROW_HEIGHT * len(shown))
        grid = figure.subplots(len(shown), 2, squeeze=False)
        for row, tool in zip(grid, shown, strict=True):
            _draw(row, results, tool)
            row[0].set_title(short(tool), loc="left", fontweight="bold")
        canvas.legend_above(figure, grid[0, 0], LEGEND_COLUMNS)
        return figure

    return canvas.drawn(draw)


def _draw(row: list[Axes], results: Results, tool: str) -> None:
    seen = looks(results)
    for model in results.record.models:
        curve, look = results.tool_force(model.name, tool), seen[model.name]
        for axes, across in ((row[0], curve.time), (row[1], MILLI * curve.travel)):
            axes.plot(across, curve.force, label=look.label, **look.line)
    row[0].set(xlabel="time [s]", ylabel="force [N]")
    row[1].set(xlabel="travel of the tool [mm]", ylabel="force [N]")


def force_rows(results: Results) -> Table:
    """Tool, model, largest force with its error, when, how deep, work, scores against each."""
    named = labels(results)
    return [
        [
            short(one.tool),
            named[one.model],
            printed_force(one),
            fixed(one.peak_at_s, 3),
            fixed(MILLI * one.peak_travel_m, 1),
            significant(MILLI * one.work_j),
            _scores(results, one),
        ]
        for one in results.record.tools
    ]


def printed_force(one: ToolForce) -> str:
    """Largest force [N] with the error of the whole curve, which is relative to all of it."""
    if one.relative_error is None:
        return significant(one.peak_n)
    error = one.relative_error + (one.spacing_error or 0.0)
    return with_error(one.peak_n, abs(one.peak_n) * error)


def _scores(results: Results, one: ToolForce) -> str:
    """Relative L2 score against each reference."""
    named = labels(results)
    error = None if one.relative_error is None else one.relative_error + (one.spacing_error or 0.0)
    places = None if (error or 0.0) >= LARGEST else min(UNKNOWN, decimals(error))
    found = [
        f"{NOT_RESOLVED if places is None else fixed(row.score, places)} ({named[row.reference]})"
        for row in results.tool_scores
        if (row.model, row.tool, row.measure) == (one.model, one.tool, "relative-l2")
    ]
    return ", ".join(found) or DASH


def overlap(results: Results) -> str:
    """Deepest overlap of a body with its tools, printed; empty where none is known."""
    found = [one.tool_overlap_m for one in results.record.models if one.tool_overlap_m is not None]
    return f"{significant(MILLI * max(found), 2)} mm" if found else ""
