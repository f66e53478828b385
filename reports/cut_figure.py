"""A cut through the tool's axis: each model's displacement, and the reference's levels on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from reports import canvas
from reports.appearance import labels
from reports.field_figures import BLUE, HELD, PEAK, RED, colour_limit, drawable
from study.results import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.tri import Triangulation

Floats = NDArray[np.float64]

COLUMNS = 3
LEVELS = np.array([0.0, 0.02, 0.05, 0.1, 0.2, 0.35, 0.55, 0.75, 1.0])
"""Shares of the largest displacement: it falls off fast round the tool."""
TALLEST = 2.0
"""Height of a panel [inch], however deep the organ."""
MARGIN = 0.08
ARROW = 0.25
"""Length of the arrow over the height of the cut."""
MILLI = 1e3


@dataclass(frozen=True)
class Cut:
    """Section in its own plane, the push downward: `places` [mm] (c, 2), lengths [mm] by label.

    `tool` [mm] (2,) and its `radius` [mm]; `held` [mm] (h, 2): where a support is near the plane.
    """

    places: Floats
    triangles: NDArray[np.int64]
    lengths: dict[str, Floats]
    tool: Floats
    radius: float
    held: Floats


def section(results: Results) -> Cut | None:
    """The section of a run, its reference first; None for a run without fields to draw."""
    fields, named = results.fields, labels(results)
    names = [n for n in drawable(results) if f"cut.{n}" in fields]
    if not names or not len(fields.get("cut_triangles", ())) or not results.scene.renders:
        return None
    references = [name for name in results.record.references if name in names]
    names = [*references[:1], *(n for n in names if n not in references[:1])]
    centre, push = fields["tool"]
    axes = _axes(fields["cut"] - centre, push)

    def flat(points: Floats) -> Floats:
        return np.asarray(MILLI * ((points - centre) @ axes[:2].T))

    facets = fields["points"][fields["triangles"]]
    near = np.abs((facets.mean(axis=1) - centre) @ axes[2]) < 0.5 * _edge(facets)
    return Cut(
        flat(fields["cut"]),
        fields["cut_triangles"],
        {named[n]: MILLI * np.linalg.norm(fields[f"cut.{n}"][PEAK], axis=1) for n in names},
        np.zeros(2),
        MILLI * results.scene.tool.radius,
        flat(facets[near & (fields["held"] > HELD)].mean(axis=1)),
    )


def _axes(offsets: Floats, push: Floats) -> Floats:
    """Rightward, upward (against the push) and normal unit vectors (3, 3) of the plane of a cut."""
    beside = offsets - np.outer(offsets @ push, push)
    right = beside[np.linalg.norm(beside, axis=1).argmax()]
    right = right / np.linalg.norm(right)
    right = right if right[np.abs(right).argmax()] > 0.0 else -right
    return np.stack([right, -push, np.cross(right, -push)])


def _edge(facets: Floats) -> float:
    """Mean length of the edges of facets (m, 3, 3)."""
    return float(np.linalg.norm(facets - np.roll(facets, 1, axis=1), axis=2).mean())


def cut_figure(results: Results) -> bytes | None:
    """A panel per model as SVG; None where there is no cut."""
    found = section(results)
    return None if found is None else canvas.picture(lambda: _figure(found))


def _figure(found: Cut) -> Figure:
    from matplotlib.tri import Triangulation

    low, high = found.places.min(axis=0), found.places.max(axis=0)
    low, high = low - MARGIN * (high - low), high + MARGIN * (high - low)
    high[1] += ARROW * float(np.ptp(found.places[:, 1]))
    width, height = high - low
    rows = -(-len(found.lengths) // COLUMNS)
    panel = min(canvas.TEXT_WIDTH / COLUMNS * height / width, TALLEST)
    figure = canvas.sheet(rows * (panel + 0.2) + 0.5)
    grid = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
    plane = Triangulation(*found.places.T, found.triangles)
    first = next(iter(found.lengths.values()))
    levels = LEVELS * colour_limit(list(found.lengths.values()))
    for axes, (name, lengths) in zip(grid, found.lengths.items(), strict=False):
        _draw(axes, plane, lengths, levels)
        if lengths is not first:
            _lines(axes, plane, first, levels)
        _act(axes, found)
        axes.set_title(name, pad=2, loc="left")
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    for axes in grid:
        canvas.blank(axes)
    _scale(figure, list(grid), levels, list(found.lengths.values()))
    return figure


def _draw(axes: Axes, plane: Triangulation, lengths: Floats, levels: Floats) -> None:
    from matplotlib.colors import BoundaryNorm

    norm = BoundaryNorm(levels, 256)
    axes.tricontourf(plane, lengths, levels=levels, cmap="YlGnBu", norm=norm, extend="max")
    axes.tricontour(plane, lengths, levels=levels[1:], colors="#222222", linewidths=0.4)
    for ends in _rim(plane.triangles):
        axes.plot(plane.x[ends], plane.y[ends], color="#222222", lw=0.8)


def _rim(triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    """Edges (e, 2) of one triangle alone."""
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    found, count = np.unique(edges, axis=0, return_counts=True)
    return np.asarray(found[count == 1])


def _lines(axes: Axes, plane: Triangulation, reference: Floats, levels: Floats) -> None:
    """Levels of the reference: dashed, on a white rim."""
    for colour, width, dashes in (("white", 2.2, "-"), ("#D55E00", 1.1, (0, (4, 1.5)))):
        axes.tricontour(
            plane,
            reference,
            levels=levels[1:],
            colors=colour,
            linewidths=width,
            linestyles=[dashes],
        )


def _act(axes: Axes, found: Cut) -> None:
    """The tool's face and push, and supports."""
    x, y = found.tool
    axes.plot([x - found.radius, x + found.radius], [y, y], color=RED, lw=1.6)
    reach = ARROW * float(np.ptp(found.places[:, 1]))
    arrow = {"arrowstyle": "-|>", "color": RED, "lw": 1.2, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", (x, y), (x, y + reach), arrowprops=arrow, annotation_clip=False)
    axes.plot(found.held[:, 0], found.held[:, 1], "^", color=BLUE, ms=2.6, mew=0.0)


def _scale(figure: Figure, axes: list[Axes], levels: Floats, lengths: list[Floats]) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import BoundaryNorm

    is_clipped = max(float(one.max()) for one in lengths) > levels[-1] * (1.0 + 1e-9)
    scale = ScalarMappable(BoundaryNorm(levels, 256), "YlGnBu")
    bar = figure.colorbar(
        scale,
        ax=axes,
        orientation="horizontal",
        extend="max" if is_clipped else "neither",
        aspect=50,
        shrink=0.6,
        format="%.2g",
    )
    bar.ax.grid(visible=False)
    bar.set_label("displacement magnitude [mm]", labelpad=1)
