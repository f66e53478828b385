"""Figure of the trade-off: error against the reference over cost, for all and for each rate."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np

from reports import canvas
from reports.appearance import Style, series
from reports.configuration_names import contender_name
from reports.digits import Table
from reports.free_labels import name_places
from reports.tradeoff import (
    MeasuredConfiguration,
    configurations,
    is_in_time,
    left_out,
    rate_name,
    rates_of,
    share,
    timed,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

NAME = "tradeoff"
HEIGHT = 5.5
HEIGHT_RATIOS = (1.6, 1.0)
GRID = 12
"""Columns of the sheet; a panel takes some."""
WHOLE = 9
UNRESOLVED_COLOUR = "#e9e9e9"
LATE_COLOUR = "#f4f4f4"
COLUMN = 34
"""Letters in a line of the list beside."""
PER_CENT = 100.0
HOLLOW = {"markerfacecolor": "white"}
FRONT: Style = {"color": "#555555", "linewidth": 0.9}
TICKS = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100]

Styles = dict[str, Style]


def write_figures(folder: Path) -> list[Path]:
    """Draw the trade-off of a folder as SVG and PDF into it; none where nothing was timed."""
    return canvas.write({folder / NAME: lambda: _figure(configurations(folder))})


def tradeoff_figure(found: Sequence[MeasuredConfiguration]) -> bytes | None:
    """Figure of error over cost as SVG, or None where nothing was timed."""
    return canvas.picture(lambda: _figure(found))


def _figure(found: Sequence[MeasuredConfiguration]) -> Figure | None:
    shown, without = timed(found), left_out(found)
    if not shown:
        return None
    looks = series(one.contender for one in found)
    figure = canvas.sheet(HEIGHT)
    grid = figure.add_gridspec(2, GRID, height_ratios=HEIGHT_RATIOS)
    whole = figure.add_subplot(grid[0, : WHOLE if without else GRID])
    _draw_whole(whole, shown, looks)
    if without:
        _draw_list(figure.add_subplot(grid[0, WHOLE:]), without)
    rates = rates_of(shown)
    wide = GRID // max(1, len(rates))
    for k, rate in enumerate(rates):
        axes = figure.add_subplot(grid[1, k * wide : (k + 1) * wide], sharey=whole)
        _draw_rate(axes, shown, rate, looks)
        axes.tick_params(labelleft=k == 0)
        axes.set_ylabel("" if k else "error [%]")
    figure.legend(handles=_legend(shown, looks), loc="outside upper center", ncols=3)
    _name_front(whole, shown)
    return figure


def _draw_whole(axes: Axes, shown: Sequence[MeasuredConfiguration], looks: Styles) -> None:
    """All over their cost, with the bars of both, and the fronts."""
    for one in shown:
        look = looks[one.contender] | ({} if one.any_load else HOLLOW)
        axes.errorbar(**_bars(one), **look, linestyle="", markersize=4.5, elinewidth=0.6, zorder=3)
    _draw_front(axes, [one for one in shown if one.on_front], ":")
    _draw_front(axes, _any_load_front(shown), "-")
    axes.axvline(1.0, color="black", linewidth=0.8)
    _note(axes, "real time", (1.0, 1.0), ("data", "axes fraction"))
    axes.set(xscale="log", yscale="log", xlabel="wall time per simulated second [s/s]")
    of = "force of the tools" if any(one.of_force for one in shown) else "displacement field"
    axes.set_ylabel(f"error of the {of} [%]")
    axes.xaxis.set_major_formatter(_plain)
    _shade_unresolved(axes, shown)


def _bars(one: MeasuredConfiguration) -> Style:
    """Place of a mark with quartiles of its cost and, if it is resolved, the reference's error."""
    low, x, high = one.timing.quartiles
    place: Style = {"x": x, "y": _height(one), "xerr": [[x - low], [high - x]]}
    return place | ({} if one.error is None else {"yerr": PER_CENT * one.bar})


def _draw_front(axes: Axes, chosen: Sequence[MeasuredConfiguration], dashes: str) -> None:
    """A step line through configurations."""
    by_cost = sorted(chosen, key=_wall)
    walls = [_wall(one) for one in by_cost]
    heights = [_height(one) for one in by_cost]
    axes.plot(walls, heights, drawstyle="steps-post", linestyle=dashes, **FRONT)


