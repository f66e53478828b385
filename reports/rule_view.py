"""How a fuzzy system comes to its answer: rules that count, their strengths, and the output."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from reports import canvas
from reports.appearance import Style, system_colour, system_name
from reports.digits import fixed
from reports.fuzzy_figures import Arrays, still_moving
from study.results import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PREFIX = "view."
ROW_HEIGHT = 0.28
OUTPUT_HEIGHT = 0.74
FRAME_HEIGHT = 0.92
FRAME = {"left": 0.075, "right": 0.985, "wspace": 0.12}
OUTPUT_COLUMN = 1.3
LEAST_SHARE = 0.01
"""Share of the weight below which a constant is drawn without its name."""
TOP = 2.1
"""Upper end of a small panel's axis; above 1 there is room for the name of the set."""
ANTECEDENT, CONSEQUENT, READING = "#0072B2", "#E69F00", "#D55E00"
ROOM = 1.15


def kinds(arrays: Arrays) -> list[str]:
    """Systems whose rules can be drawn, in order."""
    names = (name for name in arrays if name.startswith(PREFIX) and name.endswith(".answer"))
    return [name.removeprefix(PREFIX).removesuffix(".answer") for name in names]


def rule_figures(results: Results) -> list[bytes]:
    """Views of the rules that fire as SVG, one per system."""
    return [draw_rules(results.fuzzy, kind) for kind in kinds(results.fuzzy)]


def view_names(results: Results) -> list[str]:
    """Name of the system in each view, for its caption."""
    return [system_name(kind) for kind in kinds(results.fuzzy)]


def draw_rules(arrays: Arrays, kind: str) -> bytes:
    """View of the rules of one system as SVG, from the arrays named view.KIND."""
    prefix = f"{PREFIX}{kind}."
    view = {
        name.removeprefix(prefix): array
        for name, array in arrays.items()
        if name.startswith(prefix)
    }
    inputs = sorted(set(view["terms.input"].tolist()))
    count = len(view["rules.number"])
    height = FRAME_HEIGHT + ROW_HEIGHT * count + OUTPUT_HEIGHT

    def draw() -> Figure:
        figure = canvas.sheet(height)
        figure.set_layout_engine("none")  # a table of small panels, placed by hand
        _draw_table(figure, view, inputs, height)
        _draw_output(_output_axes(figure, height), view, kind)
        return figure

    return canvas.drawn(draw)


def _draw_table(figure: Figure, view: Arrays, inputs: list[int], height: float) -> None:
    """Rules as rows; inputs and, last, the consequent as columns."""
    count = len(view["rules.number"])
    grid = figure.add_gridspec(
        count,
        len(inputs) + 1,
        width_ratios=[1.0] * len(inputs) + [OUTPUT_COLUMN],
        top=1.0 - 0.2 / height,
        bottom=(OUTPUT_HEIGHT + 0.78) / height,
        hspace=0.14,
        **FRAME,
    )
    cells = grid.subplots(squeeze=False)
    for row in range(count):
        for column, i in enumerate(inputs):
            _draw_antecedent(cells[row, column], view, row, i)
        _draw_consequent(cells[row, -1], view, row)
        _label_row(cells[row, 0], view, row)
    unit = str(view["unit"])
    for column, i in enumerate(inputs):
        name, reading = str(view["inputs"][i]).upper(), fixed(view["readings"][i], 1)
        cells[0, column].set_title(f"{name} {reading} {unit}", fontweight="bold", pad=3)
        cells[-1, column].set_xlabel(f"reading [{unit}]", labelpad=1)
    cells[0, -1].set_title("consequent", fontweight="bold", pad=3)
    cells[-1, -1].set_xlabel(f"stiffness [{unit}]", labelpad=1)
    for axes in cells[:-1].ravel():
        axes.tick_params(labelbottom=False)


