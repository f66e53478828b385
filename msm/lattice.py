"""Lattices, and the cubic one over a body: cells with fill fractions, nodes, trilinear weights."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label
from scipy.sparse import csr_array
from scipy.spatial import KDTree

from msm.kinematics import inverted_cells
from study.organ.occupancy import SolidShape
from study.problem.tissue import Tissue
from study.problem.varied import Composition, composition

if TYPE_CHECKING:
    from msm.graded import GradedLattice

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SAMPLES_PER_EDGE = 6
MAX_CELLS = 2_000_000
SMALLEST_FILL = 0.05
"""Emptier cells are left out: their corners would hang on almost nothing."""

# Corner c of a cell lies at the bits of c: x is the highest bit, z the lowest.
CORNERS = np.array([[(c >> 2) & 1, (c >> 1) & 1, c & 1] for c in range(8)])
EXTRAPOLATION = 0.75
"""How far outside its cell, in spacings, a point may lie before its weights are clamped."""


class LatticeMesh(Protocol):
    """What a model needs to know of its lattice, whatever the cells."""

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
        """Weights (q, n) of the nodes at points [m] (q, 3), and how many lie outside all cells."""

    def inverted_cells(self, displacement: Floats) -> int:
        """How many cells are turned inside out by a displacement [m] (n, 3)."""


@dataclass(frozen=True, eq=False)
class CellLattice:
    """Nodes [m] (n, 3); cells (c, 8) of node numbers, corners in the order of CORNERS.

    `fill` (c,): share of each cell inside the body; `origin` [m] (3,) and `index` (c, 3): where the
    cells lie; `dropped`: share of the body's volume in cells left out.
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
        """Edge [m] of each cell (c,), alike."""
        return np.full(len(self.cells), self.spacing)

    def interpolation(self, points: Floats) -> tuple[csr_array, int]:
        """Trilinear weights (q, n), see `interpolation`."""
        return interpolation(self, points)

    def inverted_cells(self, displacement: Floats) -> int:
        """How many cells a displacement [m] (n, 3) turns inside out: J <= 0 of the mean F."""
        return int(inverted_cells(self.cells, self.edges, displacement))


def build(body: SolidShape, lower: Floats, upper: Floats, spacing: float) -> CellLattice:
    """Lattice of a body within the box `lower`, `upper` [m].

    The cells start at the lower corner. Only the largest set of cells joined by faces is kept, for
    a piece that hangs on an edge would hinge freely. ValueError if no cell is left.
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
    """Share of each cell inside the body, from a regular grid of points in it."""
    s = SAMPLES_PER_EDGE
    axes = [origin[i] + spacing * (np.arange(shape[i] * s) + 0.5) / s for i in range(3)]
    inside = body.occupancy(*axes)
    counts = inside.reshape(shape[0], s, shape[1], s, shape[2], s).sum(axis=(1, 3, 5))
    return np.asarray(counts / s**3)


def node_volumes(lattice: CellLattice) -> Floats:
    """Volume [m^3] of the body that each node stands for, shape (n,)."""
    return at_nodes(lattice, lattice.fill)


def at_nodes(lattice: CellLattice, density: Floats) -> Floats:
    """An eighth of a density (c,) times a cell's volume, of all cells at a node, shape (n,)."""
    share = np.repeat(density * lattice.spacing**3 / 8.0, 8)
    volumes = np.bincount(lattice.cells.ravel(), weights=share, minlength=len(lattice.nodes))
    return volumes.astype(np.float64)


def composed(lattice: CellLattice | GradedLattice, tissue: Tissue | None) -> Composition | None:
    """What each cell is made of, were it whole; None for tissue that is the same everywhere.

    From as many points of each cell as tell how full it is.
    """
    s = SAMPLES_PER_EDGE
    inside = np.stack(np.meshgrid(*[(np.arange(s) + 0.5) / s] * 3, indexing="ij"), axis=-1)

    def points(cells: slice) -> Floats:
        corners, edges = lattice.index[cells][:, None, :], lattice.edges[cells][:, None, None]
        return np.asarray(lattice.origin + edges * (corners + inside.reshape(-1, 3)))

    return composition(tissue, len(lattice.cells), points)


def interpolation(lattice: CellLattice, points: Floats) -> tuple[csr_array, int]:
    """Trilinear weights (q, n) at points [m] (q, 3), and how many points lie outside all cells.

    Those are extrapolated from the nearest cell, which keeps force and moment of a load.
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
