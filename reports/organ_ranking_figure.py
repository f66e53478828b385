"""Who is nearest to the benchmark over the draws of an organ, and why."""

from __future__ import annotations

from importlib.resources.abc import Traversable
from pathlib import Path
from typing import TYPE_CHECKING

from reports import canvas
from reports.appearance import LOOKS
from reports.benchmarks import read
from reports.organ_ranking import INDICES, NAMES, NEAREST
from reports.ranking_study_figure import FUZZY, ranking_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAME = "organ_ranking"
SYSTEMS = FUZZY | {"reading": (NAMES["reading"], LOOKS["reading"].colour)}


def write_figures(folder: Path) -> list[Path]:
    """Draw the tables of a folder as SVG and PDF into it; none without tables."""
    return canvas.write({folder / NAME: lambda: _figure(folder)})


def organ_figures() -> dict[str, bytes]:
    """The figure of the tables that come with the program as SVG, by name; none without tables."""
    svg = canvas.picture(lambda: _figure(None))
    return {} if svg is None else {NAME: svg}


def _figure(folder: Traversable | None) -> Figure | None:
    return ranking_figure(read(NEAREST, folder), read(INDICES, folder), SYSTEMS)
