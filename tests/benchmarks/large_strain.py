"""How the lattice departs from its own linear solution as the load grows.

    python -m tests.benchmarks.large_strain

writes tests/data/large_strain.csv: the block of `field_error` at nu = 0.45 and 10 mm, pressed
harder and harder.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msm.assembly import Assembly, Material, arrays
from msm.lattice import CORNERS, CellLattice, node_volumes
from msm.relaxation import relax
from msm.statics import static_displacement
from study.run.comparison import relative_l2
from tests.benchmarks.field_error import block, lattice, material

Floats = NDArray[np.float64]

TABLE = Path(__file__).parents[1] / "data" / "large_strain.csv"
NU, SPACING = 0.45, 0.01
LOADS = (0.01, 0.1, 0.2, 0.4, 0.8, 1.2, 1.6)
"""Times the tool force of one newton of the block."""


class Row(NamedTuple):
    """One load, in newtons as in times the unit load of the block.

    `largest_strain`: largest of |principal stretch - 1| over the cells, of the linear and of the
    nonlinear state; `depth_m`: load-weighted mean displacement along the push; `departure`:
    relative L2 difference of the nonlinear state from the linear one.
    """

    load_n: float
    largest_strain_linear: float
    largest_strain: float
    depth_linear_m: float
    depth_m: float
    departure: float


def rows(loads: tuple[float, ...] = LOADS) -> Iterator[Row]:
    """Rows for growing loads [N]."""
    case = block()
    assembly = lattice(case, SPACING)
    matter = material(case, assembly, NU, with_volume=True)
    unit = static_displacement(assembly, matter)
    volumes, u = node_volumes(assembly.lattice), np.zeros_like(unit)
    for load in loads:
        u = at_rest(assembly, matter, load, u)
        yield Row(
            load,
            largest_strain(assembly.lattice, load * unit),
            largest_strain(assembly.lattice, u),
            load * float((assembly.load * unit).sum()),
            float((assembly.load * u).sum()),
            relative_l2(u, load * unit, volumes),
        )


def at_rest(assembly: Assembly, matter: Material, load: float, start: Floats) -> Floats:
    """Displacement [m] (n, 3) where the nonlinear lattice rests under a multiple of its load.

    ValueError if it does not come to rest.
    """
    u, end = relax(matter.law, arrays(assembly, matter), load, start)
    if end.status != "at rest":
        raise ValueError(f"no rest under {load:g} times the load: {end}")
    return u


def largest_strain(cells: CellLattice, u: Floats) -> float:
    """Largest |principal stretch - 1| of the mean deformation of the cells."""
    slopes = (2.0 * CORNERS - 1.0) / (4.0 * cells.spacing)
    gradient = np.eye(3) + np.einsum("cad,ae->cde", u[cells.cells], slopes)
    return float(np.abs(np.linalg.svd(gradient, compute_uv=False) - 1.0).max())


def read() -> list[Row]:
    """Rows of the table as written."""
    with TABLE.open(newline="") as file:
        return [Row(*map(float, line.values())) for line in csv.DictReader(file)]


def main() -> None:
    """Write the table."""
    with TABLE.open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(Row._fields)
        for line in rows():
            table.writerow(f"{v:.6g}" for v in line)


if __name__ == "__main__":
    main()
