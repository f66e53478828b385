"""A report is made of whatever a results folder holds, and twice the same."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import typst

from reports import motion_figures, renders, report
from reports.content import document
from study.results.folder import Results, ResultsError, write
from tests.report_samples import FUZZY, MODELS, TITLE, results_of

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(autouse=True)
def _flat(monkeypatch):
    """Pictures by matplotlib: VTK has its own tests."""
    monkeypatch.setattr(renders, "WINDOWS", ())


def pdf_of(results: Results, folder: Path) -> bytes:
    folder.mkdir()
    write(results, folder)
    report.make_report(folder)
    return (folder / "report.pdf").read_bytes()


def test_a_second_report_is_the_same_byte_by_byte(tmp_path):
    first = pdf_of(results_of(), tmp_path / "a")
    report.make_report(tmp_path / "a")
    assert first.startswith(b"%PDF")
    assert (tmp_path / "a" / "report.pdf").read_bytes() == first


def test_another_process_makes_the_same_bytes(tmp_path):
    results = replace(results_of(), arrays={})
    first = pdf_of(results, tmp_path / "a")
    code = "import sys, pathlib; from reports.report import make_report; "
    code += "make_report(pathlib.Path(sys.argv[1]))"
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "a")], check=True, cwd=ROOT)
    assert (tmp_path / "a" / "report.pdf").read_bytes() == first


def test_other_numbers_make_other_bytes(tmp_path):
    """Negative control of the two tests above."""
    other = results_of()
    other.numbers["stiffness"]["sugeno"]["estimate_pa"] *= 1.01
    bare = [replace(results, arrays={}) for results in (results_of(), other)]
    assert pdf_of(bare[0], tmp_path / "a") != pdf_of(bare[1], tmp_path / "b")


def test_a_folder_without_results_is_refused(tmp_path):
    with pytest.raises(ResultsError, match="no results here"):
        report.make_report(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_report_that_fails_leaves_the_earlier_one(tmp_path, monkeypatch):
    folder = tmp_path / "a"
    first = pdf_of(replace(results_of(), arrays={}), folder)
    names = sorted(path.name for path in folder.iterdir())
    broken = report.template() + b"\nSee @nowhere.\n"
    monkeypatch.setattr(report, "template", lambda: broken)
    with pytest.raises(typst.TypstError, match="nowhere"):
        report.make_report(folder)
    assert (folder / "report.pdf").read_bytes() == first
    assert sorted(path.name for path in folder.iterdir()) == names


def test_a_folder_that_cannot_be_written_is_said_so(tmp_path, monkeypatch):
    def refuse(*_args, **_kwargs):
        raise PermissionError(13, "Permission denied")

    (tmp_path / "a").mkdir()
    write(replace(results_of(), arrays={}), tmp_path / "a")
    monkeypatch.setattr(report.tempfile, "mkstemp", refuse)
    with pytest.raises(ResultsError, match=r"report.pdf: cannot be written \(Permission denied\)"):
        report.make_report(tmp_path / "a")


@pytest.mark.parametrize("models", [["fem"], ["basafa"], ["fem", "basafa"], FUZZY, FUZZY[:1]])
def test_models_may_be_missing(models, tmp_path):
    assert pdf_of(replace(results_of(models), arrays={}), tmp_path / "a")


@pytest.mark.parametrize("models", [["fem"], ["basafa", "msm-sugeno"]])
def test_fields_of_some_models_are_drawn(models, tmp_path):
    results = results_of(models)
    del results.arrays["fuzzy"]
    assert pdf_of(results, tmp_path / "a")


def test_what_only_some_scenes_have_may_be_missing(tmp_path):
    results = replace(results_of(), arrays={})
    for key in ("lattice_limits", "dimensionless"):
        del results.numbers[key]
    for record in results.numbers["models"]:
        for key in ("mesh_error", "time_step_error", "time_step_error_velocity"):
            record.pop(key, None)
        record |= {"time_step_s": None, "critical_time_step_s": None, "steps": None}
    results.numbers.update(checks=[], notes=[], assumptions=[])
    assert pdf_of(results, tmp_path / "a")


@pytest.mark.parametrize(("count", "left_out"), [(1, 0), (4, 2)])
def test_control_points_may_be_few_or_many(count, left_out, tmp_path, monkeypatch):
    monkeypatch.setattr(motion_figures, "PROBES_PER_FIGURE", 1)
    monkeypatch.setattr(motion_figures, "MOST_PROBES", 2)
    results = replace(results_of(probes=[f"point-{i}" for i in range(count)]), arrays={})
    assert pdf_of(results, tmp_path / "a")
    assert document(results)["probes_left_out"] == left_out


def test_names_and_titles_are_inert_whatever_they_hold(tmp_path):
    """Typst's and matplotlib's markup, scripts without a glyph, a word longer than the page."""
    nasty = '#import "x" $ * _ @nowhere <b> & \\frac{ $x_{ 肝臓 \x07 --> ' + 400 * "w"
    results = results_of(probes=[nasty], title=nasty)
    results.numbers["warnings"].append(nasty)
    del results.arrays["fuzzy"]
    assert pdf_of(results, tmp_path / "a")


def diverged(late: bool) -> Results:
    """One fuzzy model diverged, before the peak or after it."""
    results = results_of()
    name = "msm-mamdani"
    record = next(r for r in results.numbers["models"] if r["name"] == name)
    record |= {"status": "diverged", "diverged_at_s": 0.31, "diverged_near_m": [0.0, 0.0, 0.01]}
    record |= {"time_step_error": None}
    results.numbers["warnings"].append(f"{name} diverged at 0.31 s")
    results.tables["curves"] = [
        (*row[:3], 1e9 * float(row[3]), row[4]) if row[0] == name else row
        for row in results.tables["curves"]
        if row[0] != name or float(row[2]) < 0.31
    ]
    for table in ("similarity", "errors"):
        results.tables[table] = [row for row in results.tables[table] if row[0] != name]
    results.arrays["fields"][name][1 if late else 0 :] = np.nan
    del results.arrays["fuzzy"]
    return results


@pytest.mark.parametrize("late", [False, True])
def test_a_model_that_diverged_is_shown_so_and_has_no_score(late, tmp_path):
    results = diverged(late)
    assert pdf_of(results, tmp_path / "a")
    content = document(results)
    rows = {row[0]: row for row in content["models"]}
    assert rows["MSM Mamdani"][-1] == "diverged at 0.310 s"
    assert rows["MSM Sugeno"][-1] == "finished"
    assert any("diverged" in text for text in content["warnings"])
    scored = {row[0] for t in content["similarity"] for g in t["groups"] for row in g["rows"]}
    assert "MSM Sugeno" in scored
    assert "MSM Mamdani" not in scored


def test_no_curve_at_all_still_makes_a_report(tmp_path):
    results = results_of()
    del results.arrays["fields"]
    results.tables.update({name: [] for name in results.tables})
    assert pdf_of(results, tmp_path / "a")


def test_a_number_that_is_not_finite_is_refused(tmp_path):
    results = replace(results_of(), arrays={})
    row = results.tables["similarity"][0]
    results.tables["similarity"][0] = (*row[:-1], float("nan"))
    (tmp_path / "a").mkdir()
    write(results, tmp_path / "a")
    with pytest.raises(ValueError, match="nan is not a number that a report can print"):
        report.make_report(tmp_path / "a")
    with pytest.raises(ValueError, match="not JSON compliant"):
        report.compile_pdf(document(results_of()) | {"drawing": float("inf")}, {})


def test_the_document_holds_the_numbers_of_the_run():
    content = document(results_of())
    assert content["title"] == TITLE
    assert [row[0] for row in content["glance"]["rows"]] == [
        "Finite elements",
        "Basafa benchmark",
        "MSM Mamdani",
        "MSM Sugeno",
        "MSM type-2",
    ]
    assert len(content["models"]) == len(MODELS)
    said = " ".join(content["summary"])
    assert "12.00 to 14.00 kPa, 1.20 to 1.40 times the reference modulus of 10 kPa" in said
    assert "does not contain the reference modulus" in said
    assert "Its largest strain is 4.0 %, below the 5.0 %" in said


def test_a_larger_strain_is_said_to_be_too_large():
    results = results_of()
    results.numbers["models"][0]["largest_strain"] = 0.06
    assert "6.0 %, not below the 5.0 %" in " ".join(document(results)["summary"])
