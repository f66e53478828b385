"""Every defect of a mesh with its diagnosis: repaired and reported, or refused by name."""

from __future__ import annotations

import numpy as np
import pytest

from study.mesh.kinds import MeshError
from study.mesh.listing import one_per_kind
from study.mesh.load import load_mesh
from study.mesh.raw import raw_mesh
from tests.mesh_samples import (
    CUBE_VOLUME,
    SIDE,
    box,
    cube,
    cube_surface,
    ellipsoid,
    ellipsoid_surface,
    exploded,
    klein_bottle,
    torus,
    write_surface,
    write_tetrahedra,
)

# Volumes are sums of a few hundred terms of the order of the result.
ROUNDING = 1e-13


@pytest.fixture
def load_solid(tmp_path):
    def load(points, tetrahedra, unit="m"):
        path = write_tetrahedra(tmp_path / "organ.vtu", points, tetrahedra)
        return load_mesh(path, unit)

    return load


@pytest.fixture
def load_surface(tmp_path):
    def load(points, triangles, unit="m"):
        return load_mesh(write_surface(tmp_path / "organ.obj", points, triangles), unit)

    return load


def noted(report, text):
    return any(text in note for note in report.notes)


# ---- Tetrahedra, repaired ----------------------------------------------------------------------


def test_a_sound_mesh_has_nothing_to_report(load_solid):
    _, report = load_solid(*cube(3))
    assert report.notes == ()
    assert report.volume == pytest.approx(CUBE_VOLUME, rel=ROUNDING)
    np.testing.assert_allclose(report.extent, SIDE)
    assert np.array_equal(report.node_map, np.arange(64))
    assert np.array_equal(report.element_map, np.arange(162))


def test_unused_nodes_are_dropped_with_their_map(load_solid):
    points, tetrahedra = cube()
    mesh, report = load_solid(
        np.insert(points, 3, [9.0, 9.0, 9.0], axis=0), tetrahedra + (tetrahedra > 2)
    )
    assert np.array_equal(mesh.points, points)
    assert report.node_map.tolist() == [0, 1, 2, -1, 3, 4, 5, 6, 7]
    assert noted(report, "1 nodes that no element uses dropped; first: 3 (0-based)")


def test_coincident_nodes_are_welded(load_solid):
    points, tetrahedra = exploded(*cube(2))
    mesh, report = load_solid(points, tetrahedra)
    assert len(mesh.points) == 27
    assert noted(report, "165 nodes welded")
    assert report.volume == pytest.approx(CUBE_VOLUME, rel=ROUNDING)
    assert np.array_equal(mesh.points[report.node_map], points)


@pytest.mark.parametrize(("gap", "closed"), [(0.9e-6, True), (1.1e-6, False)])
def test_the_weld_tolerance_is_a_fraction_of_the_box(load_solid, gap, closed):
    # Two halves of a cube, moved apart by a fraction of the diagonal.
    points, tetrahedra = box((1, 1, 1), (SIDE / 2, SIDE, SIDE))
    shift = [SIDE / 2 + gap * SIDE * np.sqrt(3), 0, 0]
    halves = np.vstack([points, points + shift]), np.vstack([tetrahedra, tetrahedra + 8])
    if closed:
        assert noted(load_solid(*halves)[1], "4 nodes welded")
    else:
        with pytest.raises(MeshError, match="2 pieces"):
            load_solid(*halves)


def test_some_inverted_elements_are_turned(load_solid):
    points, tetrahedra = cube(2)
    wrong = tetrahedra.copy()
    wrong[[5, 7], :2] = wrong[[5, 7], 1::-1]
    _, report = load_solid(points, wrong)
    assert noted(report, "2 of 48 tetrahedra inverted, now turned round; first (0-based): 5, 7")
    assert not noted(report, "WARNING")
    assert report.volume == pytest.approx(CUBE_VOLUME, rel=ROUNDING)


def test_half_the_elements_inverted_is_a_loud_warning(load_solid):
    points, tetrahedra = cube(2)
    tetrahedra[::2] = tetrahedra[::2, [1, 0, 2, 3]]
    assert noted(load_solid(points, tetrahedra)[1], "WARNING: 24 of 48 tetrahedra inverted")


def test_the_other_winding_is_turned(load_solid):
    points, tetrahedra = cube(2)
    mesh, report = load_solid(points, tetrahedra[:, [0, 1, 3, 2]])
    assert np.array_equal(mesh.tetrahedra, tetrahedra)
    assert noted(report, "all 48 tetrahedra wound the other way")


