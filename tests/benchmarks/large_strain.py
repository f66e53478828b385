"""How the lattice departs from its own linear solution, and from finite strain, as the load grows.

    python -m tests.benchmarks.large_strain

writes reports/data/large_strain.csv, the block of `field_error` at nu = 0.45 and 10 mm pressed
harder and harder, and reports/data/large_strain_elements.csv, where the same block is set against
hyperelastic elements.

What the lattice misses has three parts: its cells are coarse, springs do not follow the tissue's
law, and linear elements do not follow the geometry. `Springs` is the law that the lattice tends to
as its cells shrink; in elements it tells the first two parts from each other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, diags_array

from fem_reference.direct import factorised
from fem_reference.elasticity import Body, discretise
from fem_reference.laws import Law
from fem_reference.newton import solve
from fem_reference.observation import at_points, evaluation
from msm.assembly import Assembly, Material, arrays
from msm.calibration import lame
from msm.lattice import CORNERS, CellLattice, LatticeMesh, node_volumes
from msm.relaxation import relax
from msm.statics import static_displacement
from study.mesh.quadrature import over_volume
from study.organ.block import block_mesh
from study.similarity.fields import relative_l2
from tests.benchmarks import tables
from tests.benchmarks.field_error import SIZE, Case, block, lattice, material

Floats = NDArray[np.float64]

TABLE = Path(__file__).parents[2] / "reports" / "data" / "large_strain.csv"
NU, SPACING = 0.45, 0.01
LOADS = (0.01, 0.1, 0.2, 0.4, 0.8, 1.2, 1.6)
"""Times the tool force of one newton of the block."""

ELEMENTS_TABLE = TABLE.with_name("large_strain_elements.csv")
DIGITS = 6
SPACINGS = (0.01, 0.02 / 3)
COMPARED_LOADS = (0.1, 0.4, 0.8, 1.4)
ELEMENT_SIZES = (0.02, 0.01)
"""Of the coarser and the finer mesh [m]."""
ELEMENT_ORDER = 2
"""Assumed of their error in the element size; on this block finer meshes show 2.3 or more."""
ROLLERS = 1e8
"""Stiffness [N/m] at each node of the planes of symmetry, a million times that of an element."""


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
    assert isinstance(assembly.lattice, CellLattice)
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


def largest_strain(cells: LatticeMesh, u: Floats) -> float:
    """Largest |principal stretch - 1| of the mean deformation of the cells."""
    slopes = (2.0 * CORNERS - 1.0) / (4.0 * cells.spacing)
    gradient = np.eye(3) + np.einsum("cad,ae->cde", u[cells.cells], slopes)
    return float(np.abs(np.linalg.svd(gradient, compute_uv=False) - 1.0).max())


def read() -> list[Row]:
    """Rows of the table as written."""
    return tables.read(TABLE, Row)


DIAGONALS = [[1, 1, 0], [1, -1, 0], [0, 1, 1], [0, 1, -1], [1, 0, 1], [-1, 0, 1]]
DIRECTIONS = np.vstack([np.eye(3), np.array(DIAGONALS) / np.sqrt(2.0)])
WEIGHTS = np.repeat([1.0, 2.0], [3, 6])


class Compared(NamedTuple):
    """One lattice with volume term against elements, under a load on the block.

    Strains are the largest absolute principal ones: logarithmic in neo-Hookean elements, of the
    cells' mean stretch in the lattice. The others are relative L2 differences of the displacement.
    Against neo-Hookean elements: `linear` elements, `st_venant_kirchhoff` elements (NaN where they
    give way), `springs_law`, elements of the lattice's own law, and the `lattice`; against
    elements of its own law: `lattice_cells`, what its cells are too coarse for, and the same
    without load, `lattice_cells_linear`, both solutions linear; `lattice_st_venant_kirchhoff`,
    against those. `element_error`: estimated error of the neo-Hookean elements.
    """

    spacing_m: float
    load_n: float
    strain_elements: float
    strain_lattice: float
    linear: float
    st_venant_kirchhoff: float
    springs_law: float
    lattice: float
    lattice_cells: float
    lattice_cells_linear: float
    lattice_st_venant_kirchhoff: float
    element_error: float


@dataclass(frozen=True)
class Springs:
    """Edges and face diagonals that keep to Hooke, and the volume term, as a law of F.

    W = mu/2 sum_i w_i (|F n_i| - 1)^2 + (lambda - mu)/2 (J - 1)^2, w = 1 along the three edges and
    2 along the six face diagonals: springs of stiffness mu h in cells of edge h, h to 0.
    """

    first: float
    shear: float

    def energy(self, F: Floats) -> Floats:
        """Energy density."""
        stretch = np.linalg.norm(F @ DIRECTIONS.T, axis=-2)
        volume = np.linalg.det(F) - 1.0
        springs = 0.5 * self.shear * ((stretch - 1.0) ** 2 @ WEIGHTS)
        return np.asarray(springs + 0.5 * (self.first - self.shear) * volume**2)

    def stress(self, F: Floats) -> Floats:
        """First Piola-Kirchhoff stress."""
        along = F @ DIRECTIONS.T
        stretch = np.linalg.norm(along, axis=-2)
        tension = self.shear * WEIGHTS * (1.0 - 1.0 / stretch)
        springs = (along * tension[..., None, :]) @ DIRECTIONS
        G, J = np.swapaxes(np.linalg.inv(F), -2, -1), np.linalg.det(F)[..., None, None]
        return np.asarray(springs + (self.first - self.shear) * (J - 1.0) * J * G)

    def tangent(self, F: Floats) -> Floats:
        """Its derivative by F."""
        along = F @ DIRECTIONS.T
        stretch = np.linalg.norm(along, axis=-2)
        tension = self.shear * WEIGHTS * (1.0 - 1.0 / stretch)
        turning = np.einsum("...n,nJ,nL->...JL", tension, DIRECTIONS, DIRECTIONS)
        stiffness = self.shear * WEIGHTS / stretch**3
        unit = along * stiffness[..., None, :]
        springs = np.einsum("...in,...kn,nJ,nL->...iJkL", unit, along, DIRECTIONS, DIRECTIONS)
        G, J = np.swapaxes(np.linalg.inv(F), -2, -1), np.linalg.det(F)[..., None, None, None, None]
        bulk = (2.0 * J - 1.0) * J * np.einsum("...iJ,...kL->...iJkL", G, G)
        bulk -= (J - 1.0) * J * np.einsum("...iL,...kJ->...iJkL", G, G)
        geometric = np.einsum("ik,...JL->...iJkL", np.eye(3), turning)
        return np.asarray(springs + geometric + (self.first - self.shear) * bulk)


@dataclass(frozen=True)
class Elements:
    """Displacements [m] (q, 3) at points, by load, of elements of each kind.

    `weights` [m^3] (q,) of the points; `strains` of the neo-Hookean elements; `linear` is under the
    unit load; `coarse` are the neo-Hookean fields of the coarser mesh, and their
    difference from the finer ones is `left` times the error of those.
    """

    points: Floats
    weights: Floats
    linear: Floats
    neo_hookean: list[Floats]
    strains: list[float]
    st_venant_kirchhoff: list[Floats]
    springs: list[Floats]
    coarse: list[Floats]
    left: float


def elements(case: Case, loads: Sequence[float], sizes: tuple[float, float]) -> Elements:
    """The quarter of the block in elements of every law, of a coarser and a finer size [m]."""
    coarse, fine = (quarter(case, size) for size in sizes)
    rule, tissue = over_volume(coarse.mesh, 2), case.tissue(NU)
    at = evaluation(fine, rule.points)

    def fields(law: str | Law) -> tuple[list[Floats], list[float]]:
        states = solve(fine, tissue, law, loads).states
        missing = [np.full_like(rule.points, np.nan)] * (len(loads) - len(states))
        found = [at_points(at, s.displacement) for s in states]
        return found + missing, [s.largest_strain for s in states]

    neo_hookean, strains = fields("neo-hookean")
    return Elements(
        rule.points,
        rule.weights,
        at_points(at, factorised(fine.stiffness.matrix)(fine.load)),
        neo_hookean,
        strains,
        fields("st-venant-kirchhoff")[0],
        fields(Springs(*lame(case.youngs_modulus, NU)))[0],
        [
            at_points(evaluation(coarse, rule.points), s.displacement)
            for s in solve(coarse, tissue, "neo-hookean", loads).states
        ],
        (sizes[0] / sizes[1]) ** ELEMENT_ORDER - 1.0,
    )


def quarter(case: Case, size: float) -> Body:
    """A quarter of the block in elements of a size [m], on rollers in its planes of symmetry."""
    extent = np.array(SIZE) * (0.5, 0.5, 1.0)
    tool = replace(case.tool, force=0.25 * case.tool.force)
    mesh = block_mesh(tuple(extent), size)
    body = discretise(mesh, case.tissue(NU), case.foundation, tool, "p2")
    on_plane = np.abs(body.points - extent) < 1e-9
    on_plane[:, 2] = False
    rollers = csc_array(diags_array(ROLLERS * on_plane.ravel()))
    stiffness = replace(body.stiffness, matrix=csc_array(body.stiffness.matrix + rollers))
    return replace(body, support=csc_array(body.support + rollers), stiffness=stiffness)


def compared(
    spacings: Sequence[float] = SPACINGS,
    loads: Sequence[float] = COMPARED_LOADS,
    sizes: tuple[float, float] = ELEMENT_SIZES,
) -> Iterator[Compared]:
    """Rows for each spacing [m] and growing loads [N], with elements of two sizes [m]."""
    case = block()
    found = elements(case, loads, sizes)
    for spacing in spacings:
        yield from _against(found, case, spacing, loads)


def _against(
    found: Elements, case: Case, spacing: float, loads: Sequence[float]
) -> Iterator[Compared]:
    """Rows of one lattice."""

    def difference(a: Floats, b: Floats) -> float:
        return relative_l2(a, b, found.weights)

    assembly = lattice(case, spacing)
    matter = material(case, assembly, NU, with_volume=True)
    weights, unit = (
        assembly.lattice.interpolation(found.points)[0],
        static_displacement(assembly, matter),
    )
    u = np.zeros_like(unit)
    for i, load in enumerate(loads):
        u = at_rest(assembly, matter, load, u)
        field, truth = weights @ u, found.neo_hookean[i]
        yield Compared(
            spacing,
            load,
            found.strains[i],
            largest_strain(assembly.lattice, u),
            difference(load * found.linear, truth),
            difference(found.st_venant_kirchhoff[i], truth),
            difference(found.springs[i], truth),
            difference(field, truth),
            difference(field, found.springs[i]),
            difference(weights @ unit, found.linear),
            difference(field, found.st_venant_kirchhoff[i]),
            difference(found.coarse[i], truth) / found.left,
        )


def read_compared() -> list[Compared]:
    """Rows of the table against elements as written."""
    return tables.read(ELEMENTS_TABLE, Compared)


def main() -> None:
    """Write both tables."""
    tables.write(TABLE, rows(), DIGITS)
    tables.write(ELEMENTS_TABLE, compared(), DIGITS)


if __name__ == "__main__":
    main()
