"""Corrected lattices at places of the tool and under gravity, and their cost."""

import math
from collections.abc import Iterator
from statistics import median

from docs.figures.formats import millimetres, percent, span, table
from docs.figures.gains import FINEST, TOLERANCE, Prices, gains, prices
from docs.figures.places import SMALL_OR_LARGE, STRAINS, by_strain
from docs.figures.tables import Line, column, grouped, measured, ratios

PLACES_HEAD = (
    *("largest strain", "places", "nonlinear part", "corrected, 20 mm", "15 mm", "10 mm", "8 mm"),
    *("corrected at rest only, 20 mm", "lattice alone, 10 mm", "5 mm"),
)
PLACES_COLUMNS = (
    *("nonlinear", "error_20", "error_15", "error_10", "error_8"),
    *("static_20", "uniform_10", "uniform_5"),
)
COST_HEAD = ("lattice", "field", "at the tool", "processor time of a simulated second", "of a step")
GRAVITY_HEAD = (
    *("scene", "large displacements", "corrected, 20 mm", "own estimate", "corrected, 10 mm"),
    *("own estimate", "lattice alone, 10 mm"),
)


def corrected() -> Iterator[tuple[str, str]]:
    """The corrected lattice at random places of the tool, and what it costs."""
    places, costs = measured("corrected_places"), measured("corrected_cost")
    over_estimate = ratios(places, "error_20", over="estimate_20")
    yield "corrected-count", str(len(places))
    yield "corrected-within", str(sum(ratio <= 2.0 for ratio in over_estimate))
    yield "corrected-ratios", span(over_estimate, "{:.2g}".format)
    over_coarser = ratios(places, "error_20", over="coarser_20")
    yield "corrected-coarser", span(over_coarser, "{:.2g}".format)
    yield from _gains(places, prices(costs))
    yield "corrected-places", table(PLACES_HEAD, by_strain(places, PLACES_COLUMNS))
    yield "corrected-cost", table(COST_HEAD, map(_cost, costs))
    yield from _at_1_khz(costs)


def _gains(places: list[Line], price: Prices) -> Iterator[tuple[str, str]]:
    """What a lattice alone costs that is within the tolerance, over a corrected one that is."""
    linear = [one for one in places if float(one["nonlinear"]) <= TOLERANCE]
    for words, strain in zip(SMALL_OR_LARGE, STRAINS, strict=True):
        found = strain.of(places)
        uniform, own = (gains(found, price, kind) for kind in ("uniform", "own"))
        yield f"corrected-met-{words}", f"{len(uniform)} of {len(found)}"
        yield f"corrected-gain-{words}", f"{min(uniform):.0f}"
        yield f"corrected-gain-{words}-median", f"{median(uniform):.0f}"
        yield f"corrected-own-gain-{words}", f"{min(own):.1f}"
        yield f"corrected-own-gain-{words}-median", f"{median(own):.0f}"
        yield f"linear-met-{words}", str(len(strain.of(linear)))
    missed = sum(error > TOLERANCE for error in column(places, "uniform_5"))
    yield "corrected-alone-missed", str(missed)
    cheap = price["superposition", 0.0, 0.0]
    yield "linear-gain", f"{price['uniform', FINEST, 0.0] / cheap:.0f}"


def _cost(line: Line) -> list[str]:
    name = line["model"]
    if float(line["spacing_m"]):
        name += f", {millimetres(line['spacing_m'])}"
        name += f" to {millimetres(line['radius_m'])}" if float(line["radius_m"]) else ""
    errors = (percent(line[kind]) for kind in ("field_error", "tool_error"))
    step = f"{float(line['step_us']):.0f} µs of {1e3 * float(line['step_s']):.2g} ms"
    return [name, *errors, f"{float(line['per_second']):.2g} s", step]


def _at_1_khz(lines: list[Line]) -> Iterator[tuple[str, str]]:
    """The most accurate of either kind of which a millisecond is computed within one."""
    for kind in ("uniform", "corrected"):
        able = [one for one in lines if one["model"] == kind and _millisecond(one) < 1e-3]
        best = min(able, key=lambda line: float(line["field_error"]))
        yield f"{kind}-1khz", percent(best["field_error"])
        yield f"{kind}-1khz-tool", percent(best["tool_error"])
        yield f"{kind}-1khz-spacing", millimetres(best["spacing_m"])


def _millisecond(line: Line) -> float:
    """Processor time [s] of the steps in a millisecond, which are shortened to divide it."""
    return math.ceil(1e-3 / float(line["step_s"])) * 1e-6 * float(line["single_us"])


def under_gravity() -> Iterator[tuple[str, str]]:
    """Corrected lattices under gravity and weights: the worst control point of each scene."""
    lines = measured("corrected_gravity")
    scenes = grouped(lines, lambda line: line["scene"])
    yield "gravity-places", table(GRAVITY_HEAD, [_worst(*scene) for scene in scenes.items()])
    both = [one for one in lines if one["neo_hooke_own"] != "nan"]
    for name in ("own", "linear", "corrected", "alone"):
        yield f"gravity-neo-{name}", percent(max(column(both, f"neo_hooke_{name}")))
    yield "gravity-ratios", span(ratios(lines, "corrected", over="told"), "{:.1f}".format)


def _worst(scene: str, lines: list[Line]) -> list[str]:
    by_spacing = grouped(lines, lambda line: float(line["spacing_m"]))
    coarse, fine = by_spacing[0.02], by_spacing[0.01]
    cells = [(coarse, "linear"), (coarse, "corrected"), (coarse, "told")]
    cells += [(fine, "corrected"), (fine, "told"), (fine, "alone")]
    return [scene, *(percent(max(column(of, name))) for of, name in cells)]
