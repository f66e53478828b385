"""Elements curved along a known surface."""

import numpy as np
import pytest
import skfem

from fem_reference.elasticity import discretise
from fem_reference.grid import CurvedMapping, curved, mapping, straight
from fem_reference.observation import at_points, evaluation
from study.mesh.tetrahedra import edges
from study.organ import liver
from study.organ.isosurface_stuffing import stuff
from study.organ.projection import onto_surface
from study.problem.contact import Foundation, ToolPatch
from study.problem.tissue import Tissue

RADIUS = 0.05
VOLUME = 1.5e-3


def ball(points):
    return np.linalg.norm(points, axis=-1) - RADIUS


def organ(points):
    return liver.signed_function(points, VOLUME)


def ball_mesh(size):
    box = np.full(3, 1.2 * RADIUS)
    return stuff(ball, -box, box, size)


def enclosed(grid):
    return skfem.Basis(grid, skfem.ElementTetP1(), mapping(grid), intorder=6).dx.sum()


def to_ball(points):
    return onto_surface(ball, points)


def test_edges_and_facets_are_those_of_scikit_fem():
    mesh = ball_mesh(0.03)
    own, other = straight(mesh), skfem.MeshTet(mesh.points.T.copy(), mesh.tetrahedra.T.copy())
    bent = curved(mesh, to_ball)
    for name in ("edges", "t2e", "facets", "t2f", "f2t"):
        expected = getattr(other, name)
        for grid in (own, bent):
            assert np.array_equal(getattr(grid, name), expected), name
            assert getattr(grid, name).dtype == expected.dtype
    assert np.array_equal(bent.dofs.element_dofs, skfem.MeshTet2.from_mesh(other).dofs.element_dofs)
    assert np.array_equal(edges(mesh.tetrahedra), other.edges.T)


def test_points_move_onto_the_surface(rng):
    near = rng.normal(size=(100, 3))
    near *= (RADIUS + rng.uniform(-0.005, 0.005, (100, 1))) / np.linalg.norm(near, axis=1)[:, None]
    found = to_ball(near)
    assert np.abs(ball(found)).max() < 1e-12
    nearest = RADIUS * near / np.linalg.norm(near, axis=1)[:, None]
    assert np.abs(found - nearest).max() < 1e-9


def test_the_volume_of_a_ball_converges_two_orders_faster_than_with_flat_facets():
    exact, errors = 4 / 3 * np.pi * RADIUS**3, []
    for size in (0.03, 0.015):
        mesh = ball_mesh(size)
        grids = straight(mesh), curved(mesh, to_ball)
        errors.append([abs(enclosed(grid) / exact - 1) for grid in grids])
    (flat_coarse, bent_coarse), (flat_fine, bent_fine) = errors
    assert bent_fine < 0.02 * flat_fine
    assert np.log2(flat_coarse / flat_fine) == pytest.approx(2.0, abs=0.5)
    assert np.log2(bent_coarse / bent_fine) > 3.0


@pytest.mark.parametrize("size", [0.024, 0.0128])
def test_no_element_of_the_liver_is_distorted_and_its_volume_is_right(size):
    """Where the mesh does not follow a groove its edges stay straight."""
    mesh = stuff(organ, *liver.bounding_box(VOLUME), size)
    grid = curved(mesh, lambda points: onto_surface(organ, points))
    inside = np.random.default_rng(1).dirichlet(np.ones(4), 50)[:, 1:].T
    assert mapping(grid).detDF(np.ascontiguousarray(inside)).min() > 0
    assert enclosed(grid) == pytest.approx(VOLUME, rel=4e-3)
    assert enclosed(straight(mesh)) < 0.99 * VOLUME


def test_a_surface_far_off_leaves_the_edges_straight():
    """Negative control of the above: without the limit elements would be inside out."""
    mesh = ball_mesh(0.03)
    grid = curved(mesh, lambda points: 3.0 * points)
    assert enclosed(grid) == pytest.approx(enclosed(straight(mesh)), rel=1e-12)


def test_local_coordinates_are_found_inside_and_a_little_outside(rng):
    mesh = ball_mesh(0.03)
    grid = curved(mesh, to_ball)
    found = mapping(grid)
    assert isinstance(found, CurvedMapping)
    local = rng.dirichlet(np.ones(4), 20)[:, 1:].T[:, None, :] * 1.05
    local = np.ascontiguousarray(np.broadcast_to(local, (3, grid.nelements, 20)))
    cells = np.arange(grid.nelements)
    assert np.abs(found.invF(found.F(local, cells), cells) - local).max() < 1e-9


def test_a_linear_field_is_seen_exactly_through_curved_cells(rng):
    mesh = ball_mesh(0.02)
    tool = ToolPatch(np.array([0.0, 0.0, RADIUS]), np.array([0.0, 0.0, -1.0]), 0.02, 1.0)
    foundation = Foundation(np.array([0.0, 0.0, -1.0]), RADIUS, 0.02, 1e6)
    body = discretise(mesh, Tissue(), foundation, tool, "p2", to_ball)
    points = rng.normal(size=(500, 3))
    points *= RADIUS * rng.uniform(0.1, 1.0, (500, 1)) / np.linalg.norm(points, axis=1)[:, None]
    gradient = rng.normal(size=(3, 3))
    seen = at_points(evaluation(body, points), (body.points @ gradient).ravel())
    assert np.abs(seen - points @ gradient).max() < 1e-12
    assert body.load.reshape(-1, 3).sum(axis=0) == pytest.approx([0, 0, -1], abs=1e-12)
