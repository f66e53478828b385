"""The sheet that figures are drawn on: one style, and SVG that is the same byte by byte."""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from study.folders import write_bytes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TEXT_WIDTH = 6.69
"""Width of the report's text [inch]."""
RASTER_DPI = 200
TEXT_SIZE = 8.0
"""Size of all text [point]: figures are printed as large as they are drawn."""
STYLE: dict[str, object] = {
    "svg.hashsalt": "liver-study",
    "text.parse_math": False,  # names come from users
    "font.family": ["STIXGeneral", "DejaVu Sans"],  # like the text, and every glyph of the second
    "font.size": TEXT_SIZE,
    "axes.titlesize": TEXT_SIZE,
    "axes.labelsize": TEXT_SIZE,
    "xtick.labelsize": TEXT_SIZE,
    "ytick.labelsize": TEXT_SIZE,
    "legend.fontsize": TEXT_SIZE,
    "axes.linewidth": 0.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.5,
    "xtick.major.width": 0.5,
    "ytick.major.width": 0.5,
    "legend.frameon": False,
    "image.cmap": "viridis",
}


@contextmanager
def style() -> Iterator[None]:
    """The report's style while a figure is drawn and saved.

    A name in a script that the font lacks is drawn as boxes, without a warning.
    """
    import matplotlib as mpl

    with mpl.rc_context(STYLE), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        yield


def sheet(height: float, width: float = TEXT_WIDTH) -> Figure:
    """An empty figure; sizes in inches."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), dpi=RASTER_DPI, layout="constrained")


def load() -> None:
    """Load all that an SVG is drawn with, so that processes forked after this have it."""
    with style():
        figure = sheet(0.5)
        figure.subplots().set_title("-")
        svg(figure)


def svg(figure: Figure) -> bytes:
    """The figure as SVG without a date.

    `print_svg` rather than `savefig`, which would draw all of it twice.
    """
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    buffer = io.BytesIO()
    FigureCanvasSVG(figure).print_svg(buffer, metadata={"Date": None})
    return buffer.getvalue()


def pdf(figure: Figure) -> bytes:
    """The figure as PDF without a date."""
    from matplotlib.backends.backend_pdf import FigureCanvasPdf

    buffer = io.BytesIO()
    FigureCanvasPdf(figure).print_pdf(buffer, metadata={"CreationDate": None})
    return buffer.getvalue()


def picture(draw: Callable[[], Figure | None]) -> bytes | None:
    """What a function draws in the report's style as SVG; None where it draws nothing."""
    with style():
        figure = draw()
        return None if figure is None else svg(figure)


def write(drawings: Mapping[Path, Callable[[], Figure | None]]) -> list[Path]:
    """Write what functions draw as SVG and PDF beside their stems; the files written."""
    files: dict[Path, bytes] = {}
    with style():
        for stem, draw in drawings.items():
            figure = draw()
            if figure is not None:
                files |= {stem.with_suffix(".svg"): svg(figure)}
                files |= {stem.with_suffix(".pdf"): pdf(figure)}
    for path, content in files.items():
        write_bytes(path, content)
    return list(files)


def blank(axes: Axes) -> None:
    """Hide the frame, ticks and grid of axes that hold a picture."""
    axes.set_axis_off()
    axes.set_aspect("equal")
