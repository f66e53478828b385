"""A measured specimen as a boundary-value problem: body, prescribed displacements and loads."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import TetrahedralMesh
from study.organ.occupancy import SolidShape

Floats = NDArray[np.float64]
Projection = Callable[[Floats], Floats]

PLANE = 1e-9
"""Distance [m] within which a node lies on a plane."""


@dataclass(frozen=True)
class Meshed:
    """One finite-element mesh, and its element size up to a common factor.

    `project` maps points of the mesh's boundary to the exact surface, where that is curved.
    """

    mesh: Callable[[], TetrahedralMesh]
    size: float
    project: Projection | None = None


@dataclass(frozen=True, eq=False)
class Specimen:
    """The part of a body that symmetry leaves, one of `parts` equal ones.

    `body` in the box from `lower` to `upper` [m]. `prescribed` maps points [m] (n, 3) to their
    displacements [m], nan where they are free; everything else scales with the same factor: the
    `acceleration` [m/s^2] of its mass, of a `density` [kg/m^3], and the `forces` [N] (k, 3) at
    points `at` [m]. `watched` [m] (q, 3): where displacements are observed. `along`: the axis and
    the coordinate [m] of the plane whose reaction is the force. `meshes` of the finite elements and
    `spacings` [m] of lattices, coarse to fine.
    """

    meshes: tuple[Meshed, ...]
    spacings: tuple[float, ...]
    body: SolidShape
    lower: Floats
    upper: Floats
    prescribed: Callable[[Floats], Floats]
    poisson_ratio: float
    parts: int = 1
    density: float = 1000.0
    acceleration: Floats = field(default_factory=lambda: np.zeros(3))
    at: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    forces: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    watched: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    along: tuple[int, float] = (2, 0.0)

    def face(self, points: Floats) -> NDArray[np.bool_]:
        """Which points (n, 3) lie on the plane whose reaction is evaluated."""
        axis, level = self.along
        return on_plane(points, axis, level)


def on_plane(points: Floats, axis: int, level: float) -> NDArray[np.bool_]:
    """Which points (n, 3) have this coordinate [m] along an axis."""
    return np.asarray(np.abs(points[:, axis] - level) < PLANE)


def free(points: Floats) -> Floats:
    """Displacements without any prescribed component, to be filled in."""
    return np.full_like(points, np.nan)
