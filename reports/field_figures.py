"""The scene: the deformed organ with what holds and pushes it; and where models part from it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from reports import canvas
from reports.appearance import Style, labels
from reports.camera import Camera, facing_tool
from reports.differences import elements
from reports.digits import fixed, short, significant
from reports.renders import Job, Pictures
from study.results import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

PEAK = 0
MILLI = 1e3
COLUMNS = 3
TALLEST_PANEL = 1.9
"""Height of a panel [inch], however tall the organ."""
SHOWN_DEFORMATION = 0.15
"""Largest drawn displacement as a share of the organ's extent, before rounding."""
SCALE_LIMIT = 3.0
"""The colour scale ends at most at this multiple of the first model's largest value."""
SCENE_WIDTH = 2.44
"""Width of the picture of the scene [inch]."""
KEY_HEIGHT = 1.0
RED, BLUE = "#D00000", "#0072B2"
HELD, LOADED = 0.5, 0.02
"""Share of a triangle's area that is held, or loaded, from which on it is marked."""
ROUND = 48
"""Points of the outline of a tool."""
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
    """Panels on one colour scale that ends at `limit` [m]; `label` of the scale.

    `is_scene`: one picture with all that acts on the organ, else panels side by side.
    """

    panels: list[Panel]
    limit: float
    label: str
    colours: str
    is_scene: bool = False


