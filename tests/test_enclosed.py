"""Tetrahedra inside a closed surface: reproducible, and of any shape that has a volume."""

from __future__ import annotations

import numpy as np
import pytest

from study.mesh.kinds import MeshError, SurfaceMesh
from study.mesh.signed_distance import SignedDistance
from study.mesh.surface import enclosed_volume
from study.mesh.tetrahedra import boundary, smallest_dihedral_angle, volumes
from study.organ import geometry as geometries
from study.organ.geometry import LOST, LOST_AT_MOST, MAX_TETRAHEDRA, enclosed
from study.organ.occupancy import SurfaceBody
from tests.mesh_samples import cube_surface, ellipsoid_surface, torus

ELLIPSOID = SurfaceMesh(*ellipsoid_surface())
TORUS = SurfaceMesh(*torus(0.06, 0.02, 24))


def box(*size):
    """Surface of a box [m]."""
    points, triangles = cube_surface()
    return SurfaceMesh(points / np.ptp(points, axis=0) * size, triangles)


def same(one, other):
    return one.points.tobytes() == other.points.tobytes() and (
        one.tetrahedra.tobytes() == other.tetrahedra.tobytes()
    )


def test_the_tetrahedra_depend_on_the_surface_and_the_size_alone():
    one, other = (enclosed(ELLIPSOID, 0.03) for _ in range(2))
    assert same(one.mesh, other.mesh)
    assert same(one.level(-1).mesh, other.level(-1).mesh)
    assert not same(one.mesh, enclosed(ELLIPSOID, 0.031).mesh)


@pytest.mark.parametrize(
    ("surface", "size", "smaller"),
    [
        (ELLIPSOID, 0.02, False),
        (TORUS, 0.017, True),
        (box(0.06, 0.05, 0.006), 0.017, True),
        (box(0.2, 0.012, 0.012), 0.017, False),
    ],
    ids=["ellipsoid", "torus", "slab", "rod"],
)
def test_a_body_keeps_its_volume_and_lies_on_its_surface(surface, size, smaller):
    geometry = enclosed(surface, size)
    exact = enclosed_volume(surface.points, surface.triangles)
    inside = volumes(geometry.mesh)
    assert inside.min() > 0
    assert abs(inside.sum() / exact - 1) <= LOST
    assert len(inside) <= MAX_TETRAHEDRA
    assert smallest_dihedral_angle(geometry.mesh).min() > 5.0
    on_surface = geometry.surface.points
    np.testing.assert_allclose(geometry.project(on_surface), on_surface, atol=1e-9)
    assert ("would change the volume more" in geometry.notes[-1]) == smaller


def test_coarser_meshes_are_of_the_same_body():
    geometry = enclosed(ELLIPSOID, 0.02)
    exact = enclosed_volume(ELLIPSOID.points, ELLIPSOID.triangles)
    for level in filter(None, map(geometry.level, range(-3, 0))):
        assert abs(volumes(level.mesh).sum() / exact - 1) <= LOST_AT_MOST


@pytest.mark.parametrize("surface", [ELLIPSOID, TORUS, box(0.1, 0.08, 0.06)])
def test_what_lies_inside_by_turns_lies_inside_by_distance(surface):
    low, high = surface.points.min(axis=0) - 0.01, surface.points.max(axis=0) + 0.01
    axes = [np.linspace(a, b, 13) for a, b in zip(low, high, strict=True)]
    inside = SurfaceBody(surface).occupancy(*axes)
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    distance = SignedDistance(surface)(points)
    clear = np.abs(distance) > 1e-6
    assert inside.any()
    np.testing.assert_array_equal(inside[clear], (distance < 0)[clear])


def test_lines_through_edges_and_nodes_count_once():
    surface = box(0.1, 0.1, 0.1)
    centre = surface.points.mean(axis=0)
    axes = [np.linspace(-0.06, 0.06, 13) + at for at in centre]  # diagonals pass through the points
    inside = SurfaceBody(surface).occupancy(*axes)
    core = slice(2, 11)
    assert inside[core, core, core].all()
    assert not inside[0].any()
    assert not inside[:, -1].any()
    assert not inside[:, :, 0].any()


def test_a_distance_is_that_of_the_nearest_point():
    ball = SurfaceMesh(*ellipsoid_surface())
    points = np.random.default_rng(0).uniform(-0.1, 0.1, (50, 3))
    distance = SignedDistance(ball)
    away = np.linalg.norm(distance.nearest(points) - points, axis=1)
    np.testing.assert_allclose(np.abs(distance(points)), away, atol=1e-12)


def test_a_surface_too_thin_for_the_largest_mesh_is_refused(monkeypatch):
    monkeypatch.setattr(geometries, "MAX_TETRAHEDRA", 2000)
    with pytest.raises(MeshError, match=r"organ\.mesh: .*too thin.*reference\.element_size"):
        enclosed(box(0.3, 0.3, 0.0005), 0.017)


def test_the_boundary_is_closed():
    triangles = boundary(enclosed(TORUS, 0.02).mesh).triangles
    ends = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert (np.unique(ends, axis=0, return_counts=True)[1] == 2).all()
