"""Meshes as plain arrays, and the report on a mesh file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]


class MeshError(ValueError):
    """A mesh that cannot be used; the message names the place, the reason and the remedy."""


@dataclass(frozen=True)
class TetrahedralMesh:
    """Positively oriented tetrahedra: points [m], shape (n, 3); tetrahedra, shape (t, 4)."""

    points: FloatArray
    tetrahedra: IndexArray


@dataclass(frozen=True)
class SurfaceMesh:
    """Closed surface with outward triangles: points [m], shape (n, 3); triangles, shape (k, 3)."""

    points: FloatArray
    triangles: IndexArray


@dataclass(frozen=True)
class Sliver:
    """A poorly shaped tetrahedron, by its index in the file (0-based, tetrahedra only)."""

    element: int
    dihedral: float
    """Smallest dihedral angle [degrees]; 70.5 in a regular tetrahedron."""
    aspect: float
    """Longest edge / (2 sqrt(6) inradius); 1 in a regular tetrahedron."""


@dataclass(frozen=True)
class TetrahedronQuality:
    """Shape figures of a tetrahedral mesh."""

    dihedral_min: float
    """Smallest dihedral angle [degrees]."""
    dihedral_median: float
    """Median over the elements of their smallest dihedral angle [degrees]."""
    below_10_degrees: int
    """Number of elements with a dihedral angle below 10 degrees."""
    aspect_max: float
    edge_min: float
    """Shortest edge [m]."""
    edge_max: float
    """Longest edge [m]."""
    height_min: float
    """Smallest height [m] of any tetrahedron: an explicit step is proportional to it."""
    height_min_without_worst: float
    """The same without the elements listed in `worst`; nan if there are no others."""
    worst: tuple[Sliver, ...]
    """Up to ten elements with the smallest dihedral angles, worst first."""


@dataclass(frozen=True)
class SurfaceQuality:
    """Shape figures of a closed surface."""

    genus: int
    """Number of handles; an organ has none."""
    angle_min: float
    """Smallest corner angle [degrees]."""
    edge_min: float
    """Shortest edge [m]."""
    edge_max: float
    """Longest edge [m]."""


@dataclass(frozen=True)
class MeshReport:
    """What was found in a mesh file, and the changes made."""

    file: str
    sha256: str
    unit: str
    """Length unit of the file: m, dm, cm, mm, um or in."""
    scale: float
    """Metres per file unit."""
    kind: Literal["tetrahedra", "surface"]
    volume: float
    """Enclosed volume [m^3]."""
    extent: FloatArray
    """Size of the bounding box [m], shape (3,)."""
    offset: FloatArray
    """Position [m] in the file of the mesh's origin, shape (3,); zero unless recentred."""
    node_map: IndexArray
    """For each node of the file its number in the mesh, -1 if dropped."""
    element_map: IndexArray
    """For each tetrahedron (or triangle) of the file its number in the mesh, -1 if dropped."""
    quality: TetrahedronQuality | SurfaceQuality
    notes: tuple[str, ...]
    """Everything found and changed, with counts and first indices; a repair is never silent."""