@dataclass(frozen=True)
class Views:
    """The surfaces of the organ on sheets, as a camera sees them.

    `anchors` (probes + 1,): vertices at the tool and at the control points; `hidden`: whether they
    lie on the far side; `inclusions` [m] (k, m, 3): points of the surface of each, at rest; `ways`
    [m] (k, m, 3): places of each tool that travels, at rest; `held` and `loaded` (m,): share of the
    area of each triangle; `radius` [m] of the tool; `shown`: label of the model that is deformed.
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
    ways: Floats
    held: Floats
    loaded: Floats
    radius: float
    shown: str


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
    factor = exaggeration(rest, lengths)
    first = names[0]
    panel = Panel(named[first], rest + factor * peak[first], lengths[0])
    sheets = [Sheet([panel], float(lengths[0].max()) or 1.0, "displacement [mm]", "YlGnBu", True)]
    reference = elements(results)
    if reference in peak and len(peak) > 1:
        sheets.append(_differences(rest, peak, named, reference))
    centre, push = fields["tool"]
    everything = np.concatenate([rest, panel.points])
    none = np.zeros(len(triangles))
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
        ways=fields.get("ways", np.zeros((0, 0, 3))),
        held=fields.get("held", none),
        loaded=fields.get("loaded", none),
        radius=results.scene.tool.radius,
        shown=named[first],
    )


def exaggeration(rest: Floats, lengths: list[Floats]) -> float:
    """Factor by which displacements of lengths [m] (s,) are drawn larger on points [m] (s, 3)."""
    extent = float(np.ptp(rest, axis=0).max())
    return _round_down(SHOWN_DEFORMATION * extent / colour_limit(lengths))


def _differences(
    rest: Floats, peak: dict[str, Floats], named: dict[str, str], reference: str
) -> Sheet:
    truth = peak[reference]
    others = {name: _length(u - truth) for name, u in peak.items() if name != reference}
    panels = [Panel(f"{named[n]} − finite elements", rest, d) for n, d in others.items()]
    limit = min(max(float(d.max()) for d in others.values()), _reach(truth))
    return Sheet(panels, limit, "difference [mm]", "magma_r")


def _reach(field: Floats) -> float:
    return SCALE_LIMIT * float(_length(field).max())


def colour_limit(lengths: list[Floats]) -> float:
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
        found = replace(pictures, pixels=chosen)
        figures.append(canvas.drawn(partial(_figure, views, sheet, found)))
        first = last
    return figures


def _figure(views: Views, sheet: Sheet, pictures: Pictures) -> Figure:
    return _scene(views, sheet, pictures) if sheet.is_scene else _panels(views, sheet, pictures)


def _scene(views: Views, sheet: Sheet, pictures: Pictures) -> Figure:
    """One picture over its key."""
    camera, (panel,) = views.camera, sheet.panels
    height = SCENE_WIDTH * camera.half_height / camera.half_width
    figure = canvas.sheet(height + KEY_HEIGHT, SCENE_WIDTH)
    axes, key = figure.subplots(2, 1, height_ratios=(height, KEY_HEIGHT))
    _frame(axes, camera)
    _draw_panel(axes, views, panel, sheet, pictures, 0)
    _mark_triangles(axes, views, panel)
    _mark(axes, views, panel.points[views.anchors])
    width = camera.half_width
    key.set(xlim=(-width, width), ylim=(-2.0 * width * KEY_HEIGHT / SCENE_WIDTH, 0.0))
    canvas.blank(key)
    _draw_scene_key(key, views, sheet)
    return figure


def _mark_triangles(axes: Axes, views: Views, panel: Panel) -> None:
    """Supports as triangles and loaded places as dots, amid facets; hollow if hidden."""
    corners = panel.points[views.triangles]
    seen = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    is_near = seen @ views.camera.toward > 0.0
    places = views.camera.project(corners.mean(axis=1))
    for chosen, marker, colour in (
        (views.held > HELD, "^", BLUE),
        (views.loaded > LOADED, "o", RED),
    ):
        for near, face in ((False, "none"), (True, colour)):
            at, look = places[chosen & (is_near == near)], 0.85 if near else 0.4
            axes.plot(
                at[:, 0], at[:, 1], marker, ms=2.2, mfc=face, mec=colour, mew=0.35, alpha=look
            )


def _draw_scene_key(axes: Axes, views: Views, sheet: Sheet) -> None:
    _draw_colour_bar(axes, (0.04, 0.8, 0.42, 0.13), sheet)
    named = [f"{i}  {short(name, 16)}" for i, name in enumerate(views.probes[:5], 1)]
    named += ["…"] if len(views.probes) > len(named) else []
    axes.text(0.56, 1.0, "\n".join(named), transform=axes.transAxes, va="top", linespacing=1.1)
    width = views.camera.half_width
    _draw_triad(axes, views.camera, (-0.72 * width, -0.74 * width), 0.13 * width)
    _draw_scale_bar(axes, views.camera, (-0.4 * width, -0.76 * width))


def _panels(views: Views, sheet: Sheet, pictures: Pictures) -> Figure:
    count = len(sheet.panels) + 1  # the last one is the key
    rows = -(-count // COLUMNS)
    camera = views.camera
    as_wide = canvas.TEXT_WIDTH / COLUMNS * camera.half_height / camera.half_width
    panel_height = min(as_wide, TALLEST_PANEL)
    figure = canvas.sheet(rows * (panel_height + 0.22))
    grid = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
    for i, (axes, panel) in enumerate(zip(grid, sheet.panels, strict=False)):
        _frame(axes, camera)
        axes.set_title(panel.title, pad=7)
        _draw_panel(axes, views, panel, sheet, pictures, i)
        _mark(axes, views, panel.points[views.anchors])
    for axes in grid[count - 1 :]:
        _frame(axes, camera)
    _draw_key(grid[count - 1], views, sheet)
    return figure


def _draw_panel(
    axes: Axes, views: Views, panel: Panel, sheet: Sheet, pictures: Pictures, i: int
) -> None:
    if pictures.pixels is None:
        _draw_flat(axes, views, panel, sheet)
    else:
        axes.imshow(pictures.pixels[i], extent=views.camera.extent, interpolation="none")


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
    for way in views.ways:
        _mark_way(axes, camera.project(way))
    length = ARROW_SHARE * 2.0 * camera.half_width
    shaft = camera.project(np.stack([places[0] - length * views.push, places[0]]))
    arrow = {"arrowstyle": "-|>", "color": RED, "lw": 1.4, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", tuple(shaft[1]), tuple(shaft[0]), arrowprops=arrow)
    ring = camera.project(_ring(places[0], views.push, views.radius))
    axes.plot(ring[:, 0], ring[:, 1], color=RED, lw=1.0)
    for i, place in enumerate(camera.project(places[1:])):
        _mark_point(axes, place, str(i + 1), hidden=bool(views.hidden[i + 1]))


def _mark_way(axes: Axes, seen: Floats) -> None:
    """The way of a tool over the organ at rest, with a head where it ends."""
    axes.plot(seen[:, 0], seen[:, 1], "--", color=RED, lw=1.1)
    arrow = {"arrowstyle": "-|>", "color": RED, "lw": 1.1, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", tuple(seen[-1]), tuple(seen[-2]), arrowprops=arrow)


def _ring(centre: Floats, axis: Floats, radius: float) -> Floats:
    """Outline [m] (ROUND, 3) of a round tool."""
    across = np.linalg.svd(axis[np.newaxis])[2][1:]
    turn = np.linspace(0.0, 2.0 * np.pi, ROUND)
    return np.asarray(centre + radius * np.stack([np.cos(turn), np.sin(turn)], axis=1) @ across)


def _mark_inclusion(axes: Axes, seen: Floats) -> None:
    """The outline of a region inside, which does not move with the surface."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(seen).vertices
    closed = seen[[*hull, hull[0]]]
    axes.plot(closed[:, 0], closed[:, 1], ":", color="black", lw=1.1)