def test_repeated_elements_are_dropped(load_solid):
    points, tetrahedra = cube()
    mesh, report = load_solid(points, np.vstack([tetrahedra, tetrahedra[2, [1, 0, 2, 3]]]))
    assert len(mesh.tetrahedra) == 6
    assert report.element_map.tolist() == [0, 1, 2, 3, 4, 5, -1]
    assert noted(
        report, "1 elements with the same nodes as an earlier one dropped; first (0-based): 6"
    )


def test_a_mesh_far_away_is_recentred(load_solid):
    points, tetrahedra = cube()
    mesh, report = load_solid(points + np.array([50.0, 0, 0]), tetrahedra)
    assert noted(report, "far from the origin")
    np.testing.assert_allclose(report.offset, [50 + SIDE / 2, SIDE / 2, SIDE / 2])
    # The file's coordinates carry the rounding of 50 m in double precision.
    np.testing.assert_allclose(
        mesh.points + report.offset, points + np.array([50.0, 0, 0]), atol=1e-14
    )
    np.testing.assert_allclose(mesh.points.mean(axis=0), 0, atol=1e-14)


def test_slivers_are_listed_and_warned_of(load_solid):
    points, tetrahedra = cube()
    top = [SIDE / 3, SIDE / 3, -1e-4]
    face = [0, 4, 6]  # a triangle of the bottom
    _, report = load_solid(np.vstack([points, top]), np.vstack([tetrahedra, [*face, 8]]))
    assert report.quality.worst[0].element == 6
    assert report.quality.dihedral_min < 1
    assert report.quality.below_10_degrees == 1
    assert report.quality.height_min == pytest.approx(1e-4, rel=1e-12)
    assert noted(report, "WARNING: slivers; element (0-based) 6")


# ---- Tetrahedra, refused -----------------------------------------------------------------------


def flattened(height):
    """A cube whose element 6 is a lid of the given height on its bottom."""
    points, tetrahedra = cube()
    return np.vstack([points, [SIDE / 2, SIDE / 4, -height]]), np.vstack([tetrahedra, [0, 4, 6, 8]])


@pytest.mark.parametrize("height", [0.0, 1e-17, 1e-9])
def test_flat_elements_are_refused_by_index(load_solid, height):
    with pytest.raises(MeshError, match=r"1 of 7 tetrahedra have no volume.*\(0-based\): 6;"):
        load_solid(*flattened(height))


def test_flat_up_to_single_precision_in_a_turned_mesh_is_refused(load_solid):
    points, tetrahedra = flattened(0.0)
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    with pytest.raises(MeshError, match="have no volume"):
        load_solid((points @ turn).astype(np.float32), tetrahedra)


def test_a_lid_just_thick_enough_is_accepted(load_solid):
    assert len(load_solid(*flattened(1e-6))[0].tetrahedra) == 7


def test_a_repeated_node_makes_a_flat_element(load_solid):
    points, tetrahedra = cube()
    tetrahedra[2, 1] = tetrahedra[2, 0]
    with pytest.raises(MeshError, match=r"no volume.*first \(0-based\): 2;"):
        load_solid(points, tetrahedra)


@pytest.mark.parametrize("index", [-1, 8, 999999])
def test_node_numbers_out_of_range_are_refused(load_solid, index):
    points, tetrahedra = cube()
    tetrahedra[4, 2] = index
    with pytest.raises(MeshError, match=r"outside 0 to 7; first element \(0-based\) 4"):
        load_solid(points, tetrahedra)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e7, 1e38])
def test_coordinates_that_cannot_be_are_refused(load_solid, value):
    points, tetrahedra = cube()
    points[5, 1] = value
    with pytest.raises(MeshError, match=r"1 of 8 nodes.*first \(0-based\): 5"):
        load_solid(points, tetrahedra)


def test_a_node_pushed_through_a_face_is_found(load_solid):
    # The element turns inside out; turning its winding round would only hide the overlap.
    points, tetrahedra = cube(2)
    centre = int(np.argmin(np.linalg.norm(points - SIDE / 2, axis=1)))
    points[centre] += [0.6 * SIDE, 0.05 * SIDE, 0.02 * SIDE]
    with pytest.raises(MeshError, match="same side of their common face"):
        load_solid(points, tetrahedra)


