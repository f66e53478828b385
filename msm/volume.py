"""The volume term: one energy per cell, which lifts Poisson's ratio off the springs' 1/4.

    W = 1/2 kappa V (J - 1)^2,   kappa = lambda - mu

with J = det F of the mean deformation gradient of the cell, F = I + sum_a u_a B_a^T,
B_a = (+-1, +-1, +-1) / (4 h). The springs carry mu and, being central, lambda = mu; the term adds
the rest (after Golec et al. 2020, doi 10.1007/s00371-019-01663-0). One J per cell does not lock.
Linearised, J - 1 is div u. A cell filled to phi counts with phi V.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from msm.calibration import LARGEST_POISSON_RATIO, SPRING_POISSON_RATIO, lame
from msm.graded import GradedLattice
from msm.lattice import CORNERS, CellLattice, LatticeMesh

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


ROUNDING = 1e-9
"""Of kappa, the difference of two moduli."""


@dataclass(frozen=True)
class VolumeTerm:
    """Cells (c, 8), their kappa V [J] and edge [m], each (c,); no cells means no volume term.

    `spacing` [m]: that of the lattice. `poisson_ratio`: of the material that the springs are with
    it.
    """

    cells: Ints
    bulk: Floats
    edges: Floats
    spacing: float
    poisson_ratio: float


def none(spacing: float) -> VolumeTerm:
    """Springs alone."""
    return VolumeTerm(
        np.zeros((0, 8), dtype=np.int64), np.zeros(0), np.zeros(0), spacing, SPRING_POISSON_RATIO
    )


def volume_term(lattice: LatticeMesh, youngs_modulus: float, poisson_ratio: float) -> VolumeTerm:
    """The term that makes the lattice's springs of modulus mu a material of E [Pa] and nu.

    ValueError for a lattice that is not cubic, for a Poisson ratio below 1/4, where kappa is
    negative and swelling gains energy, or above LARGEST_POISSON_RATIO.
    """
    if not isinstance(lattice, CellLattice | GradedLattice):
        raise ValueError(  # noqa: TRY004 - a scene's choice, reported as such
            "springs on tetrahedra have no volume term; leave out lattice.volume_term, or set "
            "lattice.springs to lattice"
        )
    if not SPRING_POISSON_RATIO <= poisson_ratio <= LARGEST_POISSON_RATIO:
        raise ValueError(
            f"a lattice with a volume term has Poisson ratios from {SPRING_POISSON_RATIO} to "
            f"{LARGEST_POISSON_RATIO}, not {poisson_ratio:g}: {_why(poisson_ratio)}; change "
            "tissue.poisson_ratio or leave the term out"
        )
    first, mu = lame(youngs_modulus, poisson_ratio)
    bulk = (first - mu) * lattice.fill * lattice.edges**3
    return VolumeTerm(lattice.cells, bulk, lattice.edges, lattice.spacing, poisson_ratio)


def of_cells(
    lattice: CellLattice | GradedLattice, kappa: Floats, poisson_ratio: float
) -> VolumeTerm:
    """The term of cells with a kappa [Pa] (c,) each, whose surrounding tissue has the given ratio.

    ValueError where kappa is negative, and swelling would gain energy.
    """
    if kappa.min() < -ROUNDING * np.abs(kappa).max():
        raise ValueError(
            "tissue.inclusion: a lattice with a volume term has Poisson ratios from "
            f"{SPRING_POISSON_RATIO}; raise poisson_ratio of the inclusion or leave the term out"
        )
    bulk = kappa * lattice.fill * lattice.edges**3
    return VolumeTerm(lattice.cells, bulk, lattice.edges, lattice.spacing, poisson_ratio)


def _why(poisson_ratio: float) -> str:
    if poisson_ratio < SPRING_POISSON_RATIO:
        return "below, the term would be negative and a swollen body gain energy"
    return "above, the term outweighs the springs more than 50 000 times and is not verified"


def divergence(term: VolumeTerm, node_count: int) -> csr_array:
    """Div u of each cell [1/m] from the nodal displacements, shape (c, 3 n)."""
    slopes = (2.0 * CORNERS - 1.0) / (4.0 * term.edges[:, None, None])
    cells = len(term.cells)
    rows = np.repeat(np.arange(cells), 24)
    columns = (3 * term.cells[:, :, None] + np.arange(3)).ravel()
    return csr_array((slopes.ravel(), (rows, columns)), shape=(cells, 3 * node_count))


def stiffness_matrix(term: VolumeTerm, node_count: int) -> csr_array:
    """Stiffness [N/m] (3 n, 3 n) of the term at rest."""
    d = divergence(term, node_count)
    scaled = csr_array(d.multiply(term.bulk[:, None]))
    return csr_array(d.T @ scaled)
