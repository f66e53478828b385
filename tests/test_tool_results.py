"""The force of rigid tools in a results folder: its table, scores, record, checks and report."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from reports.digits import with_error
from reports.report import pdf
from reports.tool_force import force_figure, force_rows
from study.results.consistency import check
from study.results.folder import read, write
from study.run.study import run_study
from study.scene.file import read_scene


@pytest.fixture(scope="module")
def results():
    small = (
        'organ.size=["60 mm", "60 mm", "40 mm"]',
        'models=["basafa", "tissue"]',
        "lattice.spacing=20 mm",
        "reference.element_size=20 mm",
        "tool.shape=sphere",
        "tool.radius=20 mm",
        "tool.displacement=3 mm",
        "time.samples=51",
    )
    return run_study(read_scene("block", small))


def test_forces_are_written_and_read_again(results, tmp_path):
    write(results, tmp_path)
    again = read(tmp_path)
    assert again.record.tools == results.record.tools
    scores = [row.score for row in results.tool_scores]
    assert [row.score for row in again.tool_scores] == pytest.approx(scores)
    curve = again.tool_force("tissue", "tool")
    assert curve.force.max() == pytest.approx(results.record.tools[1].peak_n)
    assert curve.travel.max() == pytest.approx(3e-3)
    with pytest.raises(KeyError, match="no rigid tool"):
        again.tool_force("tissue", "tool.2")


def test_the_largest_force_has_an_error_by_steps_and_work_that_is_not_negative(results):
    for one in results.record.tools:
        assert one.peak_n > 0.0
        assert 0.0 < one.relative_error < 0.2
        assert one.work_j >= 0.0


def test_the_error_of_a_force_by_the_spacing_is_the_change_from_a_coarser_lattice(results):
    for one in results.record.tools:
        errors = results.model(one.model).spacing_errors
        assert (errors.coarser_m, errors.order) == (0.04, 1.0)
        assert one.spacing_error == errors.tool_force["tool"] > 0.1
        assert errors.peak_force["tool"] > 0.0
        assert set(errors.displacement) == set(results.record.probes)


def test_a_force_is_scored_against_the_reference_by_both_measures(results):
    rows = [(row.model, row.reference, row.curve, row.measure) for row in results.tool_scores]
    assert rows == [
        ("tissue", "basafa", "force", "relative-l2"),
        ("tissue", "basafa", "force", "iso-18571"),
    ]


@pytest.mark.parametrize("planted", ["row", "score", "record"])
def test_what_does_not_belong_is_refused(results, planted):
    check(results)
    changed = {
        "row": {"tool_forces": results.tool_forces[:-1]},
        "score": {"tool_scores": (results.tool_scores[0]._replace(score=1.1),)},
        "record": {"record": replace(results.record, tools=results.record.tools[:1])},
    }[planted]
    with pytest.raises(ValueError, match="tool"):
        check(replace(results, **changed))


def test_the_report_shows_force_and_table(results):
    assert force_figure(results).startswith(b"<?xml")
    rows = force_rows(results)
    assert len(rows) == 2
    for row, one in zip(rows, results.record.tools, strict=True):
        error = one.peak_n * (one.relative_error + one.spacing_error)
        assert row[2] == with_error(one.peak_n, error)
    assert pdf(results).startswith(b"%PDF")


def test_a_scene_without_rigid_tools_has_none_of_it(small_results, tmp_path):
    assert small_results.record.tools == ()
    assert force_figure(small_results) is None
    write(small_results, tmp_path)
    assert not (tmp_path / "tool_force.csv").exists()


def test_a_small_tool_on_a_coarse_lattice_is_told(results):
    assert any("the spacing of the lattice" in text for text in results.record.warnings)
    assert np.isfinite([m.tool_overlap_m for m in results.record.models]).all()
