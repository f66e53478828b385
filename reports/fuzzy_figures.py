"""The fuzzy systems: their sets, and stiffness over two readings (the paper's Fig. 4)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from reports import canvas
from reports.appearance import SYSTEM_NAMES, Dashes, Style, system_colour, system_name
from study.results import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Arrays = Mapping[str, NDArray[Any]]
Floats = NDArray[np.float64]

KILO = 1e-3
SET_LOOKS: tuple[tuple[str, Dashes], ...] = (
    ("#999933", (0, (5, 1, 1, 1))),
    ("#0072B2", "-"),
    ("#E69F00", (0, (4, 1.2))),
    ("#4D4D4D", (0, (1.2, 1))),
)
"""From mild to severe; none of the colours is that of a system, which share the output's panel."""
SET_NAMES = {"F1": 0, "F2": 1, "F3": 2, "F4": 3, "mild": 1, "moderate": 2, "severe": 3}
"""Look of a stage in every panel; an output set has that of the stage it starts with."""
SURFACE_HEIGHT = 3.3
PANEL_HEIGHT = 1.6
TICKS = 4
COLUMNS = 3
AT_REST = 0.01
ROOM = 1.1
OUTPUT = "stiffness"
MANY, MANY_COLOUR = 12, "#888888"
"""Sets of a variable from which on they are all drawn alike, and not named."""


def variables(arrays: Arrays) -> list[str]:
    """Variables whose sets can be drawn, in order."""
    return [name.removesuffix(".sets") for name in arrays if name.endswith(".sets")]


def systems(arrays: Arrays) -> list[str]:
    """Systems whose output surface can be drawn, in order."""
    names = [name.removeprefix("surface.") for name in arrays if name.startswith("surface.")]
    return [name for name in names if name not in ("x", "y")]


def sets_figure(results: Results) -> bytes:
    """Fuzzy sets of every variable with footprints, and the estimates, over kPa as SVG."""
    found = results.record.fuzzy.systems
    return draw_sets(results.fuzzy, {system: one.estimate_pa for system, one in found.items()})


