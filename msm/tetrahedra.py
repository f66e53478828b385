"""Springs along the edges of a tetrahedral mesh: common, and less accurate than a lattice.

Each edge of length L gets k = E sum(V) / L^2, summed over the tetrahedra round it (Van Gelder 1998,
J. Graph. Tools 3(2)). Uniform strain explains the constant. Each tetrahedron of volume V adds E V
to k L^2 of six edges, so the springs have C_ijkl = 6 E <n_i n_j n_k n_l> over their directions n.
Uniformly distributed directions give C44 = C12 = 6 E / 15 = 0.4 E, the material of E and nu = 1/4.

No mesh attains that. A periodic mesh has few spring directions and is anisotropic. In an irregular
mesh the nodes are no centres of symmetry: they relax under uniform strain, which reduces the moduli
by an amount that depends on the mesh. Neither refinement nor another spring stiffness removes these
errors. The tests quantify them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from msm.assembly import Assembly, contact, held
from msm.calibration import reference_stiffness
from msm.springs import Springs
from study.mesh.kinds import TetrahedralMesh
from study.mesh.locate import locate
from study.mesh.quadrature import SurfaceRule
from study.mesh.tetrahedra import EDGES, edges, mean_edge, volumes
from study.problem.contact import ToolPatch
from study.problem.heterogeneous import of_tetrahedra
from study.problem.supports import Support
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

OUTSIDE = 1e-9
"""A point with a barycentric coordinate below minus this lies outside; above, on a face."""


@dataclass(frozen=True)
class TetrahedralLattice:
    """A tetrahedral mesh as a lattice."""

    mesh: TetrahedralMesh

    @property
    def nodes(self) -> Floats:
        """Nodes [m] (n, 3)."""
        return self.mesh.points

    @property
    def cells(self) -> Ints:
        """Tetrahedra (c, 4)."""
        return self.mesh.tetrahedra

    @property
    def spacing(self) -> float:
        """Mean edge [m]; Hooke(reference_stiffness(E, spacing)) is the law of modulus E."""
        return mean_edge(self.mesh)

    def interpolation(self, points: Floats) -> tuple[csr_array, int]:
        """Linear weights (q, n) at points [m] (q, 3), and the number outside all tetrahedra.

        At those a nearby tetrahedron is extrapolated, which preserves force and moment of a load.
        """
        tetrahedron, barycentric = locate(self.mesh, points)
        rows = np.repeat(np.arange(len(points)), 4)
        columns = self.mesh.tetrahedra[tetrahedron].ravel()
        shape = (len(points), len(self.mesh.points))
        outside = int((barycentric.min(axis=1) < -OUTSIDE).sum())
        return csr_array((barycentric.ravel(), (rows, columns)), shape=shape), outside

    def inverted_cells(self, displacement: Floats) -> int:
        """Number of tetrahedra that a displacement [m] (n, 3) inverts."""
        moved = TetrahedralMesh(self.mesh.points + displacement, self.mesh.tetrahedra)
        return int((volumes(moved) <= 0.0).sum())


def assemble(
    mesh: TetrahedralMesh,
    surface: SurfaceRule,
    density: float,
    foundation: Support,
    tool: ToolPatch,
    tissue: Tissue | None = None,
) -> Assembly:
    """Springs on a mesh. ValueError if it is not held, or not touched by the tool.

    `density` [kg/m^3] of the homogeneous tissue; `tissue` has its inclusions, if any.
    """
    lattice, made = TetrahedralLattice(mesh), of_tetrahedra(mesh, tissue)
    weights, _ = lattice.interpolation(surface.points)
    by_volume = density * node_volumes(mesh)
    whole = Assembly(
        lattice,
        connect(mesh),
        by_volume if made is None else at_nodes(mesh, made.density(density)),
        *contact(weights, surface, foundation, tool),
        made,
        partial(connect, mesh),
    )
    return held(whole, weights, surface, foundation)


def connect(mesh: TetrahedralMesh, stiffness: Floats | None = None) -> Springs:
    """One spring per edge, with weights relative to the reference stiffness of the mean edge.

    `stiffness` (c,): relative stiffness of each tetrahedron, 1 by default.
    """
    ends = edges(mesh.tetrahedra)
    rest = mesh.points[ends[:, 1]] - mesh.points[ends[:, 0]]
    whole = volumes(mesh) if stiffness is None else volumes(mesh) * stiffness
    weight = _round(mesh, ends, whole) / (rest**2).sum(axis=1)
    return Springs(ends, rest, weight / reference_stiffness(1.0, mean_edge(mesh)))


def _round(mesh: TetrahedralMesh, ends: Ints, values: Floats) -> Floats:
    """Sum of the values (c,) of the tetrahedra at each edge."""
    row_major = np.array([len(mesh.points), 1])
    pairs = np.sort(mesh.tetrahedra[:, EDGES], axis=2) @ row_major
    edge = np.searchsorted(ends @ row_major, pairs)
    share = np.repeat(values, len(EDGES))
    return np.bincount(edge.ravel(), weights=share, minlength=len(ends)).astype(np.float64)


def node_volumes(mesh: TetrahedralMesh) -> Floats:
    """Volume [m^3] (n,) lumped at each node, a quarter of each tetrahedron."""
    return at_nodes(mesh, np.ones(len(mesh.tetrahedra)))


def at_nodes(mesh: TetrahedralMesh, density: Floats) -> Floats:
    """Density (c,) times volume of the tetrahedra, lumped at the nodes, (n,)."""
    share = np.repeat(density * volumes(mesh) / 4.0, 4)
    count = len(mesh.points)
    return np.bincount(mesh.tetrahedra.ravel(), share, count).astype(np.float64)
