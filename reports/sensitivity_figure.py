"""How far each open choice moves the estimate, beside the differences between the systems."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING

from reports import canvas
from reports.appearance import Style, system_colour, system_name
from reports.digits import words
from reports.fuzzy_tables import between_systems, heading, within_systems
from study.results.tables import SensitivityEntry

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LINE_HEIGHT = 0.14
FRAME_HEIGHT = 0.75
GROUP_GAP = 0.55
"""Gap between two choices, in lines."""
SPREAD = 0.26
"""Between the systems' marks on one line, in lines."""
KILO = 1e-3
LEAST = 1e-3
"""Smallest change drawn to scale [kPa]."""
MARKS = {"mamdani": "o", "sugeno": "s", "interval-type-2": "D"}

Line = tuple[float, str, list[SensitivityEntry]]
"""Position, label and changes of one alternative."""


def sensitivity_figure(found: Sequence[SensitivityEntry]) -> bytes | None:
    """Figure of the rms and largest change of the estimates as SVG, or None if there are none."""
    inner = within_systems(found)
    if not inner:
        return None
    lines, heads = layout(inner)
    bottom = lines[-1][0] + 0.8

    def draw() -> Figure:
        figure = canvas.sheet(FRAME_HEIGHT + LINE_HEIGHT * bottom)
        axes = figure.subplots()
        axes.set(xscale="log", ylim=(bottom, -0.9), xlim=(LEAST / 1.35, 1.6 * _most(inner)))
        _draw_band(axes, found)
        for line in lines:
            _draw_line(axes, line)
        _label(axes, lines, heads)
        figure.legend(handles=_legend(inner, axes), loc="outside upper center", ncols=6)
        return figure

    return canvas.drawn(draw)


def layout(
    found: Sequence[SensitivityEntry],
) -> tuple[list[Line], list[tuple[float, str]]]:
    """Lines of the alternatives from the top, and the heads of the choices, with positions."""
    lines: list[Line] = []
    heads: list[tuple[float, str]] = []
    y = 0.0
    for name, members in groupby(found, heading):
        heads.append((y, name))
        y += 1.0
        for _, group in groupby(members, lambda entry: entry.alternative):
            same = list(group)
            lines.append((y, words(same[0].alternative), same))
            y += 1.0
        y += GROUP_GAP
    return lines, heads


def _most(found: Sequence[SensitivityEntry]) -> float:
    return max(LEAST, *(KILO * entry.largest_change_pa for entry in found))


def _draw_band(axes: Axes, found: Sequence[SensitivityEntry]) -> None:
    span = between_systems(found)
    if span is None:
        return
    low, high = (max(KILO * value, LEAST) for value in span)
    label = "rms between two systems"
    axes.axvspan(low, high, color="#999999", alpha=0.28, linewidth=0, label=label)


def _draw_line(axes: Axes, line: Line) -> None:
    """One mark per system at the rms, and a whisker to the largest change."""
    y, _, same = line
    order = list(MARKS)
    for entry in same:
        place = order.index(entry.system) - 1 if entry.system in order else 0
        colour = system_colour(entry.system)
        at = y + SPREAD * place
        changes = (entry.rms_change_pa, entry.largest_change_pa)
        rms, largest = (max(KILO * value, LEAST) for value in changes)
        if largest > LEAST:
            axes.plot([rms, largest], [at, at], color=colour, linewidth=0.8)
            axes.plot([largest], [at], color=colour, marker="|", markersize=4)
        axes.plot([rms], [at], **_mark(entry.system))


def _mark(system: str) -> Style:
    return {
        "color": system_colour(system),
        "marker": MARKS.get(system, "o"),
        "markersize": 3.4,
        "markeredgecolor": "white",
        "markeredgewidth": 0.3,
        "linestyle": "",
        "clip_on": False,
    }


def _label(axes: Axes, lines: list[Line], heads: list[tuple[float, str]]) -> None:
    axes.set_yticks([y for y, _, _ in lines], [label for _, label, _ in lines])
    axes.tick_params(axis="y", length=0)
    for y, name in heads:
        place: Style = {"transform": axes.get_yaxis_transform(), "va": "center"}
        axes.text(-0.01, y, name, ha="right", fontweight="bold", **place)
    ticks = [LEAST, 0.01, 0.1, 1.0, 10.0]
    axes.set_xticks(ticks, [f"≤ {LEAST:g}", *(f"{tick:g}" for tick in ticks[1:])])
    axes.set_xlabel("change of the estimate [kPa]: mark rms, whisker to the largest")
    axes.grid(visible=False, axis="y")


def _legend(found: Sequence[SensitivityEntry], axes: Axes) -> list[Artist]:
    """A mark per system, and the band."""
    from matplotlib.lines import Line2D

    systems = dict.fromkeys(entry.system for entry in found)
    marks = [Line2D([], [], label=system_name(system), **_mark(system)) for system in systems]
    return [*marks, *axes.get_legend_handles_labels()[0]]
