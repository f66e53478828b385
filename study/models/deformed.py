"""The mesh of the finite elements as deformed by them and by the lattice that corrects them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from fem_reference.subspace import Subspace
from fem_reference.superposition import Superposed
from msm.lattice import LatticeMesh
from study.mesh.kinds import TetrahedralMesh
from study.mesh.tetrahedra import volumes
from study.models.mesh_error import MeshSolution
from study.models.remainder import Remainder

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Deformed:
    """The vertices of the finite elements' mesh, displaced by both parts.

    `weights` (v, n): of the coarse lattice's nodes at the vertices; `subspace`: that of the
    elements, with its vectors (3 v, m) at the vertices only; `motion`: of the elements, from
    `start` [m] (v, 3), their displacement under gravity.
    """

    mesh: TetrahedralMesh
    weights: csr_array
    subspace: Subspace
    motion: Superposed
    start: Floats

    @classmethod
    def of(cls, solved: MeshSolution, lattice: LatticeMesh) -> Deformed:
        """The mesh on which the elements were solved."""
        mesh, found = solved.level.mesh, superposed(solved)
        among = found.subspace
        # The unknowns of vertices come before those of edges.
        vertices = np.ascontiguousarray(among.vectors[: mesh.points.size])
        weights, _ = lattice.interpolation(mesh.points)
        own = Subspace(vertices, among.stiffness, among.load, among.others)
        rest = solved.found.start
        start = np.zeros_like(mesh.points) if rest is None else rest[: mesh.points.size]
        return cls(mesh, weights, own, found, start.reshape(-1, 3))

    def state(self, sample: int, found: Remainder) -> tuple[Floats, Floats]:
        """Displacement [m] and velocity [m/s] (v, 3) at a sample."""
        own = self.motion.coordinates[sample], self.motion.rates[sample]
        linear = (np.asarray(self.subspace.vectors @ y).reshape(-1, 3) for y in own)
        u, v = (a + self.weights @ b for a, b in zip(linear, found.nodal[sample], strict=True))
        return self.start + u, v

    def inverted_cells(self, found: Remainder) -> int:
        """Largest number over the samples of inverted cells.

        Counted on the mesh deformed by the sum of both parts, with straight tetrahedra, and on the
        coarse lattice.
        """
        counts = (
            int((volumes(self._deformed(sample, found)) <= 0.0).sum()) for sample in found.samples
        )
        return max(found.lattice.inverted_cells, *counts)

    def largest_strain(self, found: Remainder, frames: tuple[int, ...]) -> float:
        """Largest |principal stretch - 1| of the tetrahedra, over the finite frames."""
        finite = set(frames) & set(found.samples)
        rest = _edges(self.mesh)
        stretches = (
            np.linalg.svd(np.linalg.solve(rest, _edges(self._deformed(k, found))), compute_uv=False)
            for k in finite
        )
        return max((float(np.abs(one - 1.0).max()) for one in stretches), default=0.0)

    def _deformed(self, sample: int, found: Remainder) -> TetrahedralMesh:
        return replace(self.mesh, points=self.mesh.points + self.state(sample, found)[0])


def _edges(mesh: TetrahedralMesh) -> Floats:
    """Three edges [m] (c, 3, 3) of each tetrahedron, as rows."""
    corner = mesh.points[mesh.tetrahedra]
    return np.asarray(corner[:, 1:] - corner[:, :1])


def superposed(solved: MeshSolution) -> Superposed:
    """The superposition of elements solved with Ritz vectors or modes."""
    found = solved.found.superposed
    assert found is not None  # noqa: S101 - of these methods
    return found
