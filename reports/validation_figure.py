"""Models beside measurements: force of cylinders, sag of a beam, beads in a cube."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reports import canvas
from reports.benchmarks import Line
from reports.validation import CANTILEVER, CUBE, of_body, of_cylinders, summed, table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

HEIGHT = 2.7
COLOURS = ("#777777", "#000000", "#E69F00", "#0072B2", "#D55E00")
BAND = "#dddddd"
LOWEST, HIGHEST = -60.0, 60.0
"""[%] of the force that is shown; what lies beyond is marked at the edge."""
TIP, BEADS = "tip deflection, mean of markers", "rms residual of the beads"


def validation_figure() -> bytes | None:
    """Figure of the table that comes with the program as SVG; None without a table."""
    return canvas.picture(lambda: _figure(table()))


def _figure(lines: list[Line]) -> Figure | None:
    if not lines:
        return None
    models = list(dict.fromkeys(line["model"] for line in lines))
    colours = dict(zip(models, COLOURS, strict=False))
    figure = canvas.sheet(HEIGHT)
    left, middle, right = figure.subplots(1, 3, width_ratios=(1.5, 0.8, 1.3))
    _cylinders(left, lines, colours)
    _beam(middle, lines, colours)
    _cube(right, lines, colours)
    handles, labels = left.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(models))
    return figure


def _cylinders(axes: Axes, lines: list[Line], colours: dict[str, str]) -> None:
    """Median and range over materials of the force less that measured, by strain."""
    found = {key: summed(own) for key, own in of_cylinders(lines, "bonded").items()}
    quantities = list(dict.fromkeys(quantity for _, quantity in found))
    for k, (model, colour) in enumerate(colours.items()):
        shift = 0.16 * (k - 0.5 * (len(colours) - 1))
        label: str | None = model
        for x, quantity in enumerate(quantities):
            one = found.get((model, quantity))
            if one is None:
                continue
            middle = float(np.clip(100.0 * one.difference, LOWEST, HIGHEST))
            ends = np.clip([100.0 * one.least, 100.0 * one.largest], LOWEST, HIGHEST)
            axes.plot([x + shift] * 2, ends, color=colour, linewidth=1.0)
            mark = "o" if middle == 100.0 * one.difference else "^"
            axes.plot(x + shift, middle, mark, color=colour, markersize=4, label=label)
            label = None
    for x, quantity in enumerate(quantities):
        spread = [one.uncertainty for key, one in found.items() if one and key[1] == quantity]
        if spread:
            axes.fill_between([x - 0.45, x + 0.45], -200 * spread[0], 200 * spread[0], color=BAND)
    axes.set_xticks(range(len(quantities)), [name.removeprefix("force at ") for name in quantities])
    axes.set_xlabel("compression of the cylinder, faces bonded")
    axes.set_ylabel("force, model − measured [%]")
    axes.set_ylim(1.05 * LOWEST, 1.05 * HIGHEST)


def _beam(axes: Axes, lines: list[Line], colours: dict[str, str]) -> None:
    """Tip of the beam under its weight, predicted, less that measured."""
    own = [line for line in of_body(lines, CANTILEVER, TIP) if line["case"] == "weight alone"]
    for k, line in enumerate(own):
        if line["found"]:
            off = float(line["found"]) - float(line["measured"])
            error = float(line["numerical"] or 0.0)
            axes.errorbar(k, off, yerr=error, fmt="o", color=colours[line["model"]], markersize=4)
    spread = 2.0 * float(own[0]["uncertainty"]) if own else 0.0
    axes.axhspan(-spread, spread, color=BAND, zorder=0)
    axes.set_xticks([])
    axes.set_xlabel("beam under its weight")
    axes.set_ylabel("tip deflection, model − measured [mm]")


def _cube(axes: Axes, lines: list[Line], colours: dict[str, str]) -> None:
    """Rms error of the displaced beads, filled where the plate holds its face."""
    own = of_body(lines, CUBE, BEADS)
    cases = list(dict.fromkeys(line["case"] for line in own))
    names = list(colours)
    for line in own:
        if not line["found"]:
            continue
        bonded = line["faces"] == "bonded"
        x = cases.index(line["case"]) + 0.16 * (names.index(line["model"]) - 2)
        face = colours[line["model"]] if bonded else "white"
        axes.plot(
            x + (-0.03 if bonded else 0.03),
            float(line["found"]),
            "o",
            color=colours[line["model"]],
            markerfacecolor=face,
            markersize=4,
        )
    spread = float(own[0]["uncertainty"]) if own else 0.0
    axes.axhspan(0.0, spread, color=BAND, zorder=0)
    axes.set_xticks(range(len(cases)), cases)
    axes.set_xlabel("nominal compression of the cube")
    axes.set_ylabel("beads, rms residual [mm]")
    axes.set_ylim(bottom=0.0)