def test_one_wrong_node_is_never_silent(load_solid):
    points, tetrahedra = cube(2)
    cases = [(e, c, n) for e in range(0, 48, 7) for c in range(4) for n in range(0, 27, 4)]
    silent = []
    for element, corner, node in cases:
        wrong = tetrahedra.copy()
        wrong[element, corner] = node
        try:
            report = load_solid(points, wrong)[1]
        except MeshError:
            continue
        # What may pass is an element that became a copy of another: dropped, with a note.
        if node != tetrahedra[element, corner] and not noted(report, "same nodes as an earlier"):
            silent.append((element, corner, node))
    assert silent == []


def test_a_face_with_three_elements_is_refused(load_solid):
    points = 0.1 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1], [0.2, 0.2, 2]])
    tetrahedra = np.array([[0, 1, 2, 3], [0, 2, 1, 4], [0, 1, 2, 5]])
    with pytest.raises(MeshError, match=r"1 faces belong to more than two.*0, 1, 2"):
        load_solid(points, tetrahedra)


def test_several_pieces_are_refused_with_their_sizes(load_solid):
    points, tetrahedra = cube()
    two = np.vstack([points, points[:4] * 0.1 + 0.2])
    with pytest.raises(MeshError, match="2 pieces without a common face, of 6, 1 tetrahedra"):
        load_solid(np.vstack([two, [0.3, 0.3, 0.3]]), np.vstack([tetrahedra, [8, 9, 10, 12]]))


def test_pieces_hinged_at_an_edge_are_pieces(load_solid):
    points, tetrahedra = box((1, 1, 1), (0.06, 0.06, 0.06))
    both = np.vstack([points, points + np.array([0.06, 0.06, 0.0])])
    with pytest.raises(MeshError, match="2 pieces without a common face"):
        load_solid(both, np.vstack([tetrahedra, tetrahedra + 8]))


def test_all_problems_are_reported_at_once(load_solid):
    points, tetrahedra = cube()
    again = np.vstack([points, points + 1.0])
    fold = np.array([[0, 4, 6, 5]]) + 8
    with pytest.raises(MeshError) as caught:
        load_solid(again, np.vstack([tetrahedra, tetrahedra + 8, fold]))
    assert "overlap" in str(caught.value)
    assert "pieces" in str(caught.value)


def test_coordinates_rounded_beyond_the_mesh_are_refused(load_solid):
    points, tetrahedra = cube()
    with pytest.raises(MeshError, match="move it to the origin before exporting"):
        load_solid((points + 3000).astype(np.float32), tetrahedra)


# ---- Surfaces ----------------------------------------------------------------------------------


def test_a_surface_stored_corner_by_corner_is_welded(load_surface):
    points, triangles = ellipsoid_surface()
    mesh, report = load_surface(*exploded(points, triangles))
    assert len(mesh.points) == len(points)
    assert noted(report, "nodes welded")


def test_inward_normals_are_turned(load_surface):
    points, triangles = cube_surface()
    _, report = load_surface(points, triangles[:, ::-1])
    assert noted(report, "normals pointed inwards")
    assert report.volume == pytest.approx(CUBE_VOLUME, rel=ROUNDING)


@pytest.mark.parametrize("inwards", [False, True])
def test_triangles_wound_against_their_neighbours_are_turned(load_surface, inwards):
    points, triangles = ellipsoid_surface()
    wrong = triangles[:, ::-1].copy() if inwards else triangles.copy()
    wrong[[3, 50]] = wrong[[3, 50], ::-1]
    _, report = load_surface(points, wrong)
    assert noted(
        report,
        "2 triangles wound against their neighbours, now turned round; first (0-based): 3, 50",
    )
    assert report.volume == pytest.approx(load_surface(points, triangles)[1].volume, rel=ROUNDING)


def test_degenerate_and_repeated_triangles_are_dropped(load_surface):
    points, triangles = cube_surface()
    extra = np.vstack([triangles, [[0, 0, 1]], triangles[:2], triangles[2:4, ::-1]])
    mesh, report = load_surface(points, extra)
    assert np.array_equal(mesh.triangles, triangles)
    assert noted(report, "1 degenerate triangles (two equal corners) dropped; first (0-based): 12")
    assert noted(report, "4 elements with the same nodes")
    assert report.element_map.tolist() == [*range(12), -1, -1, -1, -1, -1]


def test_a_triangle_without_area_that_keeps_the_surface_closed_stays(load_surface):
    points, triangles = cube_surface()
    a, b, c = triangles[0]
    middle = len(points)
    split = np.vstack([triangles[1:], [[a, middle, c], [middle, b, c], [a, b, middle]]])
    mesh, report = load_surface(np.vstack([points, (points[a] + points[b]) / 2]), split)
    assert len(mesh.triangles) == 14
    assert noted(report, "1 triangles without area kept")


