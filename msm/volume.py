"""Volume term: an energy per cell that gives a lattice Poisson ratios above the 1/4 of springs.

    W = 1/2 kappa V (J - 1)^2,   kappa = lambda - mu

with J = det F of the mean deformation gradient of the cell, F = I + sum_a u_a B_a^T,
B_a = (+-1, +-1, +-1) / (4 h). The springs provide mu and, being central, lambda = mu; the term adds
lambda - mu (after Golec et al. 2020, doi 10.1007/s00371-019-01663-0). A single J per cell avoids
volumetric locking. Linearised, J - 1 is div u. A cell of fill fraction phi has volume phi V.
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
"""Rounding of kappa, a difference of two moduli, relative to its largest value."""


@dataclass(frozen=True)
class VolumeTerm:
    """Cells (c, 8) with kappa V, `bulk` [J] (c,), and `edges` [m] (c,); without cells, no term.

    `spacing` [m] of the lattice; `poisson_ratio` of springs and volume term together.
    """

    cells: Ints
    bulk: Floats
    edges: Floats
    spacing: float
    poisson_ratio: float


def none(spacing: float) -> VolumeTerm:
    """No volume term."""
    return VolumeTerm(
        np.zeros((0, 8), dtype=np.int64), np.zeros(0), np.zeros(0), spacing, SPRING_POISSON_RATIO
    )


def volume_term(lattice: LatticeMesh, youngs_modulus: float, poisson_ratio: float) -> VolumeTerm:
    """The volume term of a lattice of Young's modulus E [Pa] and Poisson ratio nu.

    ValueError for a lattice that is not cubic, for a Poisson ratio below 1/4, where kappa is
    negative and the energy not positive definite, or above LARGEST_POISSON_RATIO.
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
    """The volume term of cells with a kappa [Pa] (c,) each, in a tissue of the given Poisson ratio.

    ValueError where kappa is negative.
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
    """Matrix [1/m] (c, 3 n) from nodal displacements to div u of each cell."""
    slopes = (2.0 * CORNERS - 1.0) / (4.0 * term.edges[:, None, None])
    cells = len(term.cells)
    rows = np.repeat(np.arange(cells), 24)
    columns = (3 * term.cells[:, :, None] + np.arange(3)).ravel()
    return csr_array((slopes.ravel(), (rows, columns)), shape=(cells, 3 * node_count))


def stiffness_matrix(term: VolumeTerm, node_count: int) -> csr_array:
    """Stiffness [N/m] (3 n, 3 n) of the volume term at rest."""
    d = divergence(term, node_count)
    scaled = csr_array(d.multiply(term.bulk[:, None]))
    return csr_array(d.T @ scaled)
