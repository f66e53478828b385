"""The fuzzy systems: their sets, and stiffness over two readings (the paper's Fig. 4)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from reports import canvas
from reports.appearance import FUZZY_PREFIX, look, system_name
from study.results import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]

KILO = 1e-3
SET_COLOURS = ("#0072B2", "#E69F00", "#882255", "#009E73")
SET_DASHES: tuple[Any, ...] = ("-", (0, (4, 1.2)), (0, (1.2, 1)), (0, (5, 1, 1, 1)))
SURFACE_HEIGHT = 3.7
PANEL_HEIGHT = 1.5
COLUMNS = 3
AT_REST = 0.01
LEGEND_ROOM = 1.5
OUTPUT = "stiffness"


def variables(arrays: dict[str, NDArray[Any]]) -> list[str]:
    """Variables whose sets can be drawn, in order."""
    return [name.removesuffix(".sets") for name in arrays if name.endswith(".sets")]


def systems(arrays: dict[str, NDArray[Any]]) -> list[str]:
    """Systems whose output surface can be drawn, in order."""
    names = [name.removeprefix("surface.") for name in arrays if name.startswith("surface.")]
    return [name for name in names if name not in ("x", "y")]


def sets_figure(results: Results) -> bytes:
    """Sets of every variable with their footprints, over kPa."""
    arrays = results.arrays["fuzzy"]
    names = variables(arrays)
    rows = -(-len(names) // COLUMNS)
    with canvas.style():
        figure = canvas.sheet(rows * PANEL_HEIGHT)
        grid = figure.subplots(rows, COLUMNS, squeeze=False, sharey=True).ravel()
        for axes, name in zip(grid, names, strict=False):
            _draw_sets(axes, arrays, name)
            is_output = name == OUTPUT
            axes.set_title("output: stiffness" if is_output else name.upper(), fontweight="bold")
            axes.set_xlabel("Young's modulus [kPa]" if is_output else "reading [kPa]")
            if is_output:
                _mark_estimates(axes, results)
        for axes in grid[len(names) :]:
            axes.set_axis_off()
        for axes in grid[::COLUMNS]:
            axes.set_ylabel("membership")
        return canvas.svg(figure)


def _draw_sets(axes: Axes, arrays: dict[str, NDArray[Any]], variable: str) -> None:
    x = KILO * arrays[f"{variable}.x"]
    for i, name in enumerate(arrays[f"{variable}.sets"]):
        colour, dashes = SET_COLOURS[i % 4], SET_DASHES[i % 4]
        lower, upper = arrays[f"{variable}.lower"][i], arrays[f"{variable}.upper"][i]
        axes.fill_between(x, lower, upper, color=colour, alpha=0.25, linewidth=0)
        line = {"color": colour, "linestyle": dashes, "linewidth": 1.1}
        axes.plot(x, arrays[f"{variable}.principal"][i], label=str(name), **line)
    axes.set(xlim=(x[0], _last_change(x, arrays[f"{variable}.upper"])), ylim=(0.0, 1.05))
    axes.legend(loc="center right", handlelength=2.4)


def _last_change(x: Floats, memberships: Floats) -> float:
    """Where the sets have come to rest, and room for the legend."""
    moving = np.abs(memberships - memberships[:, -1:]).max(axis=0) > AT_REST
    return float(min(x[-1], LEGEND_ROOM * x[moving].max(initial=x[0])))


def _mark_estimates(axes: Axes, results: Results) -> None:
    """Estimates as lines at the top of the output's panel."""
    for system, found in results.numbers["stiffness"].items():
        colour = look(f"{FUZZY_PREFIX}{system}").colour
        axes.axvline(KILO * found["estimate_pa"], color=colour, linewidth=1.0, zorder=1.5)


def surfaces_figure(results: Results) -> bytes:
    """Output of each system over two readings: as a surface, and in pseudo-colour."""
    arrays = results.arrays["fuzzy"]
    names = systems(arrays)
    x, y = KILO * arrays["surface.x"], KILO * arrays["surface.y"]
    surfaces = [KILO * arrays[f"surface.{name}"] for name in names]
    scale = {"vmin": min(z.min() for z in surfaces), "vmax": max(z.max() for z in surfaces)}
    with canvas.style():
        figure = canvas.sheet(SURFACE_HEIGHT)
        grid = figure.add_gridspec(2, len(names), height_ratios=(1.25, 1.0))
        flat = []
        for i, (name, z) in enumerate(zip(names, surfaces, strict=True)):
            solid = figure.add_subplot(grid[0, i], projection="3d")
            solid.set_title(system_name(name), fontweight="bold", pad=0)
            _draw_solid(solid, x, y, z, scale)
            flat.append(figure.add_subplot(grid[1, i]))
            image = flat[-1].pcolormesh(x, y, z, rasterized=True, shading="gouraud", **scale)
            flat[-1].set(xlabel="HCV [kPa]", ylabel="HBV [kPa]" if i == 0 else "")
            flat[-1].grid(visible=False)
        figure.colorbar(image, ax=flat, label="stiffness [kPa]")
        return canvas.svg(figure)


def _draw_solid(axes: Any, x: Floats, y: Floats, z: Floats, scale: dict[str, float]) -> None:
    x_grid, y_grid = np.meshgrid(x, y)  # z[i, j] belongs to y[i], x[j]
    axes.plot_surface(
        x_grid, y_grid, z, cmap="viridis", rcount=41, ccount=41, rasterized=True, **scale
    )
    axes.set_zlim(scale["vmin"], scale["vmax"])
    axes.set_xlabel("HCV [kPa]", labelpad=-6)
    axes.set_ylabel("HBV [kPa]", labelpad=-6)
    axes.set_zlabel("[kPa]", labelpad=-7)
    axes.tick_params(pad=-3, labelsize=5.5)
    axes.view_init(elev=28, azim=-128)
    axes.set_box_aspect(None, zoom=0.88)
