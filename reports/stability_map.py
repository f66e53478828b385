"""Outcomes of the stability cases by family, and measured over predicted critical steps."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from reports import canvas
from reports.appearance import Style, series
from reports.stability import CRITICAL_STEP, FAILED, OUTCOMES, StabilityCase, cases, matrix

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

MAP, STEPS = "stability", "critical_step"
ALARM = "#B3261E"
FRAME, ROW, NARROW_ROW = 0.8, 0.18, 0.115
"""Height of what is around the lines, and of a line of either figure [inch]."""
LEAST = 1e-6
"""Smallest share of a tolerance drawn to scale."""
SPREAD = 0.2
"""Between the integrators' marks on one line, in lines."""
HEADS = [*OUTCOMES.values(), FAILED]
PER_CENT = 100.0


def write_figures(folder: Path) -> list[Path]:
    """Draw the stability cases of a folder as SVG and PDF into it; none without cases."""
    found = cases(folder)
    return canvas.write({folder / MAP: lambda: _map(found), folder / STEPS: lambda: _steps(found)})


def stability_map(found: Sequence[StabilityCase]) -> bytes | None:
    """Map of cases by family and outcome, and of the tolerance that each used, as SVG."""
    return canvas.picture(lambda: _map(found))


def critical_step_figure(found: Sequence[StabilityCase]) -> bytes | None:
    """Figure of measured over predicted critical step as SVG, None without any."""
    return canvas.picture(lambda: _steps(found))


def _map(found: Sequence[StabilityCase]) -> Figure | None:
    if not found:
        return None
    families = list(matrix(found))
    figure = canvas.sheet(FRAME + ROW * len(families))
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(1.15, 1.0))
    left.set(ylim=(len(families) - 0.5, -0.5), xlim=(-0.5, len(HEADS) - 0.5))
    left.set_yticks(range(len(families)), families)
    _draw_counts(left, found)
    _draw_shares(right, found, families)
    return figure


def _draw_counts(axes: Axes, found: Sequence[StabilityCase]) -> None:
    for y, counts in enumerate(matrix(found).values()):
        for x, head in enumerate(HEADS):
            wrong = head == FAILED and counts[head] > 0
            shade = ALARM if wrong else "#dddddd"
            if counts[head]:
                axes.barh(y, 0.92, left=x - 0.46, height=0.84, color=shade, linewidth=0)
            ink = "white" if wrong else "black" if counts[head] else "#aaaaaa"
            axes.text(x, y, str(counts[head]), ha="center", va="center", color=ink)
    axes.xaxis.tick_top()
    axes.set_xticks(range(len(HEADS)), [head.replace(" ", "\n", 1) for head in HEADS])
    axes.tick_params(length=0)
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)


def _draw_shares(axes: Axes, found: Sequence[StabilityCase], families: Sequence[str]) -> None:
    """One mark per case with a number; marks of a family are spread so that they show."""
    for y, family in enumerate(families):
        members = [case for case in found if case.family == family and case.tolerance is not None]
        for k, case in enumerate(members):
            at = y + 0.6 * ((k * 0.618) % 1.0 - 0.5)
            axes.plot(_share(case), at, **_mark(case), clip_on=False)
    axes.axvline(1.0, color="black", linewidth=0.8)
    axes.set(xscale="log", xlim=(LEAST / 1.5, 3.0))
    ticks = [LEAST, 1e-4, 1e-2, 1.0]
    axes.set_xticks(ticks, [f"≤ {LEAST:g}", "0.0001", "0.01", "limit"])
    axes.set_xlabel("difference from prediction ÷ tolerance")
    axes.tick_params(axis="y", length=0, labelleft=False)


def _share(case: StabilityCase) -> float:
    """Difference of a case over its tolerance; one that did not meet its end is off the scale."""
    if case.difference is None or case.tolerance is None:
        return 2.5
    limit = case.tolerance or 1.0
    return float(np.clip(case.difference / limit, LEAST, 2.5))


def _mark(case: StabilityCase) -> Style:
    if case.passed:
        return {"marker": "o", "markersize": 2.4, "color": "#0072B2", "alpha": 0.55, "mew": 0}
    return {"marker": "X", "markersize": 5, "color": ALARM, "linestyle": ""}


def _steps(found: Sequence[StabilityCase]) -> Figure | None:
    shown = [case for case in found if case.family == CRITICAL_STEP and case.departure is not None]
    if not shown:
        return None
    named = [(case, *_parts(case)) for case in shown]
    titles = list(dict.fromkeys(title for _, title, _ in named))
    looks = series(which for _, _, which in named)
    figure = canvas.sheet(FRAME + NARROW_ROW * len(titles))
    axes = figure.subplots()
    middle = (len(looks) - 1) / 2
    for case, title, which in named:
        y = titles.index(title) + SPREAD * (list(looks).index(which) - middle)
        look = looks[which] | ({} if case.passed else {"color": ALARM})
        axes.plot(PER_CENT * (case.departure or 0.0), y, **look, markersize=2.8, linestyle="")
    _label_steps(axes, titles, shown)
    figure.legend(handles=_legend(looks), loc="outside upper center", ncols=len(looks))
    return figure


def _parts(case: StabilityCase) -> tuple[str, str]:
    """What is varied, and the integrator, of a case named "varied: integrator"."""
    title, _, which = case.name.rpartition(": ")
    return (title, which) if title else (which, "")


def _label_steps(axes: Axes, titles: Sequence[str], shown: Sequence[StabilityCase]) -> None:
    limit = PER_CENT * max((case.tolerance or 0.0) for case in shown)
    axes.axvspan(-limit, limit, color="#f0f0f0", linewidth=0, zorder=0.3)
    axes.axvline(0.0, color="black", linewidth=0.8, zorder=0.6)
    most = PER_CENT * max(abs(case.departure or 0.0) for case in shown)
    axes.set(
        ylim=(len(titles) - 0.4, -0.6), xlabel="measured over predicted critical step, less one [%]"
    )
    axes.set_xlim(*(1.15 * max(limit, most) * np.array([-1.0, 1.0])))
    axes.set_yticks(range(len(titles)), titles)
    axes.tick_params(axis="y", length=0)


def _legend(looks: dict[str, Style]) -> list[Line2D]:
    from matplotlib.lines import Line2D

    return [
        Line2D([], [], linestyle="", label=name, markersize=4, **look)
        for name, look in looks.items()
    ]