def _mark_point(axes: Axes, place: Floats, text: str, *, hidden: bool) -> None:
    face = "none" if hidden else "white"
    axes.plot(*place, "o", ms=3.0, mfc=face, mec="black", mew=0.6, clip_on=False)
    halo = {"facecolor": "white", "edgecolor": "none", "pad": 0.4, "alpha": 0.75}
    axes.annotate(text, tuple(place), (3, 3), textcoords="offset points", bbox=halo, va="bottom")


def _draw_key(axes: Axes, views: Views, sheet: Sheet) -> None:
    """Colour scale, triad, scale bar, arrow and control points."""
    _draw_colour_bar(axes, (0.08, 0.86, 0.84, 0.09), sheet)
    width, height = views.camera.half_width, views.camera.half_height
    origin = (-0.55 * width, -0.45 * height)
    _draw_triad(axes, views.camera, origin, 0.3 * min(width, height))
    _draw_scale_bar(axes, views.camera, (-0.9 * width, -0.86 * height))
    names = [f"{i}  {short(name, 20)}" for i, name in enumerate(views.probes[:6], 1)]
    names += ["…"] if len(views.probes) > len(names) else []
    names += ["⋯  inclusion, at rest"] if len(views.inclusions) else []
    names += ["⇢  its way, at rest"] if len(views.ways) else []
    text = "\n".join(["→  tool", *names])
    axes.text(0.5, 0.52, text, transform=axes.transAxes, va="top", linespacing=1.25)


def _draw_colour_bar(axes: Axes, place: tuple[float, float, float, float], sheet: Sheet) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    scale = ScalarMappable(Normalize(0.0, MILLI * sheet.limit), sheet.colours)
    bar = axes.inset_axes(place)
    is_clipped = any(panel.values.max() > sheet.limit * (1 + 1e-9) for panel in sheet.panels)
    axes.figure.colorbar(
        scale, cax=bar, orientation="horizontal", extend="max" if is_clipped else "neither"
    )
    bar.set_xlabel(sheet.label, labelpad=1)
    bar.grid(visible=False)


Place = tuple[float, float]


def _draw_triad(axes: Axes, camera: Camera, origin: Place, length: float) -> None:
    """Left, posterior and superior as they lie in the pictures."""
    arrow: Style = {"arrowstyle": "->", "lw": 0.8, "shrinkA": 0, "shrinkB": 0}
    for name, direction in TRIAD.items():
        step = length * (np.array(direction) @ np.stack([camera.right, camera.up], axis=1))
        axes.annotate("", tuple(np.add(origin, step)), origin, arrowprops=arrow)
        x, y = np.add(origin, 1.5 * step)
        axes.text(x, y, name, ha="center", va="center")


def _draw_scale_bar(axes: Axes, camera: Camera, at: Place) -> None:
    length, (left, level) = _scale_length(camera.half_width), at
    axes.plot([left, left + length], [level, level], color="black", lw=1.5, solid_capstyle="butt")
    label = f"{significant(MILLI * length, 1)} mm"
    axes.annotate(label, (left + length, level), (3, 0), textcoords="offset points", va="center")


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
    """Exaggeration and direction of the push, as the caption of the pictures says them.

    `travels`, `inclusions`: how many tools and inclusions are drawn, empty for none.
    """
    return {
        "travels": str(len(views.ways) or ""),
        "inclusions": str(len(views.inclusions) or ""),
        "factor": fixed(views.factor, 0),
        "push": _direction(views.push),
        "of": views.shown,
    }


def _direction(push: Floats) -> str:
    return "(" + ", ".join(fixed(float(x), 2) for x in push) + ")"
