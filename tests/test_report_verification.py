"""The appendix prints the verification and the cost of the reference as they were measured."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import pytest

from reports import benchmarks
from reports.digits import significant
from reports.verification import in_symbols, verification
from tests.report_samples import beforehand_pdf, printed_beforehand

DATA = Path(benchmarks.__file__).parent / "data"
VERIFICATION = """\
problem,quantity,exact,ours,error,order,limit,passed
Sphere,"frequency, p2",2.50113,2.50121,3.2e-05,,0.001,True
Sphere,"displacement, p1",,,0.42,,,True
Bar,deflection,0.001234567,0.001234,0.00046,3.02,0.001,True
"""
COST = """\
task,program,version,unknowns,least_s,median_s,repeats,compile_s,peak_mib,machine
assembly,"scikit-fem, as the reference",12.0.1,50000,2,2.5,9,,,"Some processor, 2 cores"
assembly,dolfinx,0.5.2,50000,3,3.5,9,8.25,,"Some processor, 2 cores"
job,this study,0.1.0,50000,10,11,3,,,"Some processor, 2 cores"
job,calculix,2.20,50000,45,46,3,,,"Some processor, 2 cores"
growth: mesh,this study,0.1.0,6000,0.51,0.6,3,,321.5,"Some processor, 2 cores"
growth: assembly,this study,0.1.0,6000,0.62,0.7,3,,321.5,"Some processor, 2 cores"
growth: solution,this study,0.1.0,6000,0.73,0.8,3,,321.5,"Some processor, 2 cores"
"""


@pytest.fixture(name="folder")
def _folder(tmp_path, monkeypatch):
    """Tables made up by hand."""
    (tmp_path / "verification.csv").write_text(VERIFICATION)
    (tmp_path / "fem_cost.csv").write_text(COST)
    monkeypatch.setattr(benchmarks, "FOLDER", tmp_path)
    return tmp_path


@pytest.mark.usefixtures("folder")
def test_findings_stand_under_their_problem():
    assert verification()["problems"] == [
        {
            "name": "Sphere",
            "rows": [
                ["frequency, p2", "2.5011", "2.5012", "3.2·10⁻⁵", "–", "0.0010", "passed"],
                ["displacement, p1", "–", "–", "0.42", "–", "–", "noted"],
            ],
        },
        {
            "name": "Bar",
            "rows": [
                ["deflection", "0.0012346", "0.0012340", "4.6·10⁻⁴", "3.02", "0.0010", "passed"]
            ],
        },
    ]


@pytest.mark.usefixtures("folder")
def test_outcomes_are_counted():
    assert verification()["outcomes"] == "2 passed, 1 noted"


@pytest.mark.usefixtures("folder")
def test_each_task_is_compared_with_ours():
    rows = verification()["contest"]
    assert [(row[0], row[1], row[-1]) for row in rows] == [
        ("assembly", "scikit-fem, as the reference", "1.0"),
        ("assembly", "dolfinx", "1.5"),
        ("job", "this study", "1.0"),
        ("job", "calculix", "4.5"),
    ]
    assert rows[1][4:7] == ["3.0", "3.5", "8.2"]


@pytest.mark.usefixtures("folder")
def test_growth_has_one_row_per_mesh():
    rows = verification()["growth"]
    assert rows == [["6\u202f000", "0.51", "0.62", "0.73", "320"]]


@pytest.mark.usefixtures("folder")
def test_the_document_prints_them_and_says_that_they_are_of_no_run():
    texts = printed_beforehand()
    assert texts.count("They are not results of your scene.") == 1
    assert {"Sphere", "frequency, p2", "2.5012", "noted", "calculix", "4.5", "320"} <= set(texts)
    assert "Some processor, 2 cores" in " ".join(texts)


def test_a_problem_that_was_not_solved_has_no_error_to_print(folder):
    (folder / "verification.csv").write_text(VERIFICATION.replace("0.42,,,True", "inf,,0,False"))
    row = verification()["problems"][0]["rows"][1]
    assert row == ["displacement, p1", "–", "–", "–", "–", "0", "FAILED"]


def test_a_finding_that_failed_is_printed_so(folder):
    assert "FAILED" not in printed_beforehand()
    failed = VERIFICATION.replace("0.001,True\nSphere", "1e-6,False\nSphere")
    (folder / "verification.csv").write_text(failed)
    assert "FAILED" in printed_beforehand()


@pytest.mark.parametrize(
    ("missing", "left"),
    [("fem_cost", {"problems", "outcomes"}), ("verification", {"contest", "growth", "machine"})],
)
def test_a_table_that_is_missing_is_left_out(missing, left, folder):
    (folder / f"{missing}.csv").unlink()
    assert set(verification()) == left
    assert beforehand_pdf().startswith(b"%PDF")


def test_without_tables_there_is_no_section(folder):
    for path in folder.iterdir():
        path.unlink()
    assert verification() is None
    assert beforehand_pdf().startswith(b"%PDF")


@pytest.mark.parametrize(
    ("name", "columns"),
    [
        ("verification", {"exact": 5, "ours": 5, "error": 2, "limit": 2}),
        ("fem_cost", {"least_s": 2}),
    ],
)
def test_every_number_of_the_tables_that_come_with_the_program_is_printed(name, columns):
    path = DATA / f"{name}.csv"
    if not path.is_file():
        pytest.skip(f"{name}.csv does not come with the program")
    lines = list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))
    assert lines
    wanted = {
        significant(float(line[column]), digits)
        for line in lines
        for column, digits in columns.items()
        if line[column] and math.isfinite(float(line[column]))
    }
    assert wanted <= set(printed_beforehand())


def test_symbols_of_a_quantity_are_printed_as_such():
    assert in_symbols("displacement, taylor-hood, nu 0.3") == "displacement, Taylor-Hood, ν 0.3"
    assert in_symbols("moment of inertia [kg m^2]") == "moment of inertia [kg m²]"
    assert in_symbols("number of omega R / c_s") == "number of ω R / cₛ"