def _label_row(axes: Axes, view: Arrays, row: int) -> None:
    """Number of the rule at the left, starred if it sets a height; its share of the weight."""
    star = "*" if view["rules.sets_height"][row] else ""
    text = f"rule {view['rules.number'][row]}{star}"
    shares = view["rules.share"]
    if shares.size:
        text += f"\n{_percent(shares[row])}"
    place: Style = {"transform": axes.transAxes, "ha": "right", "va": "center"}
    axes.text(-0.08, 0.4, text, linespacing=0.95, **place)


def _plain(axes: Axes) -> None:
    """A small panel: membership from 0 to 1, no numbers on its axis."""
    axes.set(ylim=(0.0, TOP), yticks=[])
    axes.grid(visible=False)
    axes.tick_params(length=1.5, pad=1)
    axes.locator_params(axis="x", nbins=4)


def _draw_antecedent(axes: Axes, view: Arrays, row: int, i: int) -> None:
    """The sets of one input that a rule names, up to the degrees of the reading."""
    x, reading = view["x"][i], view["readings"][i]
    mine = (view["terms.rule"] == row) & (view["terms.input"] == i)
    shown = view["terms.input"] == i
    sets = np.concatenate([view["terms.lower"][shown], view["terms.upper"][shown]])
    axes.set_xlim(x[0], _last_change(x, sets, reading))
    seen = x <= axes.get_xlim()[1] + x[1] - x[0]
    axes.plot([reading, reading], [0.0, 1.0], color=READING, linewidth=0.8, zorder=3)
    for t in np.flatnonzero(mine):
        lower, upper = view["terms.lower"][t][seen], view["terms.upper"][t][seen]
        low, high = view["terms.degree_lower"][t], view["terms.degree_upper"][t]
        _draw_set(axes, x[seen], (lower, upper), (low, high), ANTECEDENT)
        name = f"{'not ' if view['terms.negated'][t] else ''}{view['terms.set'][t]}"
        _label(axes, f"{name} {_span(low, high)}")
    _plain(axes)
    if not mine.any():
        axes.spines["left"].set_visible(False)


def _draw_set(
    axes: Axes,
    x: NDArray[Any],
    bounds: tuple[NDArray[Any], NDArray[Any]],
    cut: tuple[float, float],
    colour: str,
) -> None:
    """A set as an outline, with its footprint if it has one, filled up to where it is cut."""
    lower, upper = bounds
    axes.plot(x, upper, color=colour, linewidth=0.7)
    axes.fill_between(x, 0.0, np.minimum(upper, cut[1]), color=colour, alpha=0.3, linewidth=0)
    if np.array_equal(lower, upper):
        return
    axes.plot(x, lower, color=colour, linewidth=0.7, linestyle=(0, (3, 1)))
    axes.fill_between(x, 0.0, np.minimum(lower, cut[0]), color=colour, alpha=0.45, linewidth=0)


def _label(axes: Axes, text: str) -> None:
    place: Style = {"transform": axes.transAxes, "ha": "right", "va": "top"}
    axes.text(0.99, 1.0, text, **place)


def _span(low: float, high: float) -> str:
    return "–".join(dict.fromkeys((_degree(low), _degree(high))))


def _degree(value: float) -> str:
    """To two decimals; what is too small for them is no 0."""
    return "<0.01" if 0.0 < value < 5e-3 else fixed(value, 2)


def _percent(share: float) -> str:
    return "<0.1 %" if 0.0 < share < 5e-4 else f"{fixed(100 * share, 1)} %"


def _last_change(x: NDArray[Any], memberships: NDArray[Any], reading: float) -> float:
    """Where the sets have come to rest, and the reading is in view."""
    moving = still_moving(memberships)
    return float(min(x[-1], ROOM * max(x[moving].max(initial=x[0]), reading)))


