"""The appendix prints models beside measurements as the table has them."""

from __future__ import annotations

import csv
import json

import pytest

from reports import benchmarks
from reports.validation import cylinder_rows, of_body, of_cylinders, summed, validation
from reports.validation_figure import validation_figure
from tests.report_samples import printed_beforehand

HEAD = (
    "problem,case,faces,model,quantity,unit,measured,uncertainty,found,numerical,modulus_pa,"
    "fitted,verdict,note\n"
)
TABLE = HEAD + (
    "cylinders,soft,bonded,linear FE,force at 10 %,N,10,0.5,9,0.01,6e3,modulus,agrees,\n"
    "cylinders,hard,bonded,linear FE,force at 10 %,N,20,0.5,22,0.04,9e3,modulus,differs,\n"
    "cylinders,soft,bonded,springs alone,force at 10 %,N,10,0.5,,,,modulus,,unstable\n"
    'cantilever,weight alone,clamped,linear FE,"tip deflection, mean of markers",mm,6.5,0.07,'
    "6.69,0.03,"
    "2.6e5,nothing,differs,\n"
    'cube,5 %,bonded,linear FE,"rms residual of the beads",mm,0,0.65,0.46,0.01,,way,agrees,plate\n'
    'cube,5 %,sliding,linear FE,"rms residual of the beads",mm,0,0.65,,,,way,,unstable\n'
)


@pytest.fixture(name="folder")
def _folder(tmp_path, monkeypatch):
    (tmp_path / "validation.csv").write_text(TABLE)
    monkeypatch.setattr(benchmarks, "FOLDER", tmp_path)
    return tmp_path


@pytest.mark.usefixtures("folder")
def test_medians_and_ranges_are_of_the_cases_with_an_answer():
    lines = benchmarks.read("validation")
    groups = of_cylinders(lines, "bonded")
    found = summed(groups["linear FE", "force at 10 %"])
    assert found.difference == pytest.approx(0.0)
    assert (found.least, found.largest) == (pytest.approx(-0.1), pytest.approx(0.1))
    assert found.uncertainty == pytest.approx(0.0375)
    assert (found.agreeing, found.answered, found.cases) == (1, 2, 2)
    assert summed(groups["springs alone", "force at 10 %"]) is None
    (group,) = validation()["cylinders"]
    assert group["rows"][0][:4] == ["linear FE", "force at 10 %", "+0.0 %", "−10.0 % to +10.0 %"]
    assert group["rows"][1][2] == "unstable"


def line(**changes):
    cells = next(csv.DictReader(TABLE.splitlines()))
    return cells | changes


def test_a_case_without_an_answer_is_counted_and_one_without_an_own_error_has_none():
    answered = [line(), line(found="11", numerical="", verdict="differs")]
    found = summed([*answered, line(found="", numerical="", verdict="")])
    assert (found.agreeing, found.answered, found.cases) == (1, 2, 3)
    assert found.own == pytest.approx(0.001)
    assert summed(answered[1:]).own is None
    lines = [*answered, line(found="", numerical="", verdict="")]
    (row,) = cylinder_rows(lines)[0]["rows"]
    assert row[4:] == ["5.0 %", "0.1 %", "1 of 2, 1 without a result"]
    (row,) = cylinder_rows(answered)[0]["rows"]
    assert row[-1] == "1 of 2"


def test_of_a_body_are_its_own_lines_and_residuals_of_one_axis_are_left_out(folder):
    along = line(problem="cube", quantity="rms residual along height", faces="sliding")
    with (folder / "validation.csv").open("a", newline="") as file:
        csv.DictWriter(file, along).writerow(along)
    lines = benchmarks.read("validation")
    assert len(of_body(lines, "cube", "rms residual of the beads")) == 2
    assert len(of_body(lines, "cube", "rms residual along height")) == 1
    assert [len(group["rows"]) for group in validation()["bodies"]] == [1, 1, 1]


@pytest.mark.usefixtures("folder")
def test_bodies_stand_with_difference_uncertainty_and_verdict():
    found = validation()
    names = [group["name"] for group in found["bodies"]]
    assert names == ["cantilever, clamped", "cube, bonded", "cube, sliding"]
    row = found["bodies"][0]["rows"][0]
    assert row[3:] == ["6.50", "6.69", "+0.19", "0.070", "0.030", "differs"]
    assert found["bodies"][1]["rows"][0][-1] == "agrees"
    assert found["bodies"][2]["rows"][0][-1] == "unstable"
    assert found["agreeing"] == "2 of 4"


@pytest.mark.usefixtures("folder")
def test_the_figure_is_drawn_of_what_there_is():
    svg = validation_figure()
    assert svg is not None
    assert "model − measured".encode() in svg or b"<svg" in svg


def test_without_a_table_there_is_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(benchmarks, "FOLDER", tmp_path)
    assert validation() is None
    assert validation_figure() is None


@pytest.mark.usefixtures("folder")
def test_the_section_is_printed():
    text = printed_beforehand()
    assert "unstable" in text
    assert "differs" in text
    assert "faces bonded" in text
    assert json.dumps(validation())
