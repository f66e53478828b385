"""The sheet that figures are drawn on: one style, and SVG that is the same byte by byte."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from reports.letters import extra_files
from study.system.folders import write_bytes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TEXT_WIDTH = 6.69
"""Width of the report's text [inch]."""
RASTER_DPI = 200
TEXT_SIZE = 8.0
"""Size of all text [point]: figures are printed as large as they are drawn."""
FAMILIES = ("STIXGeneral", "DejaVu Sans")
"""Like the text, and every glyph of the second."""
NO_GLYPH = "Glyph .* missing"
Drawn = TypeVar("Drawn")
STYLE: dict[str, object] = {
    "svg.hashsalt": "liver-study",
    "text.parse_math": False,  # names come from users
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
def style(*families: str) -> Iterator[None]:
    """The report's style while a figure is drawn and saved, with further fonts behind its own.

    A name in a script that all of these lack is drawn as boxes, without a warning.
    """
    import matplotlib as mpl

    with mpl.rc_context(STYLE | {"font.family": [*FAMILIES, *families]}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=NO_GLYPH)
        yield


def more_families() -> list[str]:
    """Names of the fonts of `reports.letters`, made known to matplotlib."""
    from matplotlib.font_manager import fontManager

    files = [str(path) for path in extra_files()]
    known = {entry.fname for entry in fontManager.ttflist}
    for file in files:
        if file not in known:
            fontManager.addfont(file)
    names = {entry.fname: entry.name for entry in fontManager.ttflist}
    return list(dict.fromkeys(names[file] for file in files))


def legend_above(figure: Figure, axes: Axes, columns: int, **look: float) -> None:
    """The legend of what is drawn in `axes`, in as many columns as fit above the figure."""
    handles, labels = axes.get_legend_handles_labels()
    for count in range(columns, 0, -1):
        legend = figure.legend(handles, labels, loc="outside upper center", ncols=count, **look)
        if count == 1 or legend.get_window_extent().width <= figure.bbox.width:
            return
        legend.remove()


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


def drawn(draw: Callable[[], Figure]) -> bytes:
    """What a function draws in the report's style as SVG."""
    return _in_letters(lambda: svg(draw()))


def picture(draw: Callable[[], Figure | None]) -> bytes | None:
    """What a function draws in the report's style as SVG; None where it draws nothing."""
    return _in_letters(lambda: None if (figure := draw()) is None else svg(figure))


def write(drawings: Mapping[Path, Callable[[], Figure | None]]) -> list[Path]:
    """Write what functions draw as SVG and PDF beside their stems; the files written."""

    def both(draw: Callable[[], Figure | None]) -> dict[str, bytes]:
        figure = draw()
        return {} if figure is None else {".svg": svg(figure), ".pdf": pdf(figure)}

    files: dict[Path, bytes] = {}
    for stem, draw in drawings.items():
        found = _in_letters(partial(both, draw))
        files |= {stem.with_suffix(ending): content for ending, content in found.items()}
    for path, content in files.items():
        write_bytes(path, content)
    return list(files)


def _in_letters(make: Callable[[], Drawn]) -> Drawn:
    """What a function makes in the report's style, in more fonts where its own lack a letter.

    Only there, so that other figures are the same bytes whether more fonts are installed or not.
    """
    with style(), warnings.catch_warnings(record=True) as told:
        warnings.filterwarnings("always", message=NO_GLYPH)
        made = make()
    families = more_families() if any(re.match(NO_GLYPH, str(one.message)) for one in told) else []
    if not families:
        return made
    with style(*families):
        return make()


def blank(axes: Axes) -> None:
    """Hide the frame, ticks and grid of axes that hold a picture."""
    axes.set_axis_off()
    axes.set_aspect("equal")
