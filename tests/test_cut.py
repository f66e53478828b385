"""A cut through a body: its area, points on edges, and what a run keeps to be drawn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from reports.cut_figure import cut_figure, section
from study.mesh.cut import cut
from study.organ.block import block_of_cells
from study.run.visual_output import (
    visual_arrays,
    visual_output,
    with_end_fields_only,
    with_visual_output,
)
from study.scene.file import read_scene
from study.scene.problem import problem_of
from tests.report_samples import results_of

SIZE = (0.1, 0.08, 0.06)
SMALL = ("reference.element_size=30 mm",)


@pytest.fixture(scope="module")
def mesh():
    return block_of_cells(SIZE, np.array([5, 4, 3]))


@pytest.fixture(scope="module")
def problem():
    return problem_of(read_scene("block", SMALL))


def area(points, triangles):
    corners = points[triangles]
    sides = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return 0.5 * np.linalg.norm(np.cross(*sides), axis=1).sum()


def polygon_area(place, normal):
    """Area of the section of the block by a plane, from where its twelve edges meet it."""
    ends = np.array(SIZE) * [[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    found = []
    for a in range(8):
        for b in range(a):
            if (ends[a] != ends[b]).sum() == 1:
                first, second = (ends[[a, b]] - place) @ normal
                if first * second < 0.0:
                    found.append(ends[a] + first / (first - second) * (ends[b] - ends[a]))
    across = np.linalg.svd(normal[np.newaxis])[2][1:]
    return ConvexHull(np.array(found) @ across.T).volume


@pytest.mark.parametrize("seed", range(6))
def test_the_area_of_a_section_is_that_of_the_polygon(mesh, seed):
    random = np.random.default_rng(seed)
    place, normal = random.uniform(0.3, 0.7, 3) * SIZE, random.normal(size=3)
    normal /= np.linalg.norm(normal)
    points, triangles = cut(mesh, place, normal)
    assert area(points, triangles) == pytest.approx(polygon_area(place, normal), rel=1e-9)
    assert np.abs((points - place) @ normal).max() < 1e-9


def test_a_plane_through_vertices_gives_each_point_once(mesh):
    points, triangles = cut(mesh, np.array([0.04, 0.0, 0.0]), np.array([1.0, 0.0, 0.0]))
    assert area(points, triangles) == pytest.approx(0.08 * 0.06, rel=1e-9)
    assert len(np.unique(points.round(9), axis=0)) == len(points) == 5 * 4


def test_a_plane_beside_the_body_gives_nothing(mesh):
    points, triangles = cut(mesh, np.array([0.2, 0.0, 0.0]), np.array([1.0, 0.0, 0.0]))
    assert len(points) == len(triangles) == 0


def test_what_holds_and_loads_a_block_is_its_lower_face_and_the_disc_of_the_tool(problem):
    seen, surface = visual_output(problem), problem.geometry.surface
    corners = surface.points[surface.triangles]
    areas = 0.5 * np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    assert areas @ seen.held == pytest.approx(0.1 * 0.08, rel=1e-9)
    # Of points on a grid those within the radius: off by less than a twentieth.
    assert areas @ seen.loaded == pytest.approx(np.pi * 0.025**2, rel=0.05)


def test_the_peak_comes_first_the_end_last_and_the_film_in_order(problem):
    seen = visual_output(problem)
    assert (seen.samples[0], seen.samples[-1]) == problem.observation.frames
    assert len(set(seen.samples)) == len(seen.samples) == 9
    assert {0, 40, 70} < set(seen.samples)  # at rest, where the load stops rising, and falls
    asked = with_visual_output(problem, seen).observation
    assert asked.frames == seen.samples
    count = len(asked.surface_points)
    field = np.arange(len(seen.samples))[:, None, None] * np.ones((1, count, 3))
    found = visual_arrays(seen, "toy", field)
    assert found["toy"][:, 0, 0].tolist() == [0.0, 8.0]
    assert found["cut.toy"].shape == (2, len(seen.points), 3)
    in_order = np.array(seen.samples)[found["film.toy"][:, 0, 0].astype(int)]
    assert (np.diff(in_order) > 0).all()


def test_a_run_that_is_thinned_keeps_the_peak_and_the_end(problem):
    from study.models.model import ModelRun
    from study.problem.trajectory import empty_trajectory

    asked = with_visual_output(problem, visual_output(problem)).observation
    one = empty_trajectory(asked)
    one.volume_field[:] = np.arange(len(asked.frames))[:, None, None]
    run = ModelRun(one, results_of().model("basafa"), bounds=(one, one), halved=one)
    found = with_end_fields_only(run)
    for trajectory in (found.trajectory, *found.bounds, found.halved):
        assert trajectory.volume_field[:, 0, 0].tolist() == [0.0, 8.0]
        assert len(trajectory.surface_field) == len(asked.frames)


def test_the_figure_shows_every_model_beside_the_reference():
    results = results_of()
    found = section(results)
    assert next(iter(found.lengths)) == "Finite elements"
    assert len(found.lengths) == 5
    assert found.tool.tolist() == [0.0, 0.0]
    assert b"<svg" in cut_figure(results)
    plane = (results.fields["cut"] - results.fields["tool"][0]) @ results.fields["tool"][1]
    np.testing.assert_allclose(found.places[:, 1], -1e3 * plane, atol=1e-12)


def test_without_a_cut_there_is_no_figure():
    results = results_of()
    assert cut_figure(replace(results, fields={})) is None
    missed = results.fields | {"cut_triangles": np.zeros((0, 3), dtype=int)}
    assert cut_figure(replace(results, fields=missed)) is None
