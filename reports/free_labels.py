"""Names beside marks of a plot, where they overprint neither marks nor each other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise, product
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from reports.appearance import Style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.transforms import Bbox

Floats = NDArray[np.float64]
Named = tuple[float, float, str]
"""A place in data and its name."""

DISTANCES = (4.0, 6.0, 8.0, 11.0)
"""Between a mark and its name [point], the nearest first."""
SIDES = ((-1, -1), (1, 1), (0, -1), (-1, 0), (1, -1), (-1, 1), (0, 1), (1, 0))
"""Where a name stands from its mark, the preferred first: below at the left."""
ALIGNED_X, ALIGNED_Y = ("center", "left", "right"), ("center", "bottom", "top")
"""Alignment of a name by its side, 0, 1 and -1."""
HALF_MARK = 3.0
"""Half the width of a mark [point]."""
POINTS = 72.0


def name_places(axes: Axes, named: Sequence[Named], marks: Floats, look: Style) -> None:
    """Write names beside their places, without one that would overprint or be read as another's.

    `marks` (n, 2): places in data that a name must not cover, nor a line that is drawn. Positions
    are chosen on the sheet, whose layout is not changed any more after this.
    """
    figure = axes.get_figure(root=True)
    assert figure is not None  # noqa: S101 - axes are on a figure
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    unit = figure.dpi / POINTS
    seen = np.concatenate([axes.transData.transform(marks), *_along_lines(axes, unit)])
    own = axes.transData.transform([(x, y) for x, y, _ in named])
    taken: list[Bbox] = []
    for i, (x, y, text) in enumerate(named):
        for place in _places():
            label = axes.annotate(text, (x, y), textcoords="offset points", **place, **look)
            box = label.get_window_extent()
            is_free = _is_free(box.padded(HALF_MARK * unit), seen, taken, axes.bbox)
            if is_free and _nearest(box, own) == i:
                taken.append(box)
                break
            label.remove()


def _places() -> Iterator[Style]:
    """Where a name may stand from its mark, the preferred first."""
    for distance, (across, up) in product(DISTANCES, SIDES):
        at = (across * distance, up * distance)
        yield {"xytext": at, "ha": ALIGNED_X[across], "va": ALIGNED_Y[up]}


def _along_lines(axes: Axes, unit: float) -> Iterator[Floats]:
    """Places [px] a few points apart along the lines of more than one place."""
    for line in axes.lines:
        path = line.get_transform().transform_path(line.get_path())
        ends = np.asarray(path.vertices, dtype=np.float64)
        if line.get_linestyle() == "None" or len(ends) < 2:
            continue
        for one, other in pairwise(ends):
            count = 2 + int(np.linalg.norm(other - one) / (HALF_MARK * unit))
            yield one + np.linspace(0.0, 1.0, count)[:, None] * (other - one)


def _nearest(box: Bbox, places: Floats) -> int:
    """Number of the place [px] that is nearest to the middle of a name, and read as its mark."""
    middle = (0.5 * (box.x0 + box.x1), 0.5 * (box.y0 + box.y1))
    return int(np.linalg.norm(places - middle, axis=1).argmin())


def _is_free(box: Bbox, seen: Floats, taken: Sequence[Bbox], within: Bbox) -> bool:
    """Whether a name with some room about it is within the axes and covers nothing."""
    is_inside = within.x0 <= box.x0 and box.x1 <= within.x1
    is_inside &= within.y0 <= box.y0 and box.y1 <= within.y1
    covered = (seen >= (box.x0, box.y0)) & (seen <= (box.x1, box.y1))
    return bool(
        is_inside
        and not covered.all(axis=1).any()
        and not any(box.overlaps(other) for other in taken)
    )
