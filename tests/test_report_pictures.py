"""The organ is drawn where the camera says it is, and a renderer that crashes does no harm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from reports import canvas, renders, report
from reports.camera import Camera, facing_tool
from reports.field_figures import field_figures, job, views
from reports.renders import FLAT, Job, Pictures, render
from study.stages.cached_arrays import using_store
from study.stages.store import Store
from tests.report_samples import POINTS, results_of, whole

PUSHES = [*np.eye(3), *-np.eye(3), np.array([1.0, 1.0, 1.0]) / np.sqrt(3.0)]


@pytest.mark.parametrize("push", PUSHES)
def test_the_camera_sees_the_side_that_the_tool_pushes(push):
    camera = facing_tool(POINTS, -0.05 * push, push)
    basis = np.stack([camera.right, camera.up, camera.toward])
    np.testing.assert_allclose(basis @ basis.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(basis) == pytest.approx(1.0)
    assert camera.toward @ push < -0.5
    assert camera.up[2] > 0.0


@pytest.mark.parametrize("push", PUSHES)
def test_all_points_are_in_the_picture(push):
    camera = facing_tool(POINTS, -0.05 * push, push)
    seen = camera.project(POINTS)
    left, right, bottom, top = camera.extent
    assert (seen > [left, bottom]).all()
    assert (seen < [right, top]).all()


def test_the_nearer_half_of_the_organ_is_deeper_towards_the_eye():
    push = np.array([0.0, 1.0, 0.0])
    camera = facing_tool(POINTS, -0.05 * push, push)
    assert camera.depth(POINTS[3]) > camera.depth(POINTS[2])  # anterior before posterior


def test_one_colour_scale_serves_all_models():
    seen = views(results_of())
    assert [panel.title for panel in seen.sheets[0].panels] == ["Finite elements"]
    sheet = seen.sheets[1]
    largest = max(float(panel.values.max()) for panel in sheet.panels)
    assert sheet.limit == pytest.approx(largest)
    assert len(sheet.panels) == 4


def test_a_model_far_beyond_the_first_does_not_flatten_the_scale():
    results = results_of()
    results.fields["basafa"] *= 1e3
    scene, sheet = views(results).sheets
    assert sheet.limit == pytest.approx(3.0 * float(scene.panels[0].values.max()))


def test_drawn_deformation_is_the_displacement_times_the_factor_said():
    seen = views(results_of())
    fields = results_of().fields
    np.testing.assert_allclose(
        seen.sheets[0].panels[0].points, POINTS + seen.factor * fields["fem"][0], rtol=1e-12
    )
    assert seen.factor in (1.0, 2.0, 5.0, 10.0)


def test_a_model_without_a_finite_field_is_left_out():
    results = results_of()
    results.fields["msm-sugeno"][:] = np.nan
    titles = [panel.title for panel in views(results).sheets[1].panels]
    assert len(titles) == 3
    assert not any("MSM Sugeno" in title for title in titles)


def test_a_scene_may_do_without_pictures():
    results = results_of()
    assert views(replace(results, scene=replace(results.scene, renders=False))) is None


def child(folder, text):
    path = folder / "child.py"
    path.write_text(text)
    return path


def small_job() -> Job:
    return job(views(results_of()))


def test_a_renderer_that_crashes_leaves_the_drawing_to_matplotlib(tmp_path, monkeypatch):
    monkeypatch.setattr(renders, "CHILD", child(tmp_path, "import os; os.abort()"))
    assert render(small_job()) == FLAT


def test_a_renderer_that_hangs_is_ended(tmp_path, monkeypatch):
    monkeypatch.setattr(renders, "CHILD", child(tmp_path, "import time; time.sleep(60)"))
    monkeypatch.setattr(renders, "TIMEOUT", 0.2)
    assert render(small_job()) == FLAT


def test_the_next_window_is_tried_after_a_crash(tmp_path, monkeypatch):
    """A child that works with the last window only, and says with which."""
    text = f"""
import os, sys
import numpy as np
window = os.environ.get({renders.WINDOW_VARIABLE!r})
if window != {renders.WINDOWS[-1]!r}:
    os.abort()
