"""How much of the field's difference from the finite elements has which cause."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from reports import canvas
from reports.appearance import look
from reports.differences import field_errors, own_error, resolved
from study.results.folder import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BAR_HEIGHT = 0.19
FRAME_HEIGHT = 0.55
OWN_ERROR_COLOUR = "#eeeeee"
LIMIT_COLOURS = ("#bbbbbb", "#888888", "#555555")

Bar = tuple[str, float, float | None, str]
"""Label, difference, what the best factor leaves of it (or None), colour."""


def bars(results: Results) -> list[Bar]:
    """The lattice with the exact modulus at rest, then every model at the peak."""
    found: list[Bar] = []
    limits = results.numbers.get("lattice_limits")
    if limits:
        nu, left = limits["poisson_ratio"], limits["relative_l2_at_best_factor"]
        quarter = limits["relative_l2_at_quarter"]
        found = [
            ("exact modulus, at rest, ν = 0.25", quarter, None, LIMIT_COLOURS[0]),
            (f"exact modulus, at rest, ν = {nu:g}", limits["relative_l2"], left, LIMIT_COLOURS[1]),
        ]
        lifted = limits.get("relative_l2_with_volume_term")
        if lifted is not None:
            label = f"the same with the volume term, ν = {nu:g}"
            found.append((label, lifted, None, LIMIT_COLOURS[2]))
    for (model, reference), values in field_errors(results).items():
        if reference == "fem":
            whole = values["field-relative-l2-peak"]
            left = values["field-relative-l2-peak-at-best-factor"]
            found.append((f"{look(model).label}, at the peak", whole, left, look(model).colour))
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
        axes.set_yticks(range(len(found)), [bar[0] for bar in found])
        axes.invert_yaxis()
        axes.set(xlabel="relative L2 difference from the finite elements [%]")
        axes.set_xlim(0.0, 1.45 * 100 * max(bar[1] for bar in found))
        axes.grid(visible=False, axis="y")
        return canvas.svg(figure)


def _draw(axes: Axes, i: int, bar: Bar, error: float | None) -> None:
    _, whole, left, colour = bar
    axes.barh(i, 100 * whole, height=0.62, color=colour, alpha=0.8)
    if left is not None:
        axes.plot([100 * left] * 2, [i - 0.31, i + 0.31], color="black", linewidth=1.6)
    end = 100 * max(whole, error or 0.0)
    place: dict[str, Any] = {"textcoords": "offset points", "va": "center", "fontsize": 7}
    axes.annotate(label(bar, error), (end, i), (4, 0), **place)


def label(bar: Bar, error: float | None) -> str:
    """What stands beside a bar, where `error` is that of the finite elements."""
    _, whole, left, _ = bar
    best = "" if left is None else f"   (at best factor {resolved(left, error)})"
    return resolved(whole, error) + best
