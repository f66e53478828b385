"""The reference document prints what the benchmarks measured, of no run, and no more."""

from __future__ import annotations

import csv
import shutil
from pathlib import Path

import pytest

from reports import benchmarks
from reports.digits import percent, significant
from tests.report_samples import beforehand_pdf, printed_beforehand

DATA = Path(benchmarks.__file__).parent / "data"
NAMES = ["field_error", "real_time", "large_strain", "peers"]


@pytest.fixture(name="folder")
def _folder(tmp_path, monkeypatch):
    """A copy of the tables that a test may spoil."""
    copy = tmp_path / "data"
    shutil.copytree(DATA, copy)
    monkeypatch.setattr(benchmarks, "FOLDER", copy)
    return copy


def found():
    return benchmarks.benchmarks()


def plant(path, column, value, row=0):
    """Another number in one row of a table."""
    with path.open(newline="") as file:
        lines = list(csv.DictReader(file))
    lines[row][column] = value
    with path.open("w", newline="") as file:
        table = csv.DictWriter(file, lines[0].keys(), lineterminator="\n")
        table.writeheader()
        table.writerows(lines)


def numbers(name, column):
    lines = list(csv.DictReader((DATA / f"{name}.csv").read_text().splitlines()))
    assert lines
    return [float(line[column]) for line in lines]


def test_the_document_prints_the_figures_of_the_tables():
    texts = set(printed_beforehand())
    assert "They are not results of your scene." in texts
    assert list(found()) == NAMES
    for name, column in (
        ("field_error", "error"),
        ("field_error", "reference_error"),
        ("real_time", "error"),
        ("large_strain", "largest_strain"),
        ("large_strain", "departure"),
        ("peers", "field_error"),
    ):
        assert {percent(value) for value in numbers(name, column)} <= texts
    for name, column in (
        ("real_time", "real_time_factor"),
        ("real_time", "real_time_factor_median"),
        ("peers", "relative_to_ours"),
    ):
        assert {significant(value, 2) for value in numbers(name, column)} <= texts
    for line in benchmarks.read("peers"):
        assert {line["engine"], line["version"], line["precision"]} <= texts


@pytest.mark.parametrize(
    ("name", "column", "value", "shown"),
    [
        ("field_error", "error", "0.98765", "98.8 %"),
        ("field_error", "order", "7.77", "7.8"),
        ("real_time", "real_time_factor", "1234.5", "1200"),
        ("large_strain", "departure", "0.87654", "87.7 %"),
        ("peers", "relative_to_ours", "314.0", "310"),
        ("peers", "version", "0.1.0-planted", "0.1.0-planted"),
    ],
)
def test_another_number_in_a_table_is_printed(name, column, value, shown, folder):
    assert shown not in printed_beforehand()
    plant(folder / f"{name}.csv", column, value)
    assert shown in printed_beforehand()


def test_one_row_stands_for_two_lattices_only_where_they_are_the_same(folder):
    def springs_alone():
        return [row[2] for row in found()["field_error"]["rows"] if row[:2] == ["block", "0.25"]]

    assert springs_alone() == ["springs"]
    plant(folder / "field_error.csv", "error", "0.5", row=4)
    assert springs_alone() == ["springs", "springs and volume term"]


def test_an_error_within_that_of_its_reference_is_not_resolved(folder):
    plant(folder / "field_error.csv", "error", "0.004")
    rows = found()["field_error"]["rows"]
    assert rows[0][3] == "not resolved (< 0.4 %)"
    assert sum("not resolved" in cell for row in rows for cell in row) == 1


@pytest.mark.parametrize("missing", NAMES)
def test_a_table_that_is_missing_is_left_out(missing, folder):
    (folder / f"{missing}.csv").unlink()
    assert list(found()) == [name for name in NAMES if name != missing]
    assert beforehand_pdf().startswith(b"%PDF")


def test_without_tables_there_is_no_section(folder):
    for name in NAMES:
        (folder / f"{name}.csv").unlink()
    assert found() is None
    assert beforehand_pdf().startswith(b"%PDF")
