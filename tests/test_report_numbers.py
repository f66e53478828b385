"""Numbers are printed as they are, and a lead is called resolved only where the numerics allow."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from reports.digits import fixed, percent, quantity, short, significant, spread, words
from reports.motion_figures import peak
from reports.paper import TABLE_III, TABLE_III_SPREAD
from reports.ranking import tool_probe, verdicts
from reports.summary import glance, sentences
from reports.tables import balanced, formula_rows, paper_rows, similarity_tables, verdict_rows
from study.similarity.score import FORMULAS
from tests.report_samples import FUZZY, SOFTNESS, results_of, score_of


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (14468.0957, "14500"),
        (9.9996, "10.0"),
        (0.0268, "0.0268"),
        (-0.5, "−0.500"),
        (1e-9, "1.00·10⁻⁹"),
        (2.5e7, "2.50·10⁷"),
        (999999.0, "1.00·10⁶"),
    ],
)
def test_significant_digits(value, text):
    assert significant(value) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.2414, "24.1 %"), (0.0, "0 %"), (0.001, "0.1 %"), (1.1e-4, "0.011 %"), (2.316, "231.6 %")],
)
def test_percentages(value, text):
    assert percent(value) == text


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("9500.0 Pa", "9.5 kPa"),
        ("950.0 Pa", "950 Pa"),
        ("2000000.0 Pa/m", "2 MPa/m"),
        ("0.0055 m", "5.5 mm"),
        ("0.0015 m^3", "1.5 L"),
        ("1000.0 N*s/m^2", "1000 N·s/m²"),
        ("0.05 N", "0.05 N"),
        ("1054.0 kg/m^3", "1054 kg/m³"),
        ("ramp-hold-release", "ramp-hold-release"),
        ("organ 5.stl", "organ 5.stl"),
    ],
)
def test_quantities_of_a_scene(text, shown):
    assert quantity(text) == shown


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("show", [significant, percent, lambda v: fixed(v, 2)])
def test_a_number_that_is_not_finite_is_refused(show, value):
    with pytest.raises(ValueError, match="not a number that a report can print"):
        show(value)


def test_a_tiny_negative_number_does_not_print_a_sign():
    assert fixed(-0.001, 2) == "0.00"


def test_long_words_may_break_and_nothing_else_changes():
    text = 100 * "x"
    assert "\u200b" in words(text)
    assert words(text).replace("\u200b", "") == text
    assert words("a short title\x07") == "a short title "
    assert short(100 * "x", 10) == 9 * "x" + "…"
    assert spread(["1", "1"]) == "1"


def test_a_lead_above_the_numerical_error_is_resolved():
    """Displacement: 0.02 of the mesh and three times 0.001 of the time step; the lead is 0.1."""
    first = next(verdicts(results_of(), "fem", "tool"))
    assert first.column == ("displacement", "relative-l2")
    assert (first.best, first.runner_up) == ("msm-sugeno", "msm-mamdani")
    assert first.lead == pytest.approx(
        score_of("msm-sugeno", "fem") - score_of("msm-mamdani", "fem")
    )
    assert first.error == pytest.approx(0.023)
    assert first.is_resolved is True


def test_a_lead_below_the_numerical_error_is_not_resolved():
    """The same scores with a reference that is wrong by 20 %."""
    results = results_of()
    results.numbers["models"][0]["mesh_error"]["displacement"] = 0.20
    first = next(verdicts(results, "fem", "tool"))
    assert first.is_resolved is False
    assert "not resolved" in verdict_rows(results)[0]


def test_the_error_at_the_control_point_itself_goes_before_that_over_all():
    results = results_of()
    record = results.numbers["models"][0]
    record["mesh_error_by_probe"] = {"far": {"displacement": 0.3, "velocity": 0.0}}
    record["time_step_error_by_probe"] = {"far": {"displacement": 0.01, "velocity": 0.0}}
    found = {probe: next(verdicts(results, "fem", probe)).error for probe in ("tool", "far")}
    assert found == pytest.approx({"tool": 0.023, "far": 0.3 + 0.01 + 2 * 0.001})


def test_velocity_and_loops_have_the_errors_of_velocity():
    found = {v.column: v.error for v in verdicts(results_of(), "fem", "tool")}
    assert found["velocity", "relative-l2"] == pytest.approx(0.05 + 3 * 0.01)
    assert found["phase-plane", "area"] == pytest.approx(0.05 + 3 * 0.01)


def test_without_a_mesh_error_a_lead_is_at_best_unknown():
    results = results_of()
    del results.numbers["models"][0]["mesh_error"]
    first = next(verdicts(results, "fem", "tool"))
    assert first.is_resolved is None
    assert "≥ 0.0030" in verdict_rows(results)[0]
    results.numbers["models"][0]["time_step_error"] = 0.5
    assert next(verdicts(results, "fem", "tool")).is_resolved is False


def test_the_benchmark_has_no_mesh_error_of_its_own():
    first = next(verdicts(results_of(), "basafa", "tool"))
    assert first.error == pytest.approx(0.003)
    assert first.is_resolved is True


def test_equal_scores_have_no_winner():
    results = results_of([*FUZZY[:2], "fem"])
    results.tables["similarity"] = [(*row[:-1], 0.5) for row in results.tables["similarity"]]
    assert all(verdict.is_resolved is False for verdict in verdicts(results, "fem", "tool"))
    assert "the two highest scores are equal on all 7 measures" in " ".join(sentences(results))
    cells = [
        c for t in similarity_tables(results) for g in t["groups"] for r in g["rows"] for c in r
    ]
    assert not any(cell.endswith("*") for cell in cells)


def test_the_highest_fuzzy_score_of_a_column_is_marked_and_no_other():
    table = similarity_tables(results_of())[0]
    rows = {row[0]: row[1:] for row in table["groups"][0]["rows"]}
    assert all(cell.endswith("*") for cell in rows.pop("MSM Sugeno"))
    assert not any(cell.endswith("*") for row in rows.values() for cell in row)


def test_the_tools_control_point_is_the_nearest_not_the_first():
    results = results_of(probes=["far", "near"])
    assert tool_probe(results) == "far"  # the samples put the first one under the tool
    results.arrays["fields"]["probes"] = results.arrays["fields"]["probes"][::-1]
    assert tool_probe(results) == "near"
    assert tool_probe(replace(results, arrays={})) == "far"


def test_the_peak_is_that_of_the_curve():
    samples = [float(row[3]) for row in results_of().tables["curves"] if row[:2] == ("fem", "tool")]
    assert peak(results_of(), "fem", "tool") == max(samples)
    assert peak(results_of(), "fem", "elsewhere") is None


def test_a_column_that_no_model_fills_is_left_out():
    results = results_of(["basafa", *FUZZY])
    assert "field differs from FE" not in glance(results)["header"]
    assert "field differs from FE" in glance(results_of())["header"]


def test_table_iii_stands_beside_the_range_of_all_measures():
    score = fixed(score_of("msm-sugeno", "basafa"), 4)
    assert ["Benchmark – Sugeno", "0.8549", f"{score} to {score}"] in paper_rows(results_of())
    assert pytest.approx(0.0049) == TABLE_III_SPREAD
    assert max(TABLE_III, key=TABLE_III.__getitem__) == "interval-type-2"
    assert SOFTNESS["msm-sugeno"] > SOFTNESS["msm-mamdani"]


def test_every_measure_has_its_formula():
    assert len(formula_rows()) == len(FORMULAS)
    formulas = {name: formula for name, formula, _ in formula_rows()}
    assert formulas["ISO 18571"] == '0.4 "corridor" + 0.2 ("phase" + "magnitude" + "slope")'


def test_columns_of_the_scene_keep_every_group_in_order():
    groups = [{"name": str(i), "rows": [["a", "b"]] * (i % 7)} for i in range(20)]
    split = balanced(groups, 3)
    assert [group for column in split for group in column] == groups
    heights = [sum(len(group["rows"]) + 2 for group in column) for column in split]
    assert max(heights) - min(heights) <= 8  # no more than the tallest group
