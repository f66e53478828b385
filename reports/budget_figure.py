"""The error budgets of a run as waterfalls: from the whole difference down to zero."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from typing import TYPE_CHECKING

from reports import canvas
from reports.appearance import looks
from reports.budget import SMALL, by_reference, cause_name, signed
from reports.digits import percent_known
from study.results import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from study.results.records import ErrorBudget

HEIGHT, MOST = 1.9, 4
BETTER, WORSE, WHOLE = "#56B4E9", "#D55E00", "#444444"


def budget_figure(results: Results) -> bytes | None:
    """Waterfalls against the finite elements, a panel a model; None without a budget."""
    found = by_reference(results).get("fem", [])[:MOST]
    if not found:
        return None
    seen = looks(results)

    def draw() -> Figure:
        figure = canvas.sheet(HEIGHT)
        panels = figure.subplots(1, len(found), sharey=True, sharex=True, squeeze=False)[0]
        for axes, budget in zip(panels, found, strict=True):
            waterfall(axes, budget)
            axes.set_title(seen[budget.model].label)
            axes.set_xlabel("relative L2 difference [%]")
        panels[0].set_xlim(_limits(found))  # of all, as they share the axis
        return figure

    return canvas.drawn(draw)


def waterfall(axes: Axes, budget: ErrorBudget) -> None:
    """Draw each contribution where those before it ended; a black mark is what remains."""
    names = ["total", *(cause_name(part.cause, budget.reference) for part in budget.parts)]
    axes.barh(0, 100 * budget.total, height=0.7, color=WHOLE)
    _label(axes, 0, 100 * budget.total, percent_known(budget.total, budget.total_error))
    at = budget.total
    for y, part in enumerate(budget.parts, 1):
        after = at - part.contribution
        colour = BETTER if part.contribution >= 0.0 else WORSE
        axes.barh(y, 100 * (after - at), left=100 * at, height=0.7, color=colour)
        axes.plot([100 * at] * 2, [y - 1.35, y + 0.35], color=WHOLE, linewidth=0.5)
        axes.plot([100 * part.left] * 2, [y - 0.35, y + 0.35], color="black", linewidth=1.4)
        _label(
            axes, y, 100 * max(at, after, part.left), signed(part.contribution, budget.total_error)
        )
        at = after
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_xlim(_limits([budget]))
    axes.grid(visible=False, axis="y")


def _limits(budgets: Sequence[ErrorBudget]) -> tuple[float, float]:
    """Ends [%] of the axis: contributions may exceed the total; with room for the numbers."""
    ends = [0.0, *(part.left for one in budgets for part in one.parts)]
    for one in budgets:
        ends += accumulate((-part.contribution for part in one.parts), initial=one.total)
    low, high = min(ends), max(ends)
    return 105.0 * low if low < -SMALL else 0.0, 100.0 * high + 35.0 * (high - low)


def _label(axes: Axes, y: int, end: float, text: str) -> None:
    axes.annotate(text, (end, y), (3, 0), textcoords="offset points", va="center")
