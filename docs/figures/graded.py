"""Graded lattices: regions of interest, cells finer near the tool, and steps of several lengths."""

from collections.abc import Iterator
from statistics import median

from docs.figures.formats import millimetres, percent, span, table
from docs.figures.gains import TOLERANCE, Prices, gains, prices
from docs.figures.places import SMALL_OR_LARGE, STRAINS, by_strain, place
from docs.figures.tables import Line, column, measured, ratios

PLACES_HEAD = (
    *("largest strain", "places", "region for 2 %", "lattice of 10 mm", "8 mm"),
    *("corrected, 20 mm", "10 mm", "graded, to 0.6 radii", "to 1 radius"),
)
PLACES_COLUMNS = (
    *("region_error", "uniform_10", "uniform_8", "corrected_20", "corrected_10"),
    *("graded_near_error", "graded_error"),
)
CELLS_HEAD = (
    *("largest strain", "radius of the tool", "finest cells", "as far as", "nodes", "error"),
    *("predicted", "gain", "load"),
)
RATES_HEAD = (
    *("finest cells to", "steps of 5, 10 and 20 mm cells", "longest step", "gain"),
    "gain if the interface were free",
)


def graded() -> Iterator[tuple[str, str]]:
    """Regions of interest and graded corrected lattices at places of the tool, and their cost."""
    places = measured("graded_places")
    errors = column(places, "region_error")
    yield "graded-count", str(len(places))
    yield "graded-kept", str(sum(error <= TOLERANCE for error in errors))
    yield "graded-worst", percent(max(errors))
    yield "graded-rest", span(column(places, "region_apart"), percent)
    yield "graded-nodes", span(column(places, "region_nodes"), "{:.0f}".format)
    yield "graded-near-nodes", span(column(places, "graded_near_nodes"), "{:.0f}".format)
    yield "graded-places", table(PLACES_HEAD, by_strain(places, PLACES_COLUMNS))
    region_gains = column(places, "region_gain")
    yield "region-gain", span(region_gains, "{:.2g}".format)
    yield "region-gain-median", f"{median(region_gains):.2g}"
    yield from _gains(places, prices(measured("corrected_cost")))
    yield "multirate", table(RATES_HEAD, map(_rates, measured("multirate")))


def _gains(places: list[Line], price: Prices) -> Iterator[tuple[str, str]]:
    """What a lattice alone costs over a corrected one, where a graded lattice was measured too."""
    found = {place(one): one for one in places}
    both = [found[at] | one for one in measured("corrected_places") if (at := place(one)) in found]
    cells = measured("graded_cells")
    yield "graded-cells-count", str(len(set(map(place, cells))))
    yield "graded-cells", table(CELLS_HEAD, map(_cells, cells))
    for words, strain in zip(SMALL_OR_LARGE, STRAINS, strict=True):
        for kind in ("uniform", "own"):
            known = gains(strain.of(both), price, kind, cells)
            yield f"graded-gain-{words}-{kind}", f"{min(known):.0f}"
            yield f"graded-gain-{words}-{kind}-median", f"{median(known):.0f}"
        yield f"graded-gain-{words}-met", str(len(known))


def _cells(line: Line) -> list[str]:
    """A grading at a place: lengths in mm."""
    lengths = [f"{1e3 * float(line[key]):.3g} mm" for key in ("radius_m", "finest_m", "reach_m")]
    errors = [percent(line[key]) for key in ("error", "foretold")]
    load = "-" if line["load"] == "nan" else f"{float(line['load']):.0f}"
    gain = f"{float(line['gain']):.0f}"
    return [percent(line["strain"]), *lengths, line["nodes"], *errors, gain, load]


def graded_rest() -> Iterator[tuple[str, str]]:
    """Predictions of graded corrected lattices, held against cells of 5 and of 2.5 mm."""
    lines = measured("graded_rest")
    yield "graded-rest-count", str(len(set(map(place, lines))))
    yield "graded-rest-rows", str(len(lines))
    for name in ("of_5_mm", "of_2_5_mm"):
        found = ratios(lines, name, over="foretold")
        yield f"graded-rest-{name.replace('_', '-')}", f"{median(found):.2g}"
        yield f"graded-rest-{name.replace('_', '-')}-largest", f"{max(found):.2g}"
    within = sum(one <= 2.0 for one in ratios(lines, "of_2_5_mm", over="foretold"))
    yield "graded-rest-within", str(within)


def _rates(line: Line) -> list[str]:
    numbers = (f"{float(line[name]):.2f}" for name in ("limit", "gain", "bound"))
    return [millimetres(line["radius_m"]), line["rates"].replace("-", " : "), *numbers]
