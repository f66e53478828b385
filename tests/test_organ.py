"""The built-in liver, its meshes, and places on it."""

import numpy as np
import pytest

from study.mesh import locate as locating
from study.mesh.kinds import TetrahedralMesh
from study.mesh.locate import locate
from study.mesh.quadrature import over_surface, over_volume
from study.mesh.tetrahedra import boundary, refined, smallest_dihedral_angle, volumes
from study.organ import isosurface_stuffing, liver
from study.organ.block import block_mesh
from study.organ.isosurface_stuffing import stuff
from study.organ.occupancy import ImplicitBody, MeshBody
from study.problem.contact import Foundation, ToolPatch
from study.scene import Place
from study.scene.file import read_scene, resolved, validate
from study.scene.place import OUTWARD, refuse_far, resolve
from study.scene.problem import problem_of

VOLUME = 1.5e-3
MOVED = np.array([2.0, 0.0, -0.01])
"""What was subtracted from the coordinates of an organ's file [m]."""


def signed(points):
    return liver.signed_function(points, VOLUME)


@pytest.fixture(scope="module")
def liver_mesh():
    return stuff(signed, *liver.bounding_box(VOLUME), 0.015)


def grid_volume(step):
    axes = [np.arange(a, b, step) for a, b in zip(*liver.bounding_box(VOLUME), strict=True)]
    return ImplicitBody(signed).occupancy(*axes).sum() * step**3


def test_built_in_liver_has_the_volume_asked_for():
    # Midpoint counting on a smooth body errs by about step^2; 2 mm gives 1e-3.
    assert grid_volume(2e-3) == pytest.approx(VOLUME, rel=1e-3)


def test_built_in_liver_is_of_adult_size():
    """SHIP MRI: 1505 +- 385 mL over 2773 adults (Eur J Radiol 106:32)."""
    assert abs(VOLUME * 1e6 - 1505) < 385


def test_mesh_is_conforming_closed_and_of_one_piece(liver_mesh):
    surface = boundary(liver_mesh)
    sides = np.sort(surface.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, count = np.unique(sides, axis=0, return_counts=True)
    assert (count == 2).all()
    assert len(surface.points) - len(edges) + len(surface.triangles) == 2  # Euler: a sphere
    assert (volumes(liver_mesh) > 0).all()


def test_mesh_vertices_lie_on_the_surface(liver_mesh):
    assert np.abs(signed(boundary(liver_mesh).points)).max() < 1e-8


@pytest.mark.parametrize("size", [0.03, 0.02, 0.017, 0.012])
def test_no_tetrahedron_is_flat(size):
    # Simplified stencils void the published bound of 10.7 degrees; 15 holds for this shape.
    mesh = stuff(signed, *liver.bounding_box(VOLUME), size)
    assert smallest_dihedral_angle(mesh).min() > 15


def test_mesh_volume_converges_at_second_order():
    errors = [
        VOLUME - volumes(stuff(signed, *liver.bounding_box(VOLUME), h)).sum()
        for h in (0.024, 0.012)
    ]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.3)


def test_refining_keeps_volume_and_surface(liver_mesh):
    finer = refined(liver_mesh)
    assert len(finer.tetrahedra) == 8 * len(liver_mesh.tetrahedra)
    assert volumes(finer).min() > 0
    assert volumes(finer).sum() == pytest.approx(volumes(liver_mesh).sum(), rel=1e-12)
    assert len(boundary(finer).triangles) == 4 * len(boundary(liver_mesh).triangles)


def test_volume_rule_is_exact_to_its_degree():
    rule = over_volume(block_mesh((0.2, 0.15, 0.08), 0.05), 3)
    x, y, _ = rule.points.T
    exact = 0.2**4 / 4 * 0.15**2 / 2 * 0.08  # x^3 y of degree 4 <= 2 n - 1
    assert rule.weights @ (x**3 * y) == pytest.approx(exact, rel=1e-13)
    assert (rule.weights > 0).all()


def test_surface_rule_satisfies_the_divergence_theorem(liver_mesh):
    rule = over_surface(boundary(liver_mesh), 2)
    assert np.abs(rule.weights @ rule.normals).max() < 1e-15
    enclosed = rule.weights @ (rule.points * rule.normals).sum(axis=1) / 3
    assert enclosed == pytest.approx(volumes(liver_mesh).sum(), rel=1e-12)


