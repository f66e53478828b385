"""The deformed organ in each model at peak load, and how far each is from the reference."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from reports import canvas
from reports.appearance import Style, labels
from reports.camera import Camera, facing_tool
from reports.digits import fixed, short, significant
from reports.renders import Job, Pictures
from study.results.folder import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

PEAK = 0
MILLI = 1e3
COLUMNS = 3
TALLEST_PANEL = 2.0
"""Height of a panel [inch], however tall the organ."""
SHOWN_DEFORMATION = 0.15
"""Largest drawn displacement as a share of the organ's extent, before rounding."""
SCALE_LIMIT = 3.0
"""The colour scale ends at most at this multiple of the first model's largest value."""
ARROW_SHARE = 0.22
TRIAD = {"L": (1.0, 0.0, 0.0), "P": (0.0, 1.0, 0.0), "S": (0.0, 0.0, 1.0)}
"""Left, posterior, superior: the positive directions of x, y, z."""


@dataclass(frozen=True)
class Panel:
    """One surface: title, vertices [m] (s, 3), and what colours it [m] (s,)."""

    title: str
    points: Floats
    values: Floats


@dataclass(frozen=True)
class Sheet:
    """Panels on one colour scale that ends at `limit` [m]; `label` of the scale."""

    panels: list[Panel]
    limit: float
    label: str
    colours: str


@dataclass(frozen=True)
class Views:
    """What is drawn of the organ: its surfaces, on sheets, as a camera sees them.

    `anchors` (probes + 1,): vertices at the tool and at the control points; `hidden`: whether they
    lie on the far side; `inclusions` [m] (k, m, 3): points of the surface of each, at rest.
    """

    camera: Camera
    triangles: NDArray[np.int64]
    factor: float
    push: Floats
    anchors: NDArray[np.int64]
    hidden: NDArray[np.bool_]
    probes: tuple[str, ...]
    sheets: list[Sheet]
    inclusions: Floats


def drawable(results: Results) -> list[str]:
    """Models whose field at peak load is finite, in order."""
    fields, names = results.fields, [model.name for model in results.record.models]
    return [name for name in names if name in fields and np.isfinite(fields[name][PEAK]).all()]


def views(results: Results) -> Views | None:
    """What to draw of a scene with fields, or None if there is nothing."""
    names = drawable(results)
    if not names or not results.scene.renders:
        return None
    fields, named = results.fields, labels(results)
    rest, triangles = fields["points"], fields["triangles"]
    peak = {name: fields[name][PEAK] for name in names}
    lengths = [_length(u) for u in peak.values()]
    limit, factor = _limit(lengths), exaggeration(rest, lengths)
    panels = [Panel(named[n], rest + factor * u, _length(u)) for n, u in peak.items()]
    sheets = [Sheet(panels, limit, "displacement [mm]", "YlGnBu")]
    if "fem" in peak and len(peak) > 1:
        sheets.append(_differences(rest, peak, named))
    centre, push = fields["tool"]
    everything = np.concatenate([rest, *(panel.points for panel in panels)])
    anchors = _nearest(rest, np.vstack([centre, fields["probes"]]))
    camera = facing_tool(everything, centre, push)
    return Views(
        camera=camera,
        triangles=triangles,
        factor=factor,
        push=push,
        anchors=anchors,
        hidden=_normals(rest, triangles)[anchors] @ camera.toward < 0.0,
        probes=results.record.probes,
        sheets=sheets,
        inclusions=fields.get("inclusions", np.zeros((0, 0, 3))),
    )


def exaggeration(rest: Floats, lengths: list[Floats]) -> float:
    """By which displacements of these lengths [m] (s,) are drawn larger on points [m] (s, 3)."""
    extent = float(np.ptp(rest, axis=0).max())
    return _round_down(SHOWN_DEFORMATION * extent / _limit(lengths))


def _differences(rest: Floats, peak: dict[str, Floats], named: dict[str, str]) -> Sheet:
    others = {name: _length(u - peak["fem"]) for name, u in peak.items() if name != "fem"}
    panels = [Panel(f"{named[n]} − finite elements", rest, d) for n, d in others.items()]
    limit = min(max(float(d.max()) for d in others.values()), _reach(peak["fem"]))
    return Sheet(panels, limit, "difference [mm]", "magma_r")


def _reach(field: Floats) -> float:
    return SCALE_LIMIT * float(_length(field).max())


