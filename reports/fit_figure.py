"""A measured curve, a model fitted to it, and what is left."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from reports import canvas
from reports.benchmarks import read

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAME = "fit"
HEIGHT = 3.4
QUANTITIES = {"m": ("displacement", "mm", 1e3), "N": ("force", "N", 1.0)}
"""Name, unit and scale on the axis, by the unit of the curve."""


def write_figure(folder: Path) -> list[Path]:
    """Draw the curve that `fit` wrote into a folder as SVG and PDF into it."""
    return canvas.write({folder / NAME: lambda: _figure(folder)})


def _figure(folder: Path) -> Figure | None:
    lines = read(NAME, folder)
    if not lines:
        return None
    name, unit, scale = QUANTITIES[lines[0]["unit"]]
    times = np.array([float(line["time_s"]) for line in lines])
    measured, found = (
        scale * np.array([float(line[column]) for line in lines])
        for column in ("measured", "found")
    )
    spread = scale * np.array([float(line["uncertainty"] or 0.0) for line in lines])
    figure = canvas.sheet(HEIGHT)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.0))
    upper.errorbar(times, measured, 2.0 * spread, fmt="o", color="#0072B2", markersize=3, zorder=2)
    upper.plot(times, found, color="#000000", linewidth=1.3, zorder=3)
    upper.plot([], [], "o", color="#0072B2", markersize=3, label="measured ± twice its uncertainty")
    upper.plot([], [], color="#000000", linewidth=1.3, label="fitted model")
    upper.set_ylabel(f"{name} [{unit}]")
    upper.legend()
    lower.axhline(0.0, color="#777777", linewidth=0.8)
    lower.errorbar(times, found - measured, 2.0 * spread, fmt="o", color="#0072B2", markersize=3)
    lower.set_ylabel(f"residual [{unit}]")
    lower.set_xlabel("time [s]")
    return figure