def test_locate_reproduces_linear_fields(liver_mesh, rng):
    inside = over_volume(liver_mesh, 1).points
    points = inside + rng.uniform(-2e-4, 2e-4, inside.shape)
    cell, weight = locate(liver_mesh, points)
    again = np.einsum("qv,qvd->qd", weight, liver_mesh.points[liver_mesh.tetrahedra[cell]])
    assert weight.min() > -1e-12
    assert np.abs(again - points).max() < 1e-15


def test_few_tetrahedra_find_what_many_do(liver_mesh, rng, monkeypatch):
    points = liver_mesh.points.mean(axis=0) + rng.uniform(-0.15, 0.15, (2000, 3))  # outside too
    found = locate(liver_mesh, points)
    monkeypatch.setattr(locating, "FEW", locating.CANDIDATES)
    every = locate(liver_mesh, points)
    assert all(np.array_equal(*pair) for pair in zip(found, every, strict=True))
    monkeypatch.setattr(locating, "FEW", 1)
    monkeypatch.setattr(locating, "INSIDE", -np.inf)  # negative control: the first will do
    assert not np.array_equal(locate(liver_mesh, points)[0], found[0])


def test_mesh_and_implicit_bodies_agree_but_for_the_facets():
    radius, size, step = 0.06, 0.015, 3e-3

    def sphere(points):
        return np.linalg.norm(points, axis=-1) - radius

    corner = np.full(3, 0.07)
    axes = [np.arange(-0.07, 0.07, step)] * 3
    exact = ImplicitBody(sphere).occupancy(*axes)
    meshed = MeshBody(stuff(sphere, -corner, corner, size)).occupancy(*axes)
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    assert 0 < (exact != meshed).sum() < 0.05 * exact.sum()
    # A facet of circumradius c lies at most c^2 / 2 R below the sphere; c < 0.8 edges.
    assert np.abs(sphere(points[exact != meshed])).max() < (0.8 * size) ** 2 / (2 * radius)


def test_places_lie_on_the_surface_seen_from_their_side(liver_mesh):
    surface = boundary(liver_mesh)
    for side, outward in OUTWARD.items():
        point, normal = resolve(Place(side=side, at=(0.5, 0.5)), surface)
        assert abs(signed(point)) < 2e-3
        assert normal @ outward > 0
        nothing_outside = signed(point + 3e-3 * outward)
        assert nothing_outside > 0


def test_a_place_on_a_face_of_a_block_is_exact():
    surface = boundary(block_mesh((0.12, 0.08, 0.06), 0.02))
    point, normal = resolve(Place(side="superior", at=(0.25, 0.5)), surface)
    assert point == pytest.approx([0.03, 0.04, 0.06])
    assert normal == pytest.approx([0, 0, 1])
    point, _ = resolve(Place(fraction=(0.5, 0.5, 0.9)), surface)
    assert point == pytest.approx([0.06, 0.04, 0.06])
    point, _ = resolve(Place(point=(0.06, 0.04, 0.05), snap=False), surface)
    assert point == pytest.approx([0.06, 0.04, 0.05])


def test_a_point_far_from_the_organ_is_refused_by_its_key():
    """It would move to the nearest corner, with an exit code of 0."""
    surface = boundary(block_mesh((0.12, 0.08, 0.06), 0.02))
    size = float(np.linalg.norm([0.12, 0.08, 0.06]))
    near, far = (Place(point=(0.12 + times * size, 0.04, 0.03)) for times in (0.99, 1.01))
    refuse_far({"tool.place": near, "support.place": Place(side="left", at=(0, 0))}, surface, MOVED)
    with pytest.raises(ValueError, match=r"^control_points.a.point: is 157.8 mm off .*; move it$"):
        refuse_far({"tool.place": near, "control_points.a": far}, surface, np.zeros(3))
    with pytest.raises(ValueError, match=r"by \(-2000, 0, 10\) mm, and points are not; move it"):
        refuse_far({"tool.place": far}, surface, MOVED)