def _limit(lengths: list[Floats]) -> float:
    """End of the colour scale [m]: the largest value, unless some model is far beyond the first."""
    largest = [float(values.max()) for values in lengths]
    return min(max(largest), SCALE_LIMIT * largest[0]) or 1.0


def _round_down(value: float) -> float:
    """The next of 1, 2, 5, 10, 20, ... below, but never less than one."""
    if value <= 1.0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(step for step in (1.0, 2.0, 5.0) if step * power <= value))


def job(views: Views) -> Job:
    """Job that renders the surfaces of all sheets."""
    panels = [(panel, sheet) for sheet in views.sheets for panel in sheet.panels]
    return Job(
        points=np.stack([panel.points for panel, _ in panels]),
        colours=np.stack([_colours(panel.values, sheet) for panel, sheet in panels]),
        triangles=views.triangles,
        camera=views.camera,
    )


def field_figures(views: Views, pictures: Pictures) -> list[bytes]:
    """Figures of the deformed organ and of its differences as SVG, one per sheet."""
    figures, first = [], 0
    for sheet in views.sheets:
        last = first + len(sheet.panels)
        chosen = None if pictures.pixels is None else pictures.pixels[first:last]
        with canvas.style():
            figures.append(canvas.svg(_figure(views, sheet, replace(pictures, pixels=chosen))))
        first = last
    return figures


