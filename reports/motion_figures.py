"""Motion of the control points: over time and in the phase plane (the paper's Fig. 5)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from reports import canvas
from reports.appearance import look
from reports.digits import short
from study.results.folder import Results, Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

PROBES_PER_FIGURE = 3
MOST_PROBES = 9
ROW_HEIGHT = 1.95
LEGEND_HEIGHT = 0.3
MILLI = 1e3
MARGIN = 0.06
LEGEND = {"handlelength": 3.2, "columnspacing": 1.4}


@dataclass(frozen=True)
class Curve:
    """Motion of one model at one probe: time [s], displacement [m], velocity [m/s], (samples,).

    `bounds` are the same three of the runs at the ends of a stiffness interval.
    """

    model: str
    finished: bool
    motion: Floats
    bounds: tuple[Floats, ...] = ()


def curves(results: Results, probe: str) -> list[Curve]:
    """Curves of every model at a probe, in the order of the models."""
    found = []
    for record in results.numbers["models"]:
        name = record["name"]
        rows = _columns(results.tables["curves"], name, probe)
        if rows.size:
            band = _columns(results.tables["bands"], name, probe)
            bounds = (band[[0, 1, 3]], band[[0, 2, 4]]) if band.size else ()
            found.append(Curve(name, record["status"] == "finished", rows, bounds))
    return found


def peak(results: Results, model: str, probe: str) -> float | None:
    """Largest displacement [m] of a model at a probe along the push, or None without samples."""
    rows = _columns(results.tables["curves"], model, probe)
    return float(np.abs(rows[1]).max()) if rows.size else None


def shown_probes(results: Results) -> list[str]:
    """Probes that are drawn: as many as a reader can take in."""
    probes: list[str] = results.numbers["probes"]
    return probes[:MOST_PROBES]


def motion_figures(results: Results) -> Iterator[bytes]:
    """SVG figures of a few probes each, one row per probe."""
    probes = shown_probes(results)
    for start in range(0, len(probes), PROBES_PER_FIGURE):
        group = probes[start : start + PROBES_PER_FIGURE]
        drawn = {probe: curves(results, probe) for probe in group}
        if any(drawn.values()):
            with canvas.style():
                yield canvas.svg(_figure(drawn))


def _figure(drawn: dict[str, list[Curve]]) -> Figure:
    figure = canvas.sheet(LEGEND_HEIGHT + ROW_HEIGHT * len(drawn))
    grid = figure.subplots(len(drawn), 3, squeeze=False)
    for row, (probe, found) in zip(grid, drawn.items(), strict=True):
        _draw_row(row, found)
        row[0].set_title(short(probe), loc="left", fontweight="bold")
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=5, **LEGEND)
    figure.align_ylabels()
    return figure


def _draw_row(row: Sequence[Axes], found: list[Curve]) -> None:
    """Displacement and velocity over time, velocity over displacement."""
    panels = (
        (row[0], 0, 1, "time [s]", "displacement [mm]"),
        (row[1], 0, 2, "time [s]", "velocity [mm/s]"),
        (row[2], 1, 2, "displacement [mm]", "velocity [mm/s]"),
    )
    for axes, x, y, x_label, y_label in panels:
        for curve in found:
            _draw(axes, curve, x, y)
        axes.set(xlabel=x_label, ylabel=y_label)
        _limit(axes, found, x, y)


def _draw(axes: Axes, curve: Curve, x: int, y: int) -> None:
    this = look(curve.model)
    motion = _scaled(curve.motion)
    axes.plot(motion[x], motion[y], label=this.label, **this.line)
    if not curve.finished:
        axes.plot(motion[x, -1], motion[y, -1], "X", color=this.colour, markersize=6, zorder=4)
    if not curve.bounds:
        return
    lower, upper = (_scaled(bound) for bound in curve.bounds)
    if x == 0:
        axes.fill_between(lower[0], lower[y], upper[y], color=this.colour, alpha=0.18, linewidth=0)
    else:
        for bound in (lower, upper):
            axes.plot(bound[x], bound[y], color=this.colour, linewidth=0.5, alpha=0.5)


def _limit(axes: Axes, found: list[Curve], x: int, y: int) -> None:
    """Limits by the models that finished: one that diverged must not flatten the others."""
    shown = [_scaled(c.motion) for c in found if c.finished] or [_scaled(c.motion) for c in found]
    for index, set_limits in ((x, axes.set_xlim), (y, axes.set_ylim)):
        low = min((float(motion[index].min()) for motion in shown), default=0.0)
        high = max((float(motion[index].max()) for motion in shown), default=0.0)
        room = MARGIN * (high - low) or 1.0
        set_limits((low if index == 0 else low - room), high + room)


def _scaled(motion: Floats) -> Floats:
    return np.asarray(motion * np.array([1.0, MILLI, MILLI])[:, np.newaxis])


def _columns(rows: Sequence[Row], model: str, probe: str) -> Floats:
    """Number columns of a table for one model and probe, (columns, samples)."""
    chosen = [row[2:] for row in rows if row[0] == model and row[1] == probe]
    return np.array(chosen, dtype=np.float64).T
