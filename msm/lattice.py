"""Cubic lattice over a body: cells with fill fractions, nodes, trilinear interpolation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label
from scipy.sparse import csr_array
from scipy.spatial import KDTree

from msm.kinematics import inverted_cells
from study.organ.occupancy import SolidShape
from study.problem.heterogeneous import Composition, composition
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SAMPLES_PER_EDGE = 6
MAX_CELLS = 2_000_000
SMALLEST_FILL = 0.05
"""Cells with a smaller fill fraction are dropped: their corners would have almost no stiffness."""

# The bits of a corner's number are its local coordinates: x is the highest bit, z the lowest.
CORNERS = np.array([[(c >> 2) & 1, (c >> 1) & 1, c & 1] for c in range(8)])
EXTRAPOLATION = 0.75
"""Distance of a point from its cell, in spacings, above which the extrapolation is clamped."""


class LatticeMesh(Protocol):
    """Interface of a lattice of any type of cell."""

    def __hash__(self) -> int:
        """Of the object: one lattice is equal to itself alone."""

    @property
    def nodes(self) -> Floats:
        """Nodes [m] (n, 3)."""

    @property
    def cells(self) -> Ints:
        """Node numbers of cubes (c, 8), corners in the order of CORNERS, or tetrahedra (c, 4)."""

    @property
    def spacing(self) -> float:
        """Length [m] at which springs of relative stiffness 1 have k_ref."""

    def interpolation(self, points: Floats) -> tuple[csr_array, int]:
        """Interpolation weights (q, n) at points [m] (q, 3), and the number outside all cells."""

    def inverted_cells(self, displacement: Floats) -> int:
        """Number of cells that a displacement [m] (n, 3) inverts."""


class CubicCells(Protocol):
    """Cubic cells of one or several sizes, placed on a grid of their own edge."""

    @property
    def origin(self) -> Floats:
        """Lower corner [m] (3,) of the box of the cells."""

    @property
    def index(self) -> Ints:
        """Position of each cell (c, 3) from the origin, in units of its own edge."""

    @property
    def edges(self) -> Floats:
        """Edge [m] of each cell (c,)."""


@dataclass(frozen=True, eq=False)
class CellLattice:
    """Cubic cells of one size: nodes [m] (n, 3), and cells (c, 8) of nodes in the order of CORNERS.

    `fill` (c,): fraction of each cell inside the body; cells start at `origin` [m] (3,) plus
    `index` (c, 3) times `spacing` [m]; `dropped`: fraction of the body's volume in dropped cells.
    """

    spacing: float
    origin: Floats
    nodes: Floats
    cells: Ints
    index: Ints
    fill: Floats
    dropped: float

    @property
    def edges(self) -> Floats:
        """Edge [m] of each cell (c,), all equal."""
        return np.full(len(self.cells), self.spacing)

    def interpolation(self, points: Floats) -> tuple[csr_array, int]:
        """Trilinear weights (q, n), see `interpolation`."""
        return interpolation(self, points)

    def inverted_cells(self, displacement: Floats) -> int:
        """Number of cells that a displacement [m] (n, 3) inverts: J <= 0 of the mean F."""
        return int(inverted_cells(self.cells, self.edges, displacement))


def build(body: SolidShape, lower: Floats, upper: Floats, spacing: float) -> CellLattice:
    """Lattice of a body within the box `lower`, `upper` [m].

    The cells start at the lower corner. Only the largest set of cells connected by faces is kept: a
    piece connected by an edge would be a mechanism. ValueError if no cell is left.
    """
    shape = np.maximum(1, np.ceil((upper - lower) / spacing - 1e-6).astype(int))
    if np.prod(shape.astype(float)) > MAX_CELLS:
        raise ValueError(
            f"lattice.spacing: {1e3 * spacing:.3g} mm makes {np.prod(shape.astype(float)):.3g} "
            f"cells in the organ's box, the limit is {MAX_CELLS:.0e}; enlarge it"
        )
    fill = fill_fractions(body, lower, shape, spacing)
    pieces, _ = label(fill >= SMALLEST_FILL)
    sizes = np.bincount(pieces.ravel(), weights=fill.ravel())
    if len(sizes) < 2:
        raise ValueError(
            f"no lattice cell of {spacing:g} m lies in the organ; reduce lattice.spacing"
        )
    kept = pieces == 1 + sizes[1:].argmax()
    index = np.argwhere(kept)
    corner = (index[:, None, :] + CORNERS) @ _strides(shape + 1)
    used, cells = np.unique(corner, return_inverse=True)
    nodes = lower + spacing * np.stack(np.unravel_index(used, shape + 1), axis=1)
    dropped = 1.0 - float(fill[kept].sum() / fill.sum())
    return CellLattice(spacing, lower, nodes, cells.reshape(-1, 8), index, fill[kept], dropped)


def _strides(shape: Ints) -> Ints:
    return np.array([shape[1] * shape[2], shape[2], 1])


def fill_fractions(body: SolidShape, origin: Floats, shape: Ints, spacing: float) -> Floats:
    """Fraction of each cell inside the body, from a regular grid of sample points."""
    s = SAMPLES_PER_EDGE
    axes = [origin[i] + spacing * (np.arange(shape[i] * s) + 0.5) / s for i in range(3)]
    inside = body.occupancy(*axes)
    counts = inside.reshape(shape[0], s, shape[1], s, shape[2], s).sum(axis=(1, 3, 5))
    return np.asarray(counts / s**3)


def node_volumes(lattice: CellLattice) -> Floats:
    """Volume [m^3] (n,) of the body lumped at each node."""
    return at_nodes(lattice, lattice.fill)


def at_nodes(lattice: CellLattice, density: Floats) -> Floats:
    """Density (c,) times cell volume, lumped at the nodes, (n,)."""
    share = np.repeat(density * lattice.spacing**3 / 8.0, 8)
    volumes = np.bincount(lattice.cells.ravel(), weights=share, minlength=len(lattice.nodes))
    return volumes.astype(np.float64)


def composed(lattice: CubicCells, tissue: Tissue | None) -> Composition | None:
    """Tissue of each cell; None for a homogeneous body.

    It is sampled at the same points as the fill fraction, including those outside the body.
    """
    s = SAMPLES_PER_EDGE
    inside = np.stack(np.meshgrid(*[(np.arange(s) + 0.5) / s] * 3, indexing="ij"), axis=-1)

    def points(cells: slice) -> Floats:
        corners, edges = lattice.index[cells][:, None, :], lattice.edges[cells][:, None, None]
        return np.asarray(lattice.origin + edges * (corners + inside.reshape(-1, 3)))

    return composition(tissue, len(lattice.index), points)


def interpolation(lattice: CellLattice, points: Floats) -> tuple[csr_array, int]:
    """Trilinear weights (q, n) at points [m] (q, 3), and the number of points outside all cells.

    At those the nearest cell is extrapolated, which preserves force and moment of a load.
    """
    centres = lattice.origin + lattice.spacing * (lattice.index + 0.5)
    # The cell that holds a point has the nearest centre in the largest-coordinate distance.
    _, cell = KDTree(centres).query(points, p=np.inf)
    local = (points - centres[cell]) / lattice.spacing + 0.5
    outside = int((np.abs(local - 0.5).max(axis=1) > 0.5 + 1e-9).sum())
    local = np.clip(local, -EXTRAPOLATION, 1.0 + EXTRAPOLATION)
    factors = np.where(CORNERS[None], local[:, None, :], 1.0 - local[:, None, :])
    weights = factors.prod(axis=2)
    rows = np.repeat(np.arange(len(points)), 8)
    columns = lattice.cells[cell].ravel()
    shape = (len(points), len(lattice.nodes))
    return csr_array((weights.ravel(), (rows, columns)), shape=shape), outside