def _figure(views: Views, sheet: Sheet, pictures: Pictures) -> Figure:
    count = len(sheet.panels) + 1  # the last one is the key
    rows = -(-count // COLUMNS)
    camera = views.camera
    as_wide = canvas.TEXT_WIDTH / COLUMNS * camera.half_height / camera.half_width
    panel_height = min(as_wide, TALLEST_PANEL)
    figure = canvas.sheet(rows * (panel_height + 0.22))
    grid = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
    for i, (axes, panel) in enumerate(zip(grid, sheet.panels, strict=False)):
        _frame(axes, camera)
        axes.set_title(panel.title, pad=2)
        if pictures.pixels is None:
            _draw_flat(axes, views, panel, sheet)
        else:
            axes.imshow(pictures.pixels[i], extent=camera.extent, interpolation="none")
        _mark(axes, views, panel.points[views.anchors])
    for axes in grid[count - 1 :]:
        _frame(axes, camera)
    _draw_key(grid[count - 1], views, sheet)
    return figure


def _frame(axes: Axes, camera: Camera) -> None:
    left, right, bottom, top = camera.extent
    axes.set(xlim=(left, right), ylim=(bottom, top))
    canvas.blank(axes)


def _draw_flat(axes: Axes, views: Views, panel: Panel, sheet: Sheet) -> None:
    """Triangles that face the eye, the farthest first."""
    from matplotlib.collections import PolyCollection

    corners = panel.points[views.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing = normals @ views.camera.toward / np.maximum(_length(normals), 1e-300)
    front = np.flatnonzero(facing > 0.0)
    order = front[np.argsort(views.camera.depth(corners[front].mean(axis=1)), kind="stable")]
    shares = panel.values[views.triangles[order]].mean(axis=1)
    shade = (0.55 + 0.45 * facing[order])[:, np.newaxis]
    colours = _colours(shares, sheet) / 255.0 * shade
    outlines = list(views.camera.project(corners[order]))
    axes.add_collection(
        PolyCollection(outlines, facecolors=colours, edgecolors=colours, lw=0.2, rasterized=True)
    )


def _mark(axes: Axes, views: Views, places: Floats) -> None:
    """The tool's arrow and numbered control points, which move with the surface."""
    camera = views.camera
    for outline in views.inclusions:
        _mark_inclusion(axes, camera.project(outline))
    length = ARROW_SHARE * 2.0 * camera.half_width
    shaft = camera.project(np.stack([places[0] - length * views.push, places[0]]))
    arrow = {"arrowstyle": "-|>", "color": "#D00000", "lw": 1.4, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", tuple(shaft[1]), tuple(shaft[0]), arrowprops=arrow)
    for i, place in enumerate(camera.project(places[1:])):
        _mark_point(axes, place, str(i + 1), bool(views.hidden[i + 1]))


def _mark_inclusion(axes: Axes, seen: Floats) -> None:
    """The outline of a region inside, which does not move with the surface."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(seen).vertices
    closed = seen[[*hull, hull[0]]]
    axes.plot(closed[:, 0], closed[:, 1], ":", color="black", lw=1.1)


def _mark_point(axes: Axes, place: Floats, text: str, hidden: bool) -> None:
    face = "none" if hidden else "white"
    axes.plot(*place, "o", ms=3.0, mfc=face, mec="black", mew=0.6, clip_on=False)
    halo = {"facecolor": "white", "edgecolor": "none", "pad": 0.4, "alpha": 0.75}
    axes.annotate(
        text, tuple(place), (3, 3), textcoords="offset points", fontsize=6, bbox=halo, va="bottom"
    )


def _draw_key(axes: Axes, views: Views, sheet: Sheet) -> None:
    """Colour scale, triad, scale bar, arrow and control points."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    scale = ScalarMappable(Normalize(0.0, MILLI * sheet.limit), sheet.colours)
    bar = axes.inset_axes((0.08, 0.86, 0.84, 0.09))
    is_clipped = any(panel.values.max() > sheet.limit * (1 + 1e-9) for panel in sheet.panels)
    axes.figure.colorbar(
        scale, cax=bar, orientation="horizontal", extend="max" if is_clipped else "neither"
    )
    bar.set_xlabel(sheet.label, labelpad=1)
    bar.grid(visible=False)
    _draw_triad(axes, views.camera)
    _draw_scale_bar(axes, views.camera)
    names = [f"{i}  {short(name, 20)}" for i, name in enumerate(views.probes[:6], 1)]
    names += ["…"] if len(views.probes) > len(names) else []
    names += ["⋯  inclusion, at rest"] if len(views.inclusions) else []
    text = "\n".join(["→  tool", *names])
    axes.text(0.5, 0.52, text, transform=axes.transAxes, va="top", fontsize=6.5, linespacing=1.25)


def _draw_triad(axes: Axes, camera: Camera) -> None:
    """Left, posterior and superior as they lie in the pictures."""
    origin = np.array([-0.55 * camera.half_width, -0.45 * camera.half_height])
    length = 0.3 * min(camera.half_width, camera.half_height)
    arrow: Style = {"arrowstyle": "->", "lw": 0.8, "shrinkA": 0, "shrinkB": 0}
    for name, direction in TRIAD.items():
        step = length * (np.array(direction) @ np.stack([camera.right, camera.up], axis=1))
        axes.annotate("", tuple(origin + step), tuple(origin), arrowprops=arrow)
        x, y = origin + 1.35 * step
        axes.text(x, y, name, ha="center", va="center", fontsize=6.5)


def _draw_scale_bar(axes: Axes, camera: Camera) -> None:
    length = _scale_length(camera.half_width)
    left, level = -0.9 * camera.half_width, -0.86 * camera.half_height
    axes.plot([left, left + length], [level, level], color="black", lw=1.5, solid_capstyle="butt")
    label = f"{significant(MILLI * length, 1)} mm"
    axes.annotate(
        label, (left + length, level), (3, 0), textcoords="offset points", va="center", fontsize=6.5
    )


def _scale_length(half_width: float) -> float:
    """A round length [m] of about a third of the width."""
    target = 0.6 * half_width
    power = 10.0 ** np.floor(np.log10(target))
    return float(power * max(step for step in (1.0, 2.0, 5.0) if step * power <= target))


def _colours(values: Floats, sheet: Sheet) -> NDArray[np.uint8]:
    """Colour (n, 3) of values [m] (n,) on a sheet's scale."""
    from matplotlib import colormaps

    shares = np.clip(values / sheet.limit, 0.0, 1.0)
    colours: NDArray[np.uint8] = colormaps[sheet.colours](shares, bytes=True)[:, :3]
    return colours


def _length(vectors: Floats) -> Floats:
    return np.asarray(np.linalg.norm(vectors, axis=-1))


def _nearest(points: Floats, places: Floats) -> NDArray[np.int64]:
    return np.array([np.argmin(_length(points - place)) for place in places])


def _normals(points: Floats, triangles: NDArray[np.int64]) -> Floats:
    """Sum of the normals of the triangles at each vertex, (s, 3), not of unit length."""
    corners = points[triangles]
    of_triangles = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(points)
    for i in range(3):
        np.add.at(normals, triangles[:, i], of_triangles)
    return normals


def explain(views: Views) -> dict[str, str]:
    """Exaggeration and direction of the push, as the caption of the pictures says them."""
    return {"factor": fixed(views.factor, 0), "push": _direction(views.push)}


def _direction(push: Floats) -> str:
    return "(" + ", ".join(fixed(float(x), 2) for x in push) + ")"
