"""A model that finds in its run that it cannot is a result, and all else of the run stands."""

from __future__ import annotations

from dataclasses import replace

import pytest

from reports import renders, report
from reports.content import document
from reports.page.answer import answer
from reports.page.write import page_of
from study.models.lattice import PreparedLattice
from study.problem.unfinished import UnfinishedError
from study.results.comparison import differences
from study.results.consistency import check
from study.results.folder import read, write
from study.run.stages import RunOptions
from study.run.study import run_study
from study.scene.file import read_scene
from study.stages.store import Store

SCENE = (
    'models=["basafa", "msm", "reading"]',
    'fuzzy.systems=["interval-type-2"]',
    "lattice.spacing=10 mm",
    'organ.size=["60 mm", "60 mm", "40 mm"]',
    "tool.shape=sphere",
    "tool.radius=20 mm",
    "tool.displacement=2 mm",
    "time.samples=21",
    "time.duration=0.2 s",
    "tool.history.ramp=0.1 s",
    "tool.history.hold=0.02 s",
    "tool.history.release=0.05 s",
)
BRIEF = 'models=["reading"]'
LOST, WHY, REMEDY = "msm-interval-type-2", "no rest is found", "give it less to bear"


def planted(monkeypatch, name, error):
    genuine = PreparedLattice.run

    def run(self, watch):
        if self.model.name == name:
            raise error
        return genuine(self, watch)

    monkeypatch.setattr(PreparedLattice, "run", run)


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """Results with a model that failed, those of a whole run with what was kept, and the store."""
    scene, store = read_scene("block", SCENE), Store(tmp_path_factory.mktemp("store"))
    store.prepare()
    with pytest.MonkeyPatch.context() as patch:
        planted(patch, LOST, UnfinishedError(WHY, REMEDY))
        lost = run_study(scene, options=RunOptions(store))
    return lost, run_study(scene, options=RunOptions(store))


def test_the_others_go_on_and_it_has_a_reason_and_no_score(found):
    record = found[0].model(LOST)
    assert (record.status, record.reason, record.remedy) == ("not finished", WHY, REMEDY)
    assert record.ended_at_s == 0.0
    assert [one.status for one in found[0].record.models].count("finished") == 2
    assert {row.model for row in found[0].curves} == {"basafa", "reading"}
    assert {row.model for row in found[0].tool_forces} == {"basafa", "reading"}
    assert {row.model for row in found[0].scores} == {"reading"}
    assert any(WHY in text and REMEDY in text for text in found[0].record.warnings)


def test_folder_reports_and_comparison_say_so(found, tmp_path, monkeypatch):
    monkeypatch.setattr(renders, "WINDOWS", ())
    lost, whole = found
    write(lost, tmp_path)
    again = read(tmp_path)
    assert again.model(LOST) == lost.model(LOST)
    assert report.pdf(again)
    content = document(again)
    rows = {row[0]: row for row in content["models"]}
    assert [row[-1] for row in rows.values()].count("not finished") == 1
    assert any(WHY in text for text in content["warnings"])
    assert any(WHY in text and REMEDY in text for text in answer(again).sentences)
    page = page_of(again)
    assert page.count(WHY.encode()) >= 1
    apart = {one.quantity: one.where for one in differences(again, whole)}
    assert apart[f"results.json models.{LOST}.status"] == "not finished and finished"


def test_what_was_not_had_is_sought_anew_and_the_rest_is_kept(found):
    stages = {one.name: one.kept for one in found[1].record.stages}
    assert not stages[LOST]
    assert stages["basafa"]
    assert stages["reading"]
    assert all(one.status == "finished" for one in found[1].record.models)


def test_a_reference_that_is_not_finished_leaves_no_score_against_it(monkeypatch):
    planted(monkeypatch, "basafa", MemoryError("Unable to allocate 3.00 TiB"))
    results = run_study(read_scene("block", (*SCENE, 'models=["basafa", "reading"]')))
    assert "memory" in results.model("basafa").reason
    assert "--workers" in results.model("basafa").remedy
    assert results.scores == results.tool_scores == ()
    assert results.model("reading").status == "finished"


def test_a_model_that_takes_too_long_is_stopped_and_says_how_far_it_was():
    results = run_study(read_scene("block", (*SCENE, BRIEF)), options=RunOptions(minutes=1e-9))
    for model in results.record.models:
        assert model.status == "not finished"
        assert f"done of the stage '{model.name}" in model.reason
        assert "--minutes" in model.remedy
    assert answer(results).sentences


def test_time_enough_changes_nothing(found):
    timed = run_study(read_scene("block", (*SCENE, BRIEF)), options=RunOptions(minutes=60.0))
    curve = [row for row in found[1].curves if row.model == "reading"]
    assert list(timed.curves) == curve


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"reason": ""}, "reason and remedy"),
        ({"ended_at_s": None}, "ended_at_s"),
        ({"status": "finished"}, "ended_at_s"),
        ({"status": "given up"}, "none of finished, diverged, not finished"),
    ],
)
def test_a_record_that_contradicts_itself_is_refused(found, change, said):
    lost = found[0]
    models = tuple(
        replace(one, **change) if one.name == LOST else one for one in lost.record.models
    )
    with pytest.raises(ValueError, match=said):
        check(replace(lost, record=replace(lost.record, models=models)))