def test_one_missing_triangle_is_a_hole(load_surface):
    points, triangles = cube_surface()
    with pytest.raises(MeshError, match="3 open edges in 1 holes"):
        load_surface(points, np.delete(triangles, 4, axis=0))


def test_holes_are_counted(load_surface):
    points, triangles = ellipsoid_surface()
    middle = points[triangles].mean(axis=1)
    far = int(np.argmax(np.linalg.norm(middle - middle[4], axis=1)))
    with pytest.raises(MeshError, match="6 open edges in 2 holes"):
        load_surface(points, np.delete(triangles, [4, far], axis=0))


def test_inner_walls_are_refused(load_surface):
    points, triangles = cube_surface()
    with pytest.raises(MeshError, match=r"1 open edges.*2 non-manifold edges"):
        load_surface(points, np.vstack([triangles, [[0, 1, 6]]]))


def test_separate_surfaces_are_refused_with_their_sizes(load_surface):
    points, triangles = cube_surface()
    small, octahedron = ellipsoid_surface(0)
    with pytest.raises(MeshError, match="2 separate surfaces, of 12, 8 triangles"):
        load_surface(np.vstack([points, small + 1]), np.vstack([triangles, octahedron + 8]))


def test_a_one_sided_surface_is_refused(load_surface):
    with pytest.raises(MeshError, match="one-sided surface"):
        load_surface(*klein_bottle())


def test_a_surface_folded_flat_is_refused(load_surface):
    points, triangles = ellipsoid_surface()
    # Upper and lower half come to lie side by side, so that no two nodes meet.
    folded = points * [1, 1, 0] + np.sign(points[:, 2:]) * [1e-3, 2e-3, 0]
    with pytest.raises(MeshError, match="encloses no volume"):
        load_surface(folded, triangles)


def test_handles_are_reported(load_surface):
    report = load_surface(*torus())[1]
    assert report.quality.genus == 1
    assert noted(report, "WARNING: genus 1")
    assert load_surface(*ellipsoid_surface())[1].quality.genus == 0


def test_a_surface_that_touches_itself_at_a_node_is_reported(load_surface):
    # The cube's bottom is dented until its middle reaches the middle of the top.
    points, triangles = cube_surface()
    top, bottom = 8, 9
    dent = [[0, 2, bottom], [2, 6, bottom], [6, 4, bottom], [4, 0, bottom]]
    lid = [[1, 5, top], [5, 7, top], [7, 3, top], [3, 1, top]]
    low = np.flatnonzero((points[triangles][:, :, 2] == 0).all(axis=1))
    high = np.flatnonzero((points[triangles][:, :, 2] == SIDE).all(axis=1))
    sides = np.delete(triangles, [*low, *high], axis=0)
    middle = [SIDE / 2, SIDE / 2, SIDE]
    _, report = load_surface(np.vstack([points, middle, middle]), np.vstack([sides, dent, lid]))
    assert noted(report, "touches itself at 1 nodes")
    assert report.quality.genus == 0
    assert report.volume == pytest.approx(CUBE_VOLUME * 2 / 3, rel=ROUNDING)


def test_a_star_shaped_solid_and_its_surface_agree(load_solid, load_surface):
    solid, surface = load_solid(*ellipsoid())[1], load_surface(*ellipsoid_surface())[1]
    assert solid.volume == pytest.approx(surface.volume, rel=ROUNDING)


# ---- Notes -------------------------------------------------------------------------------------


def test_what_happens_to_many_blocks_of_cells_is_one_note():
    points = np.zeros((9, 3))
    triangle, quad, curved = [[0, 1, 2]], [[0, 1, 2, 3]], [list(range(8))]
    blocks = [("triangle", triangle), ("quad", quad), ("quad8", curved)] * 90
    mesh = raw_mesh(points, [(name, np.array(rows)) for name, rows in blocks])
    assert len(mesh.triangles) == 90 * 5
    assert mesh.notes == (
        "90 cells of type quad8: mid-side nodes not used, edges straight",
        "180 faces of types quad, quad8 cut into triangles from their first corner (unless that "
        "folds them); first (0-based): 1, 2, 4, 5, 7, ...; triangles are numbered after that",
    )


def test_notes_that_differ_in_numbers_only_are_one():
    notes = ["a quad at 3", "no number", "a quad at 4.5", "a quad at -1e-3"]
    assert one_per_kind(notes) == ("a quad at 3 (and 2 more such notes)", "no number")