@pytest.mark.parametrize(
    "key", ["tool.place", "control_points.tool", "support.place", "tool.2.place"]
)
def test_every_point_of_a_scene_is_looked_at(key):
    table = resolved(read_scene("block"))
    far = {"point": ["1 m", "1 m", "1 m"]}
    table["tool"] = [table["tool"], dict(table["tool"])]
    if key == "tool.2.place":
        table["tool"][1]["place"] = far
    elif key == "tool.place":
        table["tool"][0]["place"] = far
    elif key == "support.place":
        table["support"] |= {"place": far, "radius": "1 cm"}
    else:
        table["control_points"] = {"tool": far}
    with pytest.raises(ValueError, match=rf"^{key}.point: is .* off the organ"):
        problem_of(validate(table, "made"))


def test_a_place_beside_a_concave_organ_falls_back_to_the_nearest_surface():
    mesh = block_mesh((0.04, 0.04, 0.04), 0.02)
    kept = mesh.points[mesh.tetrahedra].mean(axis=1)[:, :2].sum(axis=1) < 0.04  # an L shape's half
    surface = boundary(TetrahedralMesh(mesh.points, mesh.tetrahedra[kept]))
    point, _ = resolve(Place(side="superior", at=(1.0, 1.0)), surface)
    assert np.isfinite(point).all()
    assert point[0] + point[1] < 0.0801


def test_support_counts_only_area_that_faces_its_side():
    support = Foundation(np.array([0.0, 0.0, -1.0]), 0.0, 0.01, 5.0)
    normals = np.array([[0, 0, -1.0], [1.0, 0, 0], [0, 0, 1.0]])
    assert support.density(np.zeros((3, 3)), normals) == pytest.approx([5.0, 0, 0])
    deep = np.array([[0, 0, 0.0049], [0, 0, 0.0101]])
    assert support.density(deep, normals[[0, 0]]) == pytest.approx([5.0, 0.0])


def test_tool_profile_is_that_of_its_radius():
    tool = ToolPatch(np.zeros(3), np.array([0, 0, -1.0]), 0.02, 1.0)
    points = np.array([[0, 0, 0], [0.01, 0, 0], [0.0201, 0, 0], [0, 0, 0.05]])
    up = np.tile([0, 0, 1.0], (4, 1))
    assert tool.profile(points, up) == pytest.approx([1.0, 0.5625, 0.0, 0.0])
    assert not tool.profile(points, -up).any()


def bisected(signed, inside, outside):
    """By bisection alone."""
    low, high = np.zeros(len(inside)), np.ones(len(inside))
    for _ in range(isosurface_stuffing.BISECTIONS):
        middle = 0.5 * (low + high)
        is_inside = signed(inside + middle[:, None] * (outside - inside)) < 0
        low, high = np.where(is_inside, middle, low), np.where(is_inside, high, middle)
    return inside + low[:, None] * (outside - inside)


SHAPES = {
    "smooth": lambda p: np.linalg.norm(p, axis=-1) - 1.0,
    "flat": lambda p: p[..., 0] - 1.0,
    "kinked": lambda p: np.abs(p).max(axis=-1) - 1.0,
    "jumping": lambda p: np.sign(np.linalg.norm(p, axis=-1) - 1.0),
    "steep": lambda p: np.expm1(40.0 * (np.linalg.norm(p, axis=-1) - 1.0)),
}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("guesses", [0, isosurface_stuffing.GUESSES])
def test_a_crossing_is_the_one_of_bisection_to_the_bit(shape, guesses, rng, monkeypatch):
    monkeypatch.setattr(isosurface_stuffing, "GUESSES", guesses)
    ways = rng.normal(size=(200, 3))
    inside, outside = (r * ways / np.linalg.norm(ways, axis=1)[:, None] for r in (0.4, 1.9))
    ends = [SHAPES[shape](points) for points in (inside, outside)]
    kept = (ends[0] < 0) & (ends[1] > 0)
    found = isosurface_stuffing._crossing(SHAPES[shape], inside[kept], outside[kept])
    assert np.array_equal(found, bisected(SHAPES[shape], inside[kept], outside[kept]))


def test_a_crossing_takes_less_than_half_of_the_looks_of_bisection(rng):
    looks = []

    def counted(points):
        looks.append(len(points))
        return np.linalg.norm(points, axis=-1) - 1.0

    ways = rng.normal(size=(200, 3))
    isosurface_stuffing._crossing(counted, 0.1 * ways / 10.0, ways / 0.01)
    assert sum(looks) < 0.5 * isosurface_stuffing.BISECTIONS * len(ways)
