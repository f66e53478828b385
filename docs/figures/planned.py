"""Predictions of `liver-study plan` against the errors found."""

from collections.abc import Iterator
from statistics import median

from docs.figures.formats import table
from docs.figures.places import place
from docs.figures.tables import Line, measured, ratios
from study.models.spacing_error import ESTIMATE

PREDICTED = {
    "geometry": ("large displacements left out", "nonlinear"),
    "remainder_20": ("the same on a corrected lattice of 20 mm", "error_20"),
    "remainder_15": ("15 mm", "error_15"),
    "remainder_10": ("10 mm", "error_10"),
    "near": ("graded, 5 mm to 0.6 radii", "graded_near_error"),
    "far": ("graded, 5 mm to 1 radius", "graded_error"),
    "alone_10": ("a lattice of 10 mm alone", "uniform_10"),
    "alone_5": ("5 mm alone", "uniform_5"),
    "mesh": ("elements' mesh, at rest", "mesh_found"),
}
"""By columns of `planned_places`: words, and the column of what was found."""
PLACES_HEAD = (
    "prediction of",
    "places",
    "error within twice",
    "error / prediction: median, largest",
)
TOOLS_HEAD = (
    *("quantity", "scenes", "lattices", "error within twice", "within prediction"),
    *("error / prediction: median, largest", "without a factor: within twice"),
    "from two lattices, without a factor: within twice",
)
STATED = (("index", 3.0), ("bare", 1.0))
"""Factors on the difference of two lattices, by the names of figures."""


def planned() -> Iterator[tuple[str, str]]:
    """What a plan predicts at random places of the tool, against the error found there."""
    corrected = {place(one): one for one in measured("corrected_places")}
    graded = {place(one): one for one in measured("graded_places")}
    lines = [
        graded.get(place(one), {}) | corrected[place(one)] | one
        for one in measured("planned_places")
    ]
    yield "planned-count", str(len(lines))
    rows = [_predicted(lines, prediction, *known) for prediction, known in PREDICTED.items()]
    yield "planned-places", table(PLACES_HEAD, rows)
    control = ratios(lines, "static_20", over="remainder_20")
    yield "planned-control", str(sum(one <= 2.0 for one in control))
    yield "planned-elements", str(sum(map(_elements_within_twice, lines)))


def _predicted(lines: list[Line], prediction: str, words: str, found: str) -> list[str]:
    """How often the error found is within twice the prediction."""
    known = ratios((one for one in lines if found in one), found, over=prediction)
    within = sum(one <= 2.0 for one in known)
    return [words, str(len(known)), str(within), f"{median(known):.2g}, {max(known):.2g}"]


def _elements_within_twice(line: Line) -> bool:
    """Whether linear elements are as exact as predicted: large displacements and mesh together."""
    found = float(line["nonlinear"]) + float(line["mesh_found"])
    return found <= 2.0 * (float(line["geometry"]) + float(line["mesh"]))


def planned_tools() -> Iterator[tuple[str, str]]:
    """What a plan predicts under moved tools, and what two lattices would."""
    every = measured("planned_tools")
    lines = [one for one in every if float(one["found"]) > 1e-3]  # else a bonded tool holds it
    drawn = {one["scene"] for one in lines if one["group"] == "random"}
    yield "planned-tools-scenes", str(len({one["scene"] for one in lines} - drawn))
    yield "planned-tools-random", str(len(drawn))
    quantities, groups = ({one[name]: None for one in lines} for name in ("quantity", "group"))
    rows = [_under_tools(lines, quantity, group) for quantity in quantities for group in groups]
    yield "planned-tools", table(TOOLS_HEAD, rows)
    for quantity in ("force", "at the tool"):
        of = [one for one in lines if one["quantity"] == quantity]
        for name, factor in STATED:
            kept = [_is_covered(one, factor, of_force=quantity == "force") for one in of]
            yield f"spacing-{name}-{quantity.replace(' ', '-')}", f"{sum(kept)} of {len(kept)}"


def _is_covered(line: Line, factor: float, *, of_force: bool) -> bool:
    """Whether the difference of two lattices, with a safety factor, covers the error found.

    A force errs by a factor: both are relative to the lattice's own force, which is too large.
    """
    found, by_two = float(line["found"]), float(line["by_two"])
    if of_force:
        return found / (1.0 + found) <= 1.0 - 1.0 / float((1.0 + by_two) ** factor)
    return found <= factor * by_two


def _under_tools(lines: list[Line], quantity: str, group: str) -> list[str]:
    """How often the error of a quantity is within the prediction, in a group of scenes."""
    chosen = [one for one in lines if (one["quantity"], one["group"]) == (quantity, group)]
    by_three, by_two = (ratios(chosen, "found", over=name) for name in ("by_three", "by_two"))
    predicted = [one / ESTIMATE for one in by_three]
    within = [sum(one <= limit for one in predicted) for limit in (2.0, 1.0)]
    bare = [sum(one <= 2.0 for one in found) for found in (by_three, by_two)]
    spread = f"{median(predicted):.2g}, {max(predicted):.2g}"
    return [quantity, group, *map(str, (len(predicted), *within)), spread, *map(str, bare)]