np.savez(sys.argv[2], pixels=np.zeros((1, 2, 2, 3), np.uint8), renderer=np.array(window))
"""
    monkeypatch.setattr(renders, "CHILD", child(tmp_path, text))
    monkeypatch.delenv(renders.WINDOW_VARIABLE, raising=False)
    found = render(small_job())
    assert found.renderer == f"VTK, {renders.WINDOWS[-1]}"
    assert found.pixels.shape == (1, 2, 2, 3)


def test_flat_and_rendered_pictures_make_one_figure_per_sheet():
    seen = views(results_of())
    count = sum(len(sheet.panels) for sheet in seen.sheets)
    rendered = Pictures("made up", np.zeros((count, 4, 4, 3), np.uint8))
    for pictures in (FLAT, rendered):
        assert len(field_figures(seen, pictures)) == 2


@pytest.mark.slow
def test_vtk_draws_the_surface_where_the_camera_projects_it():
    """A red triangle far off the centre covers the pixels of its projection.

    Its centroid is found to a pixel: half a pixel of rounding each way, edges are smoothed.
    """
    camera = facing_tool(POINTS, np.array([0.0, -0.05, 0.0]), np.array([0.0, 1.0, 0.0]))
    corners = np.array([[0.01, -0.01, 0.0], [0.04, -0.01, 0.0], [0.01, -0.01, 0.025]])
    colours = np.array([[[255, 0, 0]] * 3], dtype=np.uint8)
    found = render(Job(corners[np.newaxis], colours, np.array([[0, 1, 2]]), camera))
    if found.pixels is None:
        pytest.skip("VTK cannot render on this machine")
    distance = np.linalg.norm(_centroid(found.pixels[0], camera) - camera.project(corners).mean(0))
    assert distance < 2.0 * camera.half_width / renders.WIDTH


def _centroid(pixels: np.ndarray, camera: Camera) -> np.ndarray:
    """Centroid of the coloured pixels in the plane of the screen [m]."""
    rows, columns = np.nonzero(pixels[..., 1].astype(int) < 200)
    height, width = pixels.shape[:2]
    x = (columns.mean() + 0.5) / width * 2.0 - 1.0
    y = 1.0 - (rows.mean() + 0.5) / height * 2.0
    return np.array([x * camera.half_width, y * camera.half_height])


def test_what_was_drawn_before_is_drawn_again_only_of_other_results(tmp_path, monkeypatch):
    results, drawn = whole(), []

    def rendered(job, _):
        drawn.append("organ")
        height = round(200 * job.camera.half_height / job.camera.half_width)
        return Pictures("test", np.zeros((len(job.points), height, 200, 3), np.uint8))

    def plots(_):
        drawn.append("plots")
        return {"motion": [b"<svg/>"]}

    monkeypatch.setattr(report, "render", rendered)
    monkeypatch.setattr(report, "_plots", plots)
    with using_store(Store(tmp_path)):
        first = report.draw(results)
        assert sorted(drawn) == ["organ", "plots"]
        again = report.draw(replace(results, record=replace(results.record, title="another")))
        assert len(drawn) == 2, "no figure shows the title"
        assert again == first
        moved = {**results.fields, "points": 1.01 * results.fields["points"]}
        report.draw(replace(results, fields=moved))
        assert len(drawn) == 4
    with using_store(Store(tmp_path), readable=False):
        assert report.draw(results) == first
        assert len(drawn) == 6


@pytest.mark.parametrize(("length", "columns"), [(10, 5), (24, 3), (70, 1)])
def test_a_legend_has_as_many_columns_as_fit(length, columns):
    with canvas.style():
        figure = canvas.sheet(2.0)
        axes = figure.subplots()
        for n in range(7):
            axes.plot([0, 1], [n, n], label=f"{n} " + "a" * (length - 2))
        canvas.legend_above(figure, axes, 5)
        (legend,) = figure.legends
        box = legend.get_window_extent()
    assert legend._ncols == columns
    assert box.width <= figure.bbox.width
