"""What a lattice alone costs over a corrected one within the same tolerance."""

from collections.abc import Iterable, Sequence

from docs.figures.places import place
from docs.figures.tables import Line

TOLERANCE = 0.02
ALONE = {"20": 0.02, "15": 0.015, "10": 0.01, "8": 0.008, "7": 0.00667, "5": 0.005}
"""Spacings [m] of lattices alone, by the ends of the names of columns."""
FINEST = 0.005
CORRECTED = ("20", "15", "10", "8")
"""Those of `ALONE` that were corrected too."""
GRADED = {"graded_near_error": 0.6, "graded_error": 1.0}
"""How far their finest cells reach, in radii of the tool, by the columns of their errors."""
GRADED_PRICED = (0.015, 0.025)
"""Radii [m] of those whose cost is known; a smaller one counts as the next larger."""

Prices = dict[tuple[str, float, float], float]
"""Cost of a simulated second [s], by model, spacing [m] and radius of the finest cells [m]."""


def prices(costs: Iterable[Line]) -> Prices:
    """Those of a table, which has no column of radii where no lattice is graded."""
    return {_priced_as(line): float(line["per_second"]) for line in costs}


def _priced_as(line: Line) -> tuple[str, float, float]:
    spacing, radius = line["spacing_m"], line.get("radius_m", "0")
    return line["model"], _three_digits(spacing), _three_digits(radius)


def gains(
    places: Iterable[Line], price: Prices, kind: str, cells: Sequence[Line] = ()
) -> list[float]:
    """Of the places where a corrected lattice is within the tolerance; see `gain`."""
    found = (gain(one, price, kind, cells) for one in places)
    return [one for one in found if one is not None]


def gain(line: Line, price: Prices, kind: str, cells: Sequence[Line] = ()) -> float | None:
    """The cheapest lattice alone over the cheapest corrected one, both within the tolerance.

    None where no corrected lattice is within it. The finest lattice alone counts as within it, so
    that the gain is at least so much where none is. Graded ones count where their error was
    measured.

    Parameters
    ----------
    kind
        What the lattices alone are compared with: "uniform" the reference, "own" their own
        converged solution.
    cells
        Lines of `graded_cells`: further graded lattices, each at a place of its own.
    """
    errors = {name: float(line.get(f"{kind}_{name}", 0.0)) for name in ALONE} | {"5": 0.0}
    alone = [price["uniform", ALONE[name], 0.0] for name, e in errors.items() if e <= TOLERANCE]
    corrected = [
        price["corrected", ALONE[name], 0.0]
        for name in CORRECTED
        if float(line[f"error_{name}"]) <= TOLERANCE
    ]
    corrected += [
        price["corrected graded", FINEST, _priced(reach * float(line["radius_m"]))]
        for name, reach in GRADED.items()
        if name in line and float(line[name]) <= TOLERANCE
    ]
    corrected += [
        price["uniform", FINEST, 0.0] / float(one["gain"])
        for one in cells
        if place(one) == place(line) and float(one["error"]) <= TOLERANCE
    ]
    return min(alone) / min(corrected) if corrected else None


def _priced(radius: float) -> float:
    return min(one for one in GRADED_PRICED if radius < one * (1.0 + 1e-9))


def _three_digits(length: str) -> float:
    return float(f"{float(length):.3g}")