def draw_sets(arrays: Arrays, estimates: Mapping[str, float]) -> bytes:
    """Sets as SVG, from the arrays and the estimate [Pa] of each system."""
    names = variables(arrays)
    rows = -(-len(names) // COLUMNS)

    def draw() -> Figure:
        figure = canvas.sheet(rows * PANEL_HEIGHT)
        grid = figure.subplots(rows, COLUMNS, squeeze=False, sharey=True).ravel()
        for axes, name in zip(grid, names, strict=False):
            _draw_sets(axes, arrays, name)
            is_output = name == OUTPUT
            axes.set_title("output: stiffness" if is_output else name.upper(), fontweight="bold")
            axes.set_xlabel("Young's modulus [kPa]" if is_output else "reading [kPa]")
            if is_output:
                _mark_estimates(axes, estimates)
        for axes in grid[len(names) :]:
            axes.set_axis_off()
        for axes in grid[::COLUMNS]:
            axes.set_ylabel("membership")
        figure.legend(handles=_legend(grid), loc="outside upper center", ncols=4)
        return figure

    return canvas.drawn(draw)


def _draw_sets(axes: Axes, arrays: Arrays, variable: str) -> None:
    x = KILO * arrays[f"{variable}.x"]
    names = arrays[f"{variable}.sets"]
    for i, name in enumerate(names):
        colour, dashes = SET_LOOKS[SET_NAMES.get(str(name), i) % len(SET_LOOKS)]
        width, label = 1.1, str(name)
        if len(names) >= MANY:
            colour, dashes, width = MANY_COLOUR, "-", 0.4
            label = f"{len(names)} sets of {variable}" if i == 0 else "_"
        lower, upper = arrays[f"{variable}.lower"][i], arrays[f"{variable}.upper"][i]
        axes.fill_between(x, lower, upper, color=colour, alpha=0.25, linewidth=0)
        line: Style = {"color": colour, "linestyle": dashes, "linewidth": width}
        axes.plot(x, arrays[f"{variable}.principal"][i], label=label, **line)
    bounds = np.concatenate([arrays[f"{variable}.lower"], arrays[f"{variable}.upper"]])
    axes.set(xlim=(x[0], _last_change(x, bounds)), ylim=(0.0, 1.05))


def _legend(panels: Iterable[Any]) -> list[Any]:
    """One entry per look; sets of one look are named together, mildest first, then the systems."""
    entries: dict[tuple[str, str], Any] = {}
    names: dict[tuple[str, str], list[str]] = {}
    for axes in panels:
        for handle, name in zip(*axes.get_legend_handles_labels(), strict=True):
            key = (str(handle.get_color()), str(handle.get_linestyle()))
            entries.setdefault(key, handle)
            names.setdefault(key, []).append(name)
    for key, handle in entries.items():
        handle.set_label(", ".join(dict.fromkeys(names[key])))
    return sorted(entries.values(), key=lambda handle: _rank(handle.get_label()))


def _rank(label: str) -> tuple[bool, str]:
    return label in SYSTEM_NAMES.values(), label


def _last_change(x: Floats, memberships: Floats) -> float:
    """Where the sets have come to rest, and a little room."""
    moving = still_moving(memberships)
    return float(min(x[-1], ROOM * x[moving].max())) if moving.any() else float(x[-1])


def still_moving(curves: Floats) -> NDArray[np.bool_]:
    """Where any of some curves (n, samples) is not yet at its last value, (samples,)."""
    moving: NDArray[np.bool_] = np.abs(curves - curves[:, -1:]).max(axis=0) > AT_REST
    return moving


def _mark_estimates(axes: Axes, estimates: Mapping[str, float]) -> None:
    """Estimates as lines across the output's panel."""
    for system, modulus in estimates.items():
        line: Style = {"color": system_colour(system), "linewidth": 1.2, "zorder": 3.0}
        axes.axvline(KILO * modulus, label=system_name(system), **line)


def surfaces_figure(results: Results) -> bytes:
    """Estimates of each system over two readings as SVG: as surfaces, and in pseudo-colour."""
    return draw_surfaces(results.fuzzy, results.scene.fuzzy.surface)


def draw_surfaces(arrays: Arrays, inputs: tuple[str, str]) -> bytes:
    """Output surfaces as SVG, from the arrays and the names of the two inputs."""
    labels = [f"{name.upper()} [kPa]" for name in inputs]
    names = systems(arrays)
    x, y, surfaces = _changing(arrays, names)
    scale = _scale(surfaces)

    def draw() -> Figure:
        figure = canvas.sheet(SURFACE_HEIGHT)
        grid = figure.add_gridspec(2, len(names), height_ratios=(1.25, 1.0))
        flat = []
        for i, (name, z) in enumerate(zip(names, surfaces, strict=True)):
            solid = figure.add_subplot(grid[0, i], projection="3d")
            solid.set_title(system_name(name), fontweight="bold", pad=0)
            _draw_solid(solid, x, y, z, scale)
            _label_solid(solid, labels)
            flat.append(figure.add_subplot(grid[1, i]))
            image = flat[-1].pcolormesh(x, y, z, rasterized=True, shading="gouraud", **scale)
            flat[-1].set(xlabel=labels[0], ylabel=labels[1] if i == 0 else "")
            flat[-1].locator_params(nbins=TICKS)
            flat[-1].grid(visible=False)
        figure.colorbar(image, ax=flat, label="stiffness [kPa]")
        return figure

    return canvas.drawn(draw)


def _changing(arrays: Arrays, names: list[str]) -> tuple[Floats, Floats, list[Floats]]:
    """The part of the surfaces, in kPa, beyond which they hardly change any more."""
    x, y = KILO * arrays["surface.x"], KILO * arrays["surface.y"]
    z = KILO * np.array([arrays[f"surface.{name}"] for name in names])
    rows, columns = z.swapaxes(1, 2).reshape(-1, len(y)), z.reshape(-1, len(x))
    scale = np.ptp(z) or 1.0
    i = int(np.searchsorted(y, _last_change(y, rows / scale))) + 1
    j = int(np.searchsorted(x, _last_change(x, columns / scale))) + 1
    return x[:j], y[:i], list(z[:, :i, :j])


def _scale(surfaces: list[Floats]) -> Style:
    """Range of all surfaces, of some width also where they are flat."""
    low, high = min(z.min() for z in surfaces), max(z.max() for z in surfaces)
    return {"vmin": float(low), "vmax": float(high) if high > low else float(low) + 1.0}


def _draw_solid(axes: Any, x: Floats, y: Floats, z: Floats, scale: Style) -> None:
    x_grid, y_grid = np.meshgrid(x, y)  # z[i, j] belongs to y[i], x[j]
    axes.plot_surface(
        x_grid, y_grid, z, cmap="viridis", rcount=41, ccount=41, rasterized=True, **scale
    )
    axes.set_zlim(scale["vmin"], scale["vmax"])
    axes.locator_params(nbins=TICKS)
    axes.tick_params(pad=-3)
    axes.view_init(elev=28, azim=-128)
    axes.set_box_aspect(None, zoom=0.88)


def _label_solid(axes: Any, labels: list[str]) -> None:
    axes.set_xlabel(labels[0], labelpad=-6)
    axes.set_ylabel(labels[1], labelpad=-6)
    axes.set_zlabel("[kPa]", labelpad=-7)
