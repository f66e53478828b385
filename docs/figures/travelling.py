"""A tool that travels: its stations, and corrected and graded lattices under it."""

from collections.abc import Iterator

from docs.figures.formats import percent, span, table
from docs.figures.gains import TOLERANCE, gains, prices
from docs.figures.places import SMALL_OR_LARGE, StrainRange, by_strain, place
from docs.figures.tables import column, measured

HEAD = (
    *("largest strain", "places", "nonlinear part", "corrected, 20 mm", "15 mm", "10 mm", "8 mm"),
    *("corrected at rest only, 20 mm", "lattice alone, 10 mm", "5 mm", "10 mm, held to 5 mm"),
)
COLUMNS = (
    *("nonlinear", "error_20", "error_15", "error_10", "error_8", "static_20"),
    *("uniform_10", "uniform_5", "own_10"),
)
STRAINS = (StrainRange("5 %", 0.0, 0.1), StrainRange("20 %", 0.1, 1.0))


def travelling() -> Iterator[tuple[str, str]]:
    """Interpolation between stations, errors of the lattices, and what they cost."""
    yield from _stations()
    places = measured("travelling_places")
    yield "travelling-count", str(len(set(map(place, places))))
    yield "travelling-vectors", span(column(places, "vectors"), "{:.0f}".format)
    yield "travelling-places", table(HEAD, by_strain(places, COLUMNS, STRAINS))
    price = prices(measured("travelling_cost"))
    for words, strain in zip(SMALL_OR_LARGE, STRAINS, strict=True):
        found = strain.of(places)
        uniform, own = (gains(found, price, kind) for kind in ("uniform", "own"))
        yield f"travelling-met-{words}", f"{len(uniform)} of {len(found)}"
        yield f"travelling-gain-{words}", span(uniform, "{:.2g}".format)
        yield f"travelling-own-gain-{words}", span(own, "{:.2g}".format)
    missed = sum(error > TOLERANCE for error in column(places, "static_20"))
    yield "travelling-static-missed", f"{missed} of {len(places)}"
    yield from _graded()


def _stations() -> Iterator[tuple[str, str]]:
    used = [one for one in measured("travelling_stations") if float(one["apart"]) == 0.25]
    for name in ("spline", "hat"):
        yield f"travelling-{name}", percent(max(column(used, name)))


def _graded() -> Iterator[tuple[str, str]]:
    lines = [one for one in measured("travelling_graded") if float(one["reach"]) < 1.0]
    yield "travelling-graded-count", str(len(set(map(place, lines))))
    for words, strain in zip(SMALL_OR_LARGE, STRAINS, strict=True):
        yield f"travelling-graded-{words}", percent(max(column(strain.of(lines), "error")))
    yield "travelling-graded-gain", span(column(lines, "gain"), "{:.2g}".format)
