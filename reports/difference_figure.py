"""How much of the field's difference from the finite elements has which cause."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from reports import canvas
from reports.appearance import Style, looks
from reports.differences import field_errors, own_error, resolved
from study.results.folder import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BAR_HEIGHT = 0.19
FRAME_HEIGHT = 0.55
OWN_ERROR_COLOUR = "#eeeeee"
LIMIT_COLOURS = ("#bbbbbb", "#888888", "#555555")


class DifferenceBar(NamedTuple):
    """A difference in relative L2, and what the best factor leaves of it."""

    name: str
    whole: float
    left: float | None
    colour: str


def bars(results: Results) -> list[DifferenceBar]:
    """Bars of the lattice with the exact modulus at rest, then of every model at the peak."""
    limits, found = results.record.lattice_limits, []
    if limits is not None:
        at_rest, nu = "exact modulus, at rest, ν =", f"{limits.poisson_ratio:g}"
        quarter, whole = limits.relative_l2_at_quarter, limits.relative_l2
        left, lifted = limits.relative_l2_at_best_factor, limits.relative_l2_with_volume_term
        found = [
            DifferenceBar(f"{at_rest} 0.25", quarter, None, LIMIT_COLOURS[0]),
            DifferenceBar(f"{at_rest} {nu}", whole, left, LIMIT_COLOURS[1]),
        ]
        if lifted is not None:
            name = f"the same with the volume term, ν = {nu}"
            found.append(DifferenceBar(name, lifted, None, LIMIT_COLOURS[2]))
    seen = looks(results)
    for (model, reference), values in field_errors(results).items():
        if reference == "fem":
            whole = values["field-relative-l2-peak"]
            left = values["field-relative-l2-peak-at-best-factor"]
            name = f"{seen[model].label}, at the peak"
            found.append(DifferenceBar(name, whole, left, seen[model].colour))
    return found


def difference_figure(results: Results) -> bytes | None:
    """Bars of the relative L2 difference in per cent, or None if nothing was compared."""
    found, error = bars(results), own_error(results)
    if not found:
        return None
    with canvas.style():
        figure = canvas.sheet(FRAME_HEIGHT + BAR_HEIGHT * len(found))
        axes = figure.subplots()
        if error is not None:
            axes.axvspan(0.0, 100 * error, color=OWN_ERROR_COLOUR, linewidth=0, zorder=0.5)
            axes.axvline(100 * error, color="black", linewidth=0.6, linestyle=":", zorder=0.6)
        for i, bar in enumerate(found):
            _draw(axes, i, bar, error)
        axes.set_yticks(range(len(found)), [bar.name for bar in found])
        axes.invert_yaxis()
        axes.set(xlabel="relative L2 difference from the finite elements [%]")
        axes.set_xlim(0.0, 1.45 * 100 * max(bar.whole for bar in found))
        axes.grid(visible=False, axis="y")
        return canvas.svg(figure)


def _draw(axes: Axes, i: int, bar: DifferenceBar, error: float | None) -> None:
    axes.barh(i, 100 * bar.whole, height=0.62, color=bar.colour, alpha=0.8)
    if bar.left is not None:
        axes.plot([100 * bar.left] * 2, [i - 0.31, i + 0.31], color="black", linewidth=1.6)
    end = 100 * max(bar.whole, error or 0.0)
    place: Style = {"textcoords": "offset points", "va": "center", "fontsize": 7}
    axes.annotate(label(bar, error), (end, i), (4, 0), **place)


def label(bar: DifferenceBar, error: float | None) -> str:
    """What stands beside a bar, where `error` is that of the finite elements."""
    best = "" if bar.left is None else f"   (at best factor {resolved(bar.left, error)})"
    return resolved(bar.whole, error) + best
