"""Shape measures of tetrahedra and surfaces."""

from __future__ import annotations

import numpy as np

from study.mesh.check import heights
from study.mesh.kinds import (
    FloatArray,
    IndexArray,
    Sliver,
    SurfaceMesh,
    SurfaceQuality,
    TetrahedralMesh,
    TetrahedronQuality,
)
from study.mesh.surface import genus
from study.mesh.tetrahedra import EDGES, smallest_dihedral_angle, volumes
from study.mesh.topology import faces_of

_WORST = 10
_SLIVER = (1.0, 100.0)  # dihedral angle [degrees] below, aspect above which an element is noted


def tetrahedron_quality(mesh: TetrahedralMesh, element_ids: IndexArray) -> TetrahedronQuality:
    """Quality of a checked mesh; `element_ids` are the elements' numbers in the file."""
    dihedral = smallest_dihedral_angle(mesh)
    aspect = _aspect(mesh)
    height = heights(mesh.points, mesh.tetrahedra)
    length = _edge_lengths(mesh)
    order = np.argsort(dihedral, kind="stable")
    others = height[order[_WORST:]]
    return TetrahedronQuality(
        dihedral_min=float(dihedral.min()),
        dihedral_median=float(np.median(dihedral)),
        below_10_degrees=int((dihedral < 10).sum()),
        aspect_max=float(aspect.max()),
        edge_min=float(length.min()),
        edge_max=float(length.max()),
        height_min=float(height.min()),
        height_min_without_worst=float(others.min()) if len(others) else float("nan"),
        worst=tuple(
            Sliver(int(element_ids[i]), float(dihedral[i]), float(aspect[i]))
            for i in order[:_WORST]
        ),
    )


def sliver_notes(quality: TetrahedronQuality) -> list[str]:
    """A warning about extremely thin elements, if there are any."""
    worst = quality.worst[0]
    if worst.dihedral >= _SLIVER[0] and quality.aspect_max <= _SLIVER[1]:
        return []
    return [
        f"WARNING: slivers; element (0-based) {worst.element} has a dihedral angle of "
        f"{worst.dihedral:.2g} degrees, the largest aspect is {quality.aspect_max:.3g}, the "
        f"smallest height {quality.height_min:.2g} m "
        f"({quality.height_min_without_worst:.2g} m without the {len(quality.worst)} worst); an "
        "explicit step shrinks in proportion"
    ]


def surface_quality(mesh: SurfaceMesh) -> SurfaceQuality:
    """Quality of a checked surface."""
    corner = mesh.points[mesh.triangles]
    forward = np.roll(corner, -1, axis=1) - corner
    length = np.linalg.norm(forward, axis=2)
    return SurfaceQuality(
        genus=genus(mesh.triangles),
        angle_min=float(np.degrees(_corner_angles(forward).min())),
        edge_min=float(length.min()),
        edge_max=float(length.max()),
    )


def _corner_angles(forward: FloatArray) -> FloatArray:
    """Angles [rad] at the corners of triangles given by their three sides in a row."""
    back = -np.roll(forward, 1, axis=1)
    cross = np.linalg.norm(np.cross(forward, back), axis=2)
    return np.asarray(np.arctan2(cross, np.einsum("kid,kid->ki", forward, back)))


def _aspect(mesh: TetrahedralMesh) -> FloatArray:
    """Longest edge / (2 sqrt(6) inradius), with the inradius 3 V / surface."""
    corner = mesh.points[faces_of(mesh.tetrahedra)]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    surface = 0.5 * np.linalg.norm(normal, axis=1).reshape(-1, 4).sum(axis=1)
    longest = _edge_lengths(mesh).max(axis=1)
    return np.asarray(longest * surface / (2 * np.sqrt(6) * 3 * volumes(mesh)))


def _edge_lengths(mesh: TetrahedralMesh) -> FloatArray:
    ends = mesh.points[mesh.tetrahedra[:, EDGES]]
    return np.asarray(np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2))
