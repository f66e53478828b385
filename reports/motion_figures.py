"""Motion of the control points: over time and in the phase plane (the paper's Fig. 5)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from reports import canvas
from reports.appearance import Look, looks
from reports.digits import short
from study.results import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

PROBES_PER_FIGURE = 3
MOST_PROBES = 9
ROW_HEIGHT = 1.95
LEGEND_HEIGHT, LEGEND_COLUMNS = 0.3, 5
MILLI = 1e3
MARGIN = 0.06
LEGEND = {"handlelength": 3.2, "columnspacing": 1.4}


@dataclass(frozen=True)
class ProbeMotion:
    """Motion of one model at one probe: time [s], displacement [mm], velocity [mm/s], (3, samples).

    `bounds` are the same three of the runs at the ends of a stiffness interval.
    """

    look: Look
    finished: bool
    motion: Floats
    bounds: tuple[Floats, ...] = ()


def motions(results: Results, probe: str) -> list[ProbeMotion]:
    """Motion of every model at a probe, in the order of the models."""
    found, seen = [], looks(results)
    for model in results.record.models:
        curve = results.curve(model.name, probe)
        if curve.time.size:
            motion = _in_milli(curve.time, curve.displacement, curve.velocity)
            bounds = _bounds(results, model.name, probe)
            finished = model.status == "finished"
            found.append(ProbeMotion(seen[model.name], finished, motion, bounds))
    return found


def _bounds(results: Results, model: str, probe: str) -> tuple[Floats, ...]:
    """Motion of the runs at the lower and the upper end of an interval, if there are any."""
    rows = [row[2:] for row in results.bands if row.model == model and row.probe == probe]
    if not rows:
        return ()
    time, *bounds = np.array(rows).T
    return _in_milli(time, *bounds[0::2]), _in_milli(time, *bounds[1::2])


def _in_milli(time: Floats, displacement: Floats, velocity: Floats) -> Floats:
    return np.stack([time, MILLI * displacement, MILLI * velocity])


def peak(results: Results, model: str, probe: str) -> float | None:
    """Largest displacement [m] of a model at a probe along the push, or None without samples."""
    found = results.curve(model, probe).displacement
    return float(np.abs(found).max()) if found.size else None


def shown_probes(results: Results) -> tuple[str, ...]:
    """Control points that are drawn: as many as a reader can take in."""
    return results.record.probes[:MOST_PROBES]


def probe_groups(results: Results) -> list[tuple[str, ...]]:
    """The control points that are drawn, by figure."""
    probes = shown_probes(results)
    starts = range(0, len(probes), PROBES_PER_FIGURE)
    return [probes[start : start + PROBES_PER_FIGURE] for start in starts]


def motion_figures(results: Results) -> Iterator[bytes]:
    """Figures of the motion as SVG, of a few probes each, one row per probe."""
    for group in probe_groups(results):
        drawn = {probe: motions(results, probe) for probe in group}
        if any(drawn.values()):
            yield canvas.drawn(partial(_figure, drawn))


def _figure(drawn: dict[str, list[ProbeMotion]]) -> Figure:
    figure = canvas.sheet(LEGEND_HEIGHT + ROW_HEIGHT * len(drawn))
    grid = figure.subplots(len(drawn), 3, squeeze=False)
    for row, (probe, found) in zip(grid, drawn.items(), strict=True):
        _draw_row(row, found)
        row[0].set_title(short(probe), loc="left", fontweight="bold")
    canvas.legend_above(figure, grid[0, 0], LEGEND_COLUMNS, **LEGEND)
    figure.align_ylabels()
    return figure


def _draw_row(row: Sequence[Axes], found: list[ProbeMotion]) -> None:
    """Displacement and velocity over time, velocity over displacement."""
    panels = (
        (row[0], 0, 1, "time [s]", "displacement [mm]"),
        (row[1], 0, 2, "time [s]", "velocity [mm/s]"),
        (row[2], 1, 2, "displacement [mm]", "velocity [mm/s]"),
    )
    for axes, x, y, x_label, y_label in panels:
        draw_motion(axes, found, x, y, x_label, y_label)


def draw_motion(
    axes: Axes, found: list[ProbeMotion], x: int, y: int, x_label: str, y_label: str
) -> None:
    """Row `y` of each motion over row `x`: time, displacement, velocity are 0, 1, 2."""
    for one in found:
        _draw(axes, one, x, y)
    axes.set(xlabel=x_label, ylabel=y_label)
    _limit(axes, found, x, y)


def _draw(axes: Axes, one: ProbeMotion, x: int, y: int) -> None:
    motion, colour = one.motion, one.look.colour
    axes.plot(motion[x], motion[y], label=one.look.label, **one.look.line)
    if not one.finished:
        axes.plot(motion[x, -1], motion[y, -1], "X", color=colour, markersize=6, zorder=4)
    if one.bounds and x == 0:
        lower, upper = one.bounds
        axes.fill_between(lower[0], lower[y], upper[y], color=colour, alpha=0.18, linewidth=0)
    elif one.bounds:
        for bound in one.bounds:
            axes.plot(bound[x], bound[y], color=colour, linewidth=0.5, alpha=0.5)


def _limit(axes: Axes, found: list[ProbeMotion], x: int, y: int) -> None:
    """Limits by the models and ends of intervals that finished: those that diverged are larger."""
    finished = [one for one in found if one.finished] or found
    shown = [one.motion for one in finished]
    shown += [b for one in finished for b in one.bounds if b.shape == one.motion.shape]
    for index, set_limits in ((x, axes.set_xlim), (y, axes.set_ylim)):
        low = min((float(motion[index].min()) for motion in shown), default=0.0)
        high = max((float(motion[index].max()) for motion in shown), default=0.0)
        room = MARGIN * (high - low) or 1.0
        set_limits((low if index == 0 else low - room), high + room)