def _any_load_front(shown: Iterable[MeasuredConfiguration]) -> list[MeasuredConfiguration]:
    """The Pareto front of those that follow any load, the cheapest first."""
    return sorted((one for one in shown if one.on_any_load_front), key=_wall)


def _wall(one: MeasuredConfiguration) -> float:
    return one.timing.quartiles[1]


def _name_front(axes: Axes, shown: Sequence[MeasuredConfiguration]) -> None:
    """Each new setting on the front for any load by its name, where there is room."""
    front = _any_load_front(shown)
    named = [
        (_wall(one), _height(one), one.mark)
        for one, last in zip(front, ["", *(one.mark for one in front)], strict=False)
        if one.mark != last
    ]
    marks = np.array([(_wall(one), _height(one)) for one in shown])
    name_places(axes, named, marks, {"color": "#444444"})


def _draw_rate(
    axes: Axes, shown: Sequence[MeasuredConfiguration], rate: str, looks: Styles
) -> None:
    """All over the share of a period that a frame takes; filled where it is ready in time."""
    for one in shown:
        look = looks[one.contender] | ({} if is_in_time(one, rate) else HOLLOW | {"alpha": 0.6})
        axes.plot(share(one, rate), _height(one), linestyle="", markersize=3.4, **look)
    axes.set(xscale="log", title=rate_name(rate), xlabel="p95 frame ÷ period")
    axes.xaxis.set_major_formatter(_plain)
    left, right = axes.get_xlim()
    axes.set_xlim(left, max(right, 2.0))
    axes.axvspan(1.0, max(right, 2.0), color=LATE_COLOUR, linewidth=0, zorder=0.4)
    axes.axvline(1.0, color="black", linewidth=0.8, zorder=0.6)


def _plain(value: float, _: float) -> str:
    """Label of a tick, without powers of ten."""
    return f"{value:g}"


def _height(one: MeasuredConfiguration) -> float:
    """Error [%]; of one that is not resolved, the bound on it."""
    return PER_CENT * (one.bar if one.error is None else one.error)


def _shade_unresolved(axes: Axes, shown: Sequence[MeasuredConfiguration]) -> None:
    from matplotlib.ticker import FixedLocator, NullLocator

    bar = PER_CENT * max(one.bar for one in shown)
    heights = [_height(one) for one in shown]
    bottom = 0.6 * min(bar, *heights)
    axes.set_ylim(bottom, 1.4 * max(heights))
    axes.axhspan(bottom, bar, color=UNRESOLVED_COLOUR, linewidth=0, zorder=0.5)
    _note(axes, "not resolved", (0.0, bar), ("axes fraction", "data"))
    axes.yaxis.set_major_locator(FixedLocator(TICKS))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(_plain)


def _draw_list(axes: Axes, without: Table) -> None:
    """List the configurations without an error, and why they have none."""
    axes.set_axis_off()
    texts = [fill(f"{name}: {status} {message}", COLUMN) for name, status, message in without]
    place: Style = {"va": "top", "linespacing": 1.25}
    axes.text(0.0, 1.0, "\n".join(["Without an error:", *texts]), in_layout=False, **place)


def _legend(shown: Iterable[MeasuredConfiguration], looks: Styles) -> list[Line2D]:
    from matplotlib.lines import Line2D

    marks = {one.contender: one.any_load for one in shown}
    found = [
        Line2D([], [], linestyle="", markersize=4.5, label=contender_name(name), **looks[name])
        for name in marks
    ]
    return [
        *found,
        Line2D([], [], linestyle="-", label="Pareto front, any load", **FRONT),
        Line2D([], [], linestyle=":", label="Pareto front, known loads", **FRONT),
    ]


def _note(axes: Axes, text: str, at: tuple[float, float], coords: tuple[str, str]) -> None:
    axes.annotate(text, at, (3, -3), xycoords=coords, **_small(va="top"))


def _small(**more: str) -> Style:
    return {"textcoords": "offset points", "color": "#444444"} | more
