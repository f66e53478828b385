"""Each table in reports/data is that of the code which writes it: columns, sums, a cheap row."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import numpy as np
import pytest

import reports
from msm.timestep import whole_steps
from study.known import table as known
from study.results.tables import read_table, write_table
from study.robustness import block, organ_request, request, rows, spacing, summary
from study.robustness.organ_unknowns import unknowns
from study.robustness.paper import TABLE_III
from study.robustness.ranges import write_ranges
from study.robustness.unknowns import UNKNOWNS, draws
from study.run.preparation import QUIET
from study.scene.file import read_scene
from study.tradeoff import rates
from study.tradeoff import table as tradeoff
from study.validation import cube, cylinders
from study.validation import table as validation
from study.validation.comparison import COVERAGE, Comparison
from tests.benchmarks import bench_reference, certified
from tests.test_benchmark_tables import COMMITTED

DATA = Path(reports.__file__).parent / "data"
RANGES = ("unknown", "range", "meaning")
STUDIES = {
    known.NAME: known.STABILITY,
    "verification.csv": known.VERIFICATION,
    "tradeoff.csv": tradeoff.COLUMNS,
    "validation.csv": validation.COLUMNS,
    bench_reference.TABLE.name: bench_reference.FIELDS,
    certified.TABLE.name: certified.Row._fields,
    request.RANGES: RANGES,
    organ_request.RANGES: RANGES,
}
SHARES = {
    request.NEAREST: rows.Nearest,
    request.DIFFERENCES: rows.Difference,
    request.TABLE_III: rows.TableThree,
    request.INDICES: rows.Index,
    request.DRAWN: rows.Drawn,
    request.SPACING: rows.AtSpacing,
    organ_request.NEAREST: rows.Nearest,
    organ_request.DIFFERENCES: rows.Difference,
    organ_request.INDICES: rows.Index,
    organ_request.FINER: rows.Finer,
}
WITH_NOTHING = {organ_request.DIFFERENCES}
"""With NaN: the paper prints no score of the elastography reading."""
BY_PSUTIL = "run_stages.csv"
SAME = 1e-6
"""Scores of one draw on two machines: motions are solved to 1e-8."""


def read(name):
    with (DATA / name).open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def number(text):
    return float(text) if text else math.nan


# Columns --------------------------------------------------------------------------------------


def test_no_table_is_without_its_writer():
    named = {path.name for path, _, _ in COMMITTED} | {*STUDIES, *SHARES, BY_PSUTIL}
    assert {path.name for path in DATA.glob("*.csv")} == named


@pytest.mark.parametrize("name", STUDIES)
def test_columns_are_those_that_are_written(name):
    assert tuple(read(name)[0]) == STUDIES[name]


def test_columns_of_the_stages_of_a_run_are_those_that_are_written():
    pytest.importorskip("psutil", reason="measures memory by it")
    from tests.benchmarks.run_stages import COLUMNS

    assert tuple(read(BY_PSUTIL)[0]) == COLUMNS


@pytest.mark.parametrize("name", sorted(SHARES.keys() - WITH_NOTHING))
def test_a_table_of_the_ranking_read_and_written_is_itself(name, tmp_path):
    again = tmp_path / name
    write_table(again, SHARES[name], read_table(DATA / name, SHARES[name]))
    assert again.read_bytes() == (DATA / name).read_bytes()


@pytest.mark.parametrize("name", sorted(WITH_NOTHING))
def test_columns_of_a_table_of_the_ranking_are_those_that_are_written(name):
    assert tuple(read(name)[0]) == SHARES[name]._fields


# The ranking ----------------------------------------------------------------------------------


def test_the_unknowns_of_the_paper_are_those_that_are_drawn(tmp_path):
    write_ranges(tmp_path / "now.csv", UNKNOWNS)
    assert (tmp_path / "now.csv").read_bytes() == (DATA / request.RANGES).read_bytes()


def test_the_unknowns_of_an_organ_are_those_that_are_drawn(tmp_path):
    """About the middle of the spacings that the table states."""
    before = (DATA / organ_request.RANGES).read_text(encoding="utf-8")
    (stated,) = (row["range"] for row in read(organ_request.RANGES) if row["unknown"] == "spacing")
    low, high = map(float, stated.removesuffix(" m").split(" to "))
    write_ranges(tmp_path / "now.csv", unknowns(0.5 * (low + high)))
    assert (tmp_path / "now.csv").read_text(encoding="utf-8") == before


def test_the_draws_nearest_to_table_iii_are_those_of_the_design_and_as_near_as_stated():
    found = read_table(DATA / request.TABLE_III, rows.TableThree)
    found = [row._replace(draw=int(row.draw)) for row in found]
    asked = request.RobustnessRequest()
    now = list(request._drawn(asked, found))
    assert now == [row._replace(draw=int(row.draw)) for row in read_drawn()]
    points = request.shares(asked.seed, asked.size).reshape(-1, len(UNKNOWNS))
    scored = block.evaluated(draws(points[[row.draw for row in found]])).scores
    printed = np.array([TABLE_III[system] for system in block.SYSTEMS])
    for k, row in enumerate(found):
        column = block.COLUMNS.index((row.curve, row.measure))
        away = np.abs(scored[k, :, column] - printed).max()
        assert away == pytest.approx(row.nearest, abs=SAME)
        assert row.draws <= len(points)


def read_drawn():
    return read_table(DATA / request.DRAWN, rows.Drawn)


def test_scores_over_the_spacing_are_those_of_a_run_there(monkeypatch):
    before = read_table(DATA / request.SPACING, rows.AtSpacing)
    chosen = float(spacing.SPACINGS[17])
    monkeypatch.setattr(spacing, "SPACINGS", np.array([chosen]))
    kept = [row for row in before if row.spacing_m == pytest.approx(chosen)]
    now = list(spacing.over_spacing(read_scene(request.SCENE)))
    assert [(r.system, r.curve, r.measure) for r in now] == [row[2:3] + row[4:6] for row in kept]
    for one, row in zip(now, kept, strict=True):
        assert one.score == pytest.approx(row.score, abs=SAME)
        moduli = one.benchmark_pa, one.estimate_pa
        assert moduli == pytest.approx((row.benchmark_pa, row.estimate_pa), rel=1e-9)


@pytest.mark.parametrize("name", [request.NEAREST, organ_request.NEAREST])
def test_shares_are_of_the_draws_and_leave_the_ties(name):
    found = read_table(DATA / name, rows.Nearest)
    for row in found:
        of = int(row.draws)
        count = round(row.share * of)
        assert row.share == pytest.approx(count / of, abs=1e-11)
        assert (row.low, row.high) == pytest.approx(summary.wilson(count, of), abs=1e-11)
    for column in dict.fromkeys(row[:2] for row in found):
        own = [row for row in found if row[:2] == column]
        assert sum(row.share for row in own) + own[0].tied == pytest.approx(1.0, abs=1e-10)


# Trade-off ------------------------------------------------------------------------------------


def test_fronts_of_the_trade_off_are_those_of_its_errors_and_costs():
    lines = [line for line in read("tradeoff.csv") if line["field_error"] and line["wall_per_s"]]
    for column, group in (
        ("pareto", lines),
        ("pareto_any_load", [line for line in lines if line["any_load"] == "True"]),
    ):
        places = [(float(one["field_error"]), float(one["wall_per_s"])) for one in group]
        marks = [str(not tradeoff.is_dominated(place, places)) for place in places]
        assert marks == [one[column] for one in group]


def test_costs_of_the_trade_off_are_of_its_steps_and_of_their_number_in_a_frame():
    lines = [line for line in read("tradeoff.csv") if line["wall_per_s"]]
    assert len(lines) > 30
    for line in lines:
        step = float(line["step_s"])
        wall = 1e-6 * float(line["step_us"]) / step
        assert float(line["wall_per_s"]) == pytest.approx(wall, rel=1.5e-3)  # of thrice four digits
        for name, rate in rates.RATES.items():
            # A step of four digits may be a part of the frame that the exact one is just not.
            steps = {whole_steps(1.0 / rate, step * off) for off in (0.9995, 1.0, 1.0005)}
            assert int(line[f"substeps_{name}"]) in steps
            slow = float(line[f"slow_frame_ms_{name}"] or line[f"frame_ms_{name}"])
            assert line[f"real_time_{name}"] == str(slow <= 1e3 / rate)


def test_a_resolved_error_exceeds_that_of_the_reference():
    bar = json.loads((DATA / "tradeoff.json").read_text())["reference"]["field_error"]
    for line in read("tradeoff.csv"):
        assert float(line["field_error_bar"]) == pytest.approx(bar, rel=1e-3)
        assert (line["status"] == "resolved") == bool(line["field_error"])
        if line["field_error"]:
            assert float(line["field_error"]) >= 0.999 * bar


# Validation -----------------------------------------------------------------------------------


def test_verdicts_on_measurements_are_those_of_the_numbers_beside_them():
    """To six digits, in which no difference equals what it is compared with."""
    found = read("validation.csv")
    assert len(found) > 400
    for line in found:
        one = Comparison(
            **{name: line[name] for name in ("problem", "case", "faces", "model")},
            **{name: line[name] for name in ("quantity", "unit", "fitted", "note")},
            **{name: number(line[name]) for name in ("measured", "uncertainty", "found")},
            numerical=number(line["numerical"]),
            modulus=number(line["modulus_pa"]),
            coverage=1.0 if line["problem"] == cube.NAME else COVERAGE,
            calibrated=line["verdict"] == "fitted",
        )
        assert line["verdict"] == (one.verdict or ""), line
    calibrated = {(line["case"], line["quantity"]) for line in found if line["verdict"] == "fitted"}
    assert calibrated == {("101 g", "tip deflection, mean of markers")}


def test_linear_elements_beside_the_cylinders_are_those_of_the_table(monkeypatch, tmp_path):
    monkeypatch.setattr(cylinders, "FACES", ("bonded",))
    validation.write(cylinders.comparisons(("linear",), 3, QUIET), tmp_path / "now.csv")
    now = list(csv.DictReader((tmp_path / "now.csv").read_text().splitlines()))
    words = ("problem", "case", "faces", "model", "quantity", "unit", "fitted", "verdict", "note")
    kept = [
        line
        for line in read("validation.csv")
        if (line["problem"], line["faces"], line["model"]) == ("cylinders", "bonded", "linear FE")
    ]
    assert len(now) == len(kept) == 39
    for one, line in zip(now, kept, strict=True):
        assert [one[name] for name in words] == [line[name] for name in words]
        for name in ("measured", "uncertainty", "found", "modulus_pa"):
            assert float(one[name]) == pytest.approx(float(line[name]), rel=1e-5), name
