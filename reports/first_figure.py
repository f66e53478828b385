"""The figure of the first page: curves at the tool, and the error budget of the nearest model."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reports import canvas
from reports.appearance import looks
from reports.budget_figure import waterfall
from reports.digits import control_point, short
from reports.motion_figures import draw_motion, motions
from reports.page.answer import nearest
from reports.ranking import tool_probe
from study.results import Results

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from study.results.records import ErrorBudget

BESIDE, WHOLE = 4.1, canvas.TEXT_WIDTH
"""Width beside a picture of the organ, and without one [inch]."""
HEIGHT = 2.5
COLUMNS, SHORT = 3, 18
"""Columns of the legend where no label has more than `SHORT` letters, otherwise one less."""


def first_figure(results: Results) -> bytes | None:
    """SVG of the displacement at the tool, and the budget of the nearest model if it has one."""
    found = motions(results, tool_probe(results))
    if not found:
        return None
    budget = budget_of_nearest(results)

    def draw() -> Figure:
        figure = canvas.sheet(HEIGHT, BESIDE if results.fields else WHOLE)
        panels = figure.subplots(1, 1 if budget is None else 2, squeeze=False)[0]
        draw_motion(panels[0], found, 0, 1, "time [s]", "displacement [mm]")
        panels[0].set_title(short(tool_probe(results)), fontweight="bold")
        if budget is not None:
            waterfall(panels[1], budget)
            panels[1].set_title(looks(results)[budget.model].label, fontweight="bold")
            panels[1].set_xlabel("relative L2 difference [%]")
        handles, labels = panels[0].get_legend_handles_labels()
        columns = COLUMNS if max(map(len, labels), default=0) <= SHORT else COLUMNS - 1
        figure.legend(handles, labels, loc="outside lower center", ncols=columns, handlelength=2.6)
        return figure

    return canvas.picture(draw)


def budget_of_nearest(results: Results) -> ErrorBudget | None:
    """The error budget of the model that the answer names, None where there is none."""
    found = nearest(results)
    if found is None:
        return None
    budgets = results.record.budgets
    wanted = found.model.name, found.reference
    return next((one for one in budgets if (one.model, one.reference) == wanted), None)


def caption(results: Results) -> str:
    """The caption of the figure."""
    band = "; the band is the type-2 stiffness interval" if results.bands else ""
    text = (
        f"Curves: displacement at {control_point(tool_probe(results))} along the push, over "
        f"time{band}. "
    )
    if budget_of_nearest(results) is not None:
        text += (
            "Bars: error budget of the nearest model, whose field differs from the reference at "
            "the peak load. The causes are corrected one after another; blue: this reduces the "
            "difference, orange: it increases it; black line: the difference that remains."
        )
    return text
