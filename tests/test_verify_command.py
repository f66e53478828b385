"""`liver-study verify`, as a person uses it."""

import csv
import dataclasses
import json
from pathlib import Path

import pytest

from study.commands import EXIT_FAILED_CHECK, app
from study.known import request, table
from study.known.case import Case
from study.known.finding import error_of, number_of
from study.known.suite import PROBLEMS
from study.system.progress import Silent

ROOT = Path(__file__).resolve().parent.parent


def problem(name, *, quick=True):
    """Posed by the function of that name below."""
    function = f"tests.test_verify_command:{name}"
    return Case(family="f", name=name, function=function, source="a book", quick=quick)


def good():
    yield number_of("depth [m]", 2.0, 2.0002, 1e-3, order=2.98)


def shown():
    yield error_of("depth, p1", 0.5)


def bad():
    yield error_of("depth [m], rounded", 1e-9, 1e-3)
    yield number_of("depth [m]", 2.0, 2.004, 1e-3)


def unsolved():
    yield error_of("depth [m]", 1e-9, 1e-3)
    raise ValueError("the stiffness is singular")


def endless():
    while True:
        pass


GOOD, SHOWN, BAD = problem("good"), problem("shown", quick=False), problem("bad")
UNSOLVED = problem("unsolved")
ENDLESS = dataclasses.replace(problem("endless"), seconds=0.1)


@pytest.fixture
def problems(monkeypatch):
    def use(*chosen):
        monkeypatch.setattr(request, "PROBLEMS", chosen)

    return use


def verify(capsys, *arguments):
    """Exit code and what was printed."""
    with pytest.raises(SystemExit) as left:
        app(["verify", *arguments])
    return left.value.code or 0, capsys.readouterr().out


def test_a_table_shows_exact_value_ours_error_order_and_limit(problems, capsys):
    problems(GOOD, SHOWN)
    code, out = verify(capsys)
    assert code == 0
    assert "good (a book;" in out
    line = next(line for line in out.splitlines() if "depth [m]" in line)
    assert line.split() == ["depth", "[m]", "2", "2.0002", "0.0001", "2.98", "0.001", "pass"]
    assert next(line for line in out.splitlines() if "depth, p1" in line).endswith("noted")
    assert "all 2 findings" in out


@pytest.mark.parametrize("problem", [BAD, UNSOLVED, ENDLESS])
def test_one_failure_ends_with_exit_code_1_and_its_name(problem, problems, capsys):
    problems(GOOD, problem)
    code, out = verify(capsys)
    assert code == EXIT_FAILED_CHECK
    assert f"failed: {problem.name}" in out
    assert "FAIL" in out


def test_json_is_strict_and_says_what_failed(problems, capsys):
    problems(GOOD, BAD, UNSOLVED)
    code, out = verify(capsys, "--json")
    assert code == EXIT_FAILED_CHECK
    found = json.loads(out, parse_constant=pytest.fail)
    assert found["passed"] is False
    assert [one["passed"] for one in found["problems"]] == [True, False, False]
    assert found["problems"][0]["findings"][0]["order"] == 2.98
    assert found["problems"][2]["findings"][0]["error"] is None
    assert found["problems"][2]["findings"][0]["limit"] == 0.0
    assert "singular" in found["problems"][2]["findings"][0]["quantity"]


def test_the_quick_run_leaves_out_the_slow_problems(problems, capsys):
    problems(GOOD, SHOWN)
    _, out = verify(capsys, "--quick")
    assert "good" in out
    assert "shown" not in out


def test_the_csv_file_holds_a_row_per_finding(problems, capsys, tmp_path):
    problems(GOOD, SHOWN, BAD)
    code, _ = verify(capsys, "--out", str(tmp_path / "found.csv"))
    assert code == EXIT_FAILED_CHECK  # and written nevertheless
    with (tmp_path / "found.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == table.VERIFICATION
    assert [row["passed"] for row in rows] == ["True", "", "True", "False"]
    assert rows[0]["problem"] == "good"
    assert float(rows[0]["ours"]) == 2.0002
    assert rows[1]["limit"] == rows[1]["exact"] == ""


def test_a_folder_that_is_not_there_is_named_before_anything_is_solved(problems, tmp_path):
    problems(UNSOLVED)
    with pytest.raises(ValueError, match=r"--out .*make it first"):
        app(["verify", "--out", str(tmp_path / "no" / "found.csv")])


@pytest.fixture(scope="module")
def committed():
    with (ROOT / "reports/data/verification.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_the_committed_table_is_of_all_problems_and_passed(committed):
    assert tuple(committed[0]) == table.VERIFICATION
    assert list(dict.fromkeys(row["problem"] for row in committed)) == [p.name for p in PROBLEMS]
    assert {row["passed"] for row in committed} == {"True", ""}
    assert all((row["passed"] == "") == (row["limit"] == "") for row in committed)


def test_the_committed_table_is_what_the_command_finds(committed, problems, tmp_path):
    """Errors by discretisation and step are the same on any machine, those by rounding are not."""
    problems(*(p for p in PROBLEMS if p.name in {"damped motion, steps", "torsion in an eighth"}))
    table.write_verification(request.verify(Silent()), tmp_path / "now.csv")
    with (tmp_path / "now.csv").open(newline="") as file:
        now = list(csv.DictReader(file))
    before = {(row["problem"], row["quantity"]): row for row in committed}
    assert len(now) == 18
    for row in now:
        found = before[row["problem"], row["quantity"]]
        assert float(row["error"]) == pytest.approx(float(found["error"]), rel=0.02)
        assert row["limit"] == found["limit"]


def test_quantities_are_distinct_and_columns_stay_in_line(committed):
    quantities = [(row["problem"], row["quantity"]) for row in committed]
    assert len(set(quantities)) == len(quantities)
    assert max(len(quantity) for _, quantity in quantities) <= table.WIDTHS[0] - 2