def _draw_consequent(axes: Axes, view: Arrays, row: int) -> None:
    """The output set of a rule, implied at its strength; a constant as a stem."""
    k, y = view["rules.consequent"][row], view["y"]
    low, high = view["rules.lower"][row], view["rules.upper"][row]
    constants = view["outputs.constant"]
    axes.set_xlim(y[0], _output_end(view))
    if constants.size:
        _draw_stem(axes, constants[k], high)
    else:
        bounds = view["outputs.lower"][k], view["outputs.upper"][k]
        _draw_set(axes, y, bounds, (low, high), CONSEQUENT)
    _label(axes, f"{view['outputs'][k]} {_span(low, high)}")
    _plain(axes)


def _draw_stem(axes: Axes, at: float, height: float) -> None:
    axes.plot([at, at], [0.0, height], color=CONSEQUENT, linewidth=1.6)
    axes.plot([at], [height], color=CONSEQUENT, marker="o", markersize=2.6, clip_on=False)


def _output_end(view: Arrays) -> float:
    """Where the output sets have come to rest, and the answer and its interval are in view."""
    far = max(float(view["answer"]), *view["interval"], *view["outputs.constant"], 0.0)
    sets = view["outputs.upper"]
    return _last_change(view["y"], sets, far) if sets.size else ROOM * far


def _output_axes(figure: Figure, height: float) -> Axes:
    width = FRAME["right"] - FRAME["left"]
    return figure.add_axes((FRAME["left"], 0.36 / height, width, OUTPUT_HEIGHT / height))


def _draw_output(axes: Axes, view: Arrays, kind: str) -> None:
    """The union of what the rules imply, or the weights of the constants, and the answer."""
    colour = system_colour(kind)
    unit, answer = str(view["unit"]), float(view["answer"])
    draw = _draw_shares if view["outputs.constant"].size else _draw_union
    draw(axes, view)
    if view["interval"].size:
        low, high = view["interval"]
        label = f"interval {fixed(low, 2)} to {fixed(high, 2)} {unit}"
        axes.axvspan(low, high, color=colour, alpha=0.13, linewidth=0, label=label)
    if view["switches"].size:
        mark: Style = {"color": colour, "marker": "^", "linestyle": "", "markersize": 5}
        places = view["switches"].mean(axis=1)
        axes.plot(places, [0.0, 0.0], label="bounds switch", clip_on=False, zorder=4, **mark)
    label = f"{system_name(kind)}: {fixed(answer, 2)} {unit}"
    axes.axvline(answer, color=colour, linewidth=1.6, label=label)
    axes.set(xlim=(view["y"][0], _output_end(view)), ylim=(0.0, 1.05), yticks=[0.0, 0.5, 1.0])
    axes.set_xlabel(f"stiffness [{unit}]", labelpad=1)
    box: Style = {"frameon": True, "facecolor": "white", "edgecolor": "none", "framealpha": 1.0}
    axes.legend(loc="upper right", handlelength=1.6, borderpad=0.2, labelspacing=0.12, **box)


def _draw_union(axes: Axes, view: Arrays) -> None:
    y, lower, upper = view["y"], view["lower"], view["upper"]
    axes.set_ylabel("membership")
    axes.plot(y, upper, color=CONSEQUENT, linewidth=1.0, label="upper bound of the union")
    if np.array_equal(lower, upper):
        axes.lines[-1].set_label("union of the rules")
        axes.fill_between(y, 0.0, upper, color=CONSEQUENT, alpha=0.3, linewidth=0)
        return
    axes.plot(y, lower, color=CONSEQUENT, linewidth=1.0, dashes=(3, 1), label="lower bound")
    axes.fill_between(y, lower, upper, color=CONSEQUENT, alpha=0.3, linewidth=0)


def _draw_shares(axes: Axes, view: Arrays) -> None:
    axes.set_ylabel("share of weight")
    unit = str(view["unit"])
    rows = zip(view["outputs"], view["outputs.constant"], view["outputs.share"], strict=True)
    for name, constant, share in rows:
        _draw_stem(axes, constant, share)
        if share < LEAST_SHARE:
            continue
        text = f"{name}: {fixed(constant, 2)} {unit}, weight {_percent(share)}"
        axes.plot([], [], color=CONSEQUENT, marker="o", markersize=2.6, linewidth=1.6, label=text)
