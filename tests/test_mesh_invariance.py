"""What must not depend on numbering or placement; repairs that repeat; shape figures."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

from study.mesh.load import load_mesh
from tests.mesh_samples import (
    SIDE,
    cube_surface,
    ellipsoid,
    ellipsoid_surface,
    exploded,
    write_surface,
    write_tetrahedra,
)

RNG = np.random.default_rng(11)
TURN = np.linalg.qr(RNG.normal(size=(3, 3)))[0]
TURN *= np.sign(np.linalg.det(TURN))
EVEN = [p for p in permutations(range(4)) if np.linalg.det(np.eye(4)[list(p)]) > 0]

# Rotated or shifted coordinates are rounded anew: a few 1e-16 of the size, times the conditioning
# of volume (3) and smallest angle (some 10).
MOVED = 1e-13


def permuted(points, elements):
    order = RNG.permutation(len(points))
    return points[order], np.argsort(order)[elements]


CHANGES = {
    "node numbers": permuted,
    "element order": lambda p, e: (p, e[RNG.permutation(len(e))]),
    "translation": lambda p, e: (p + np.array([0.3, -0.2, 0.1]), e),
    "rotation": lambda p, e: (p @ TURN.T, e),
}


@pytest.mark.parametrize("change", CHANGES)
def test_tetrahedra_are_judged_the_same(tmp_path, change):
    reports = [
        load_mesh(write_tetrahedra(tmp_path / f"{i}.vtu", *mesh), "m")[1]
        for i, mesh in enumerate([ellipsoid(), CHANGES[change](*ellipsoid())])
    ]
    assert reports[1].volume == pytest.approx(reports[0].volume, rel=MOVED)
    for name in ("dihedral_min", "dihedral_median", "aspect_max", "edge_min", "height_min"):
        before, after = (getattr(report.quality, name) for report in reports)
        assert after == pytest.approx(before, rel=MOVED)
    assert reports[1].notes == ()


@pytest.mark.parametrize("change", CHANGES)
def test_surfaces_are_judged_the_same(tmp_path, change):
    reports = [
        load_mesh(write_surface(tmp_path / f"{i}.obj", *mesh), "m")[1]
        for i, mesh in enumerate([ellipsoid_surface(), CHANGES[change](*ellipsoid_surface())])
    ]
    assert reports[1].volume == pytest.approx(reports[0].volume, rel=MOVED)
    assert reports[1].quality.angle_min == pytest.approx(reports[0].quality.angle_min, rel=MOVED)
    assert reports[1].notes == ()


@pytest.mark.parametrize("order", EVEN)
def test_even_permutations_of_a_tetrahedron_change_nothing(tmp_path, order):
    points, tetrahedra = ellipsoid()
    path = write_tetrahedra(tmp_path / "a.vtu", points, tetrahedra[:, order])
    mesh, report = load_mesh(path, "m")
    assert np.array_equal(mesh.tetrahedra, tetrahedra[:, order])
    assert report.volume == pytest.approx(load_volume(tmp_path, points, tetrahedra), rel=1e-14)


def test_an_odd_permutation_is_noticed(tmp_path):
    points, tetrahedra = ellipsoid()
    path = write_tetrahedra(tmp_path / "a.vtu", points, tetrahedra[:, [1, 0, 2, 3]])
    assert "wound the other way" in load_mesh(path, "m")[1].notes[0]


def load_volume(folder, points, tetrahedra):
    return load_mesh(write_tetrahedra(folder / "b.vtu", points, tetrahedra), "m")[1].volume


def test_a_repaired_solid_needs_no_repair(tmp_path):
    points, tetrahedra = exploded(*ellipsoid())
    points = np.vstack([points + 40 + 1e-9 * RNG.normal(size=points.shape), [0.0, 0.0, 0.0]])
    tetrahedra = np.vstack([tetrahedra, tetrahedra[:1]])
    tetrahedra[5:9] = tetrahedra[5:9, ::-1]
    tetrahedra[5:9] = tetrahedra[5:9, [1, 0, 2, 3]]
    first, report = load_mesh(write_tetrahedra(tmp_path / "a.vtu", points, tetrahedra), "m")
    assert len(report.notes) == 5  # unused node, far away, welded, repeated, inverted
    again, second = load_mesh(
        write_tetrahedra(tmp_path / "b.vtu", first.points, first.tetrahedra), "m"
    )
    assert second.notes == ()
    assert np.array_equal(first.points, again.points)
    assert np.array_equal(first.tetrahedra, again.tetrahedra)


def test_a_repaired_surface_needs_no_repair(tmp_path):
    points, triangles = exploded(*ellipsoid_surface())
    triangles = np.vstack([triangles[:, ::-1], triangles[:3]])
    triangles[7] = triangles[7, ::-1]
    first, report = load_mesh(write_surface(tmp_path / "a.obj", points, triangles), "m")
    assert len(report.notes) == 4  # welded, repeated, against neighbours, inwards
    again, second = load_mesh(write_surface(tmp_path / "b.obj", first.points, first.triangles), "m")
    assert second.notes == ()
    assert np.array_equal(first.points, again.points)
    assert np.array_equal(first.triangles, again.triangles)


def test_a_regular_tetrahedron_has_the_textbook_figures(tmp_path):
    corners = SIDE * np.array([[0, 0, 0], [0, 1, 1], [1, 0, 1], [1, 1, 0]])
    path = write_tetrahedra(tmp_path / "a.vtu", corners, [[0, 1, 2, 3]])
    report = load_mesh(path, "m")[1]
    edge = SIDE * np.sqrt(2)
    assert report.volume == pytest.approx(edge**3 / (6 * np.sqrt(2)), rel=1e-14)
    assert report.quality.dihedral_min == pytest.approx(np.degrees(np.arccos(1 / 3)), rel=1e-14)
    assert report.quality.aspect_max == pytest.approx(1.0, rel=1e-14)
    assert report.quality.height_min == pytest.approx(edge * np.sqrt(2 / 3), rel=1e-14)
    assert (report.quality.edge_min, report.quality.edge_max) == pytest.approx((edge, edge))
    assert np.isnan(report.quality.height_min_without_worst)


def test_a_cube_has_the_textbook_corner_angle(tmp_path):
    report = load_mesh(write_surface(tmp_path / "a.obj", *cube_surface()), "m")[1]
    assert report.quality.angle_min == pytest.approx(45.0, rel=1e-14)
    assert report.quality.edge_max == pytest.approx(SIDE * np.sqrt(2), rel=1e-14)
