"""Numbers are printed as they are, and a lead is called resolved only where the numerics allow."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from reports import budget
from reports.appearance import LOOKS, looks
from reports.certified import certified_rows
from reports.content import document
from reports.differences import finite_elements, own_error
from reports.digits import (
    count,
    fixed,
    percent,
    quantity,
    short,
    significant,
    spread,
    unbroken,
    with_error,
    words,
)
from reports.fuzzy_figures import SET_LOOKS
from reports.motion_figures import motions, peak
from reports.paper import TABLE_III, TABLE_III_SPREAD
from reports.ranking import leads, tool_probe
from reports.reference import reference
from reports.summary import glance, sentences
from reports.tables import (
    balanced,
    error_rows,
    formula_rows,
    lead_rows,
    paper_rows,
    similarity_tables,
)
from reports.tool_force import force_rows, overlap
from study.models.hyperelastic import LAW, METHOD
from study.results.records import (
    BudgetPart,
    CertifiedReduction,
    CurveErrors,
    ErrorBudget,
    ToolForce,
)
from study.results.tables import ToolForceScore
from study.similarity.score import FORMULAS
from tests.report_samples import (
    FUZZY,
    LABELS,
    MODELS,
    SOFTNESS,
    results_of,
    score_of,
    with_elements,
    with_mesh_error,
    with_model,
    with_record,
    without_arrays,
)


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


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (12.34, 0.1, "12.3 ± 0.1"),
        (12.34, 0.0123, "12.34 ± 0.01"),
        (12.34, 0.096, "12.3 ± 0.1"),  # 0.096 is 0.1 to one digit
        (0.2, 0.31, "0.2 ± 0.3"),
        (123.4, 12.0, "123 ± 12"),
        (-0.5, 0.02, "−0.50 ± 0.02"),
        (1.234567, 0.0, "1.23"),
    ],
)
def test_a_number_stops_at_the_first_digit_of_its_error(value, error, text):
    assert with_error(value, error) == text


def test_counts_stand_in_groups_of_three_digits():
    assert count(1234567) == "1\u202f234\u202f567"


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
    """Displacement: 0.01 of mesh and subspace together, and three times 0.001 of the step."""
    first = next(leads(results_of(), "fem", "tool"))
    assert first.column == ("displacement", "relative-l2")
    assert (first.best, first.runner_up) == ("msm-sugeno", "msm-mamdani")
    assert first.margin == pytest.approx(
        score_of("msm-sugeno", "fem") - score_of("msm-mamdani", "fem")
    )
    assert first.error == pytest.approx(0.013)
    assert first.is_resolved is True


def test_a_lead_below_the_numerical_error_is_not_resolved():
    """The same scores with a reference that is wrong by 20 %."""
    results = with_errors(0.20, 0.012)
    first = next(leads(results, "fem", "tool"))
    assert first.is_resolved is False
    assert "not resolved" in lead_rows(results)[0]


def with_errors(displacement: float, velocity: float):
    """Both control points have these errors by the mesh."""
    there = CurveErrors(displacement=displacement, velocity=velocity)
    return with_mesh_error(by_probe={"tool": there, "far": there})


def test_each_control_point_has_its_own_error():
    by_step = {p: CurveErrors(displacement=d, velocity=0.0) for p, d in (("tool", 2), ("far", 1))}
    results = with_model(results_of(), "fem", time_step_errors=by_step)
    found = {probe: next(leads(results, "fem", probe)).error for probe in ("tool", "far")}
    rest = 2 * 0.001
    assert found == pytest.approx({"tool": 0.01 + 2 + rest, "far": 0.02 + 1 + rest})


def test_velocity_has_its_own_error_and_loops_the_larger_of_the_two():
    found = {lead.column: lead.error for lead in leads(results_of(), "fem", "tool")}
    assert found["velocity", "relative-l2"] == pytest.approx(0.012 + 3 * 0.01)
    assert found["phase-plane", "area"] == pytest.approx(0.012 + 3 * 0.01)
    found = {lead.column: lead.error for lead in leads(with_errors(0.5, 0.1), "fem", "tool")}
    assert found["phase-plane", "area"] == pytest.approx(0.5 + 3 * 0.01)


def test_without_a_mesh_error_a_lead_is_at_best_unknown():
    results = with_elements(mesh_error=None, truncation_error=None)
    first = next(leads(results, "fem", "tool"))
    assert first.is_resolved is None
    assert "≥ 0.0030" in lead_rows(results)[0]
    coarse = dict.fromkeys(("tool", "far"), CurveErrors(displacement=0.5, velocity=0.5))
    results = with_model(results, "fem", time_step_errors=coarse)
    assert next(leads(results, "fem", "tool")).is_resolved is False


def test_the_benchmark_has_no_mesh_error_of_its_own():
    first = next(leads(results_of(), "basafa", "tool"))
    assert first.error == pytest.approx(0.003)
    assert first.is_resolved is True


def test_equal_scores_have_no_winner():
    results = results_of([*FUZZY[:2], "fem"])
    results = replace(results, scores=tuple(row._replace(score=0.5) for row in results.scores))
    assert all(lead.is_resolved is False for lead in leads(results, "fem", "tool"))
    assert "the two highest scores are equal in all 7 measures" in " ".join(sentences(results))
    cells = [
        c for t in similarity_tables(results) for g in t["groups"] for r in g["rows"] for c in r
    ]
    assert not any(cell.endswith("*") for cell in cells)


def test_the_highest_fuzzy_score_of_a_column_is_marked_and_no_other():
    table = similarity_tables(results_of())[0]
    rows = {row[0]: row[1:] for row in table["groups"][0]["rows"]}
    assert all(cell.endswith("*") for cell in rows.pop("MSM Sugeno"))
    assert not any(cell.endswith("*") for row in rows.values() for cell in row)


def test_a_highest_score_whose_lead_is_not_resolved_is_not_marked():
    """The same scores with a reference that is wrong by 20 % in displacement alone."""
    table = similarity_tables(with_errors(0.20, 0.012))[0]
    row = next(row[1:] for row in table["groups"][0]["rows"] if row[0] == "MSM Sugeno")
    marked = [cell.endswith("*") for cell in row]
    counts = {curve["name"]: curve["count"] for curve in table["curves"]}
    velocity = counts["displacement"] + counts["velocity"]
    assert not any(marked[: counts["displacement"]])
    assert all(marked[counts["displacement"] : velocity])
    assert not any(marked[velocity:])  # a loop has the larger error of the two


def differences(own: float | None):
    """What is printed where differences are 0.4, and 0.25 at best factor, if `own` is the error."""
    return with_elements(mesh_error=None) if own is None else with_mesh_error(field_peak=own)


@pytest.mark.parametrize(
    ("own", "whole", "at_best"),
    [
        (None, "40.0 %", "25.0 %"),
        (0.03, "40 %", "25 %"),
        (0.25, "40 %", "25 %"),  # resolved: not smaller than the error
        (0.3, "40 %", "not resolved (< 30.0 %)"),
        (0.41, "not resolved (< 41.0 %)", "not resolved (< 41.0 %)"),
    ],
)
def test_a_difference_below_the_error_of_the_finite_elements_is_not_resolved(own, whole, at_best):
    results = differences(own)
    table = glance(results)
    rows = {row[0]: dict(zip(table["header"], row, strict=True)) for row in table["rows"]}
    sugeno = rows["MSM Sugeno"]
    assert (sugeno["field difference from FE"], sugeno["at best scale factor"]) == (whole, at_best)
    assert f"MSM Sugeno {whole}" in " ".join(sentences(results))
    row = next(row for row in error_rows(results) if row[:2] == ["Finite elements", "MSM Sugeno"])
    assert row[2:] == [whole, "50.0 %", "10.0 %", at_best, "1.300"]


def test_leads_at_the_other_control_points_are_said_to_be_resolved_or_not():
    said = " ".join(sentences(results_of(["fem", *FUZZY])))
    assert said.count("Of these leads: 7 resolved.") == 2
    results = results_of(["fem", *FUZZY])
    by_probe = results.model("fem").mesh_error.by_probe
    by_probe = by_probe | {"far": CurveErrors(displacement=0.2, velocity=0.2)}
    results = with_mesh_error(results, by_probe=by_probe)
    said = " ".join(sentences(results))
    assert said.count("Of these leads: 7 resolved.") == 1
    assert said.count("Of these leads: 7 not resolved.") == 1


def budgeted(total_error=0.02):
    """Two parts of a difference of 0.4, and a remainder within rounding."""
    parts = [
        BudgetPart(cause=cause, size=size, contribution=share, left=left, error=error)
        for cause, size, share, left, error in (
            ("stiffness", 0.32, 0.3, 0.15, None),
            ("lattice spacing", 0.12, 0.1, 0.0001, 0.02),
            ("remainder", 0.0001, -0.0001, 0.0, 0.02),
        )
    ]
    found = ErrorBudget(
        model="msm-mamdani", reference="fem", total=0.4, total_error=total_error, parts=tuple(parts)
    )
    return with_record(results_of(), budgets=(found,))


def test_a_budget_has_a_row_a_cause_and_the_error_of_the_whole():
    (table,) = budget.budgets(budgeted())
    assert [row[1:] for row in table["rows"]] == [
        ["40.0 %", "± 2.0 %", ""],
        ["+30.0 %", "", "15.0 %"],
        ["+10.0 %", "± 2.0 %", "0"],
        ["0", "± 2.0 %", "0"],
    ]
    (table,) = budget.budgets(budgeted(0.5))
    assert table["rows"][0][1:] == ["not resolved (< 50.0 %)", "± 50.0 %", ""]
    (table,) = budget.budgets(budgeted(None))
    assert table["rows"][0][1:] == ["40.0 %", "–", ""]
    (told,) = budget.sentences(budgeted())
    assert "the field of MSM Mamdani differs from the finite elements by 40 %" in told
    assert told.count("%") == 3
    assert told.endswith("+30 %.")


def test_the_table_of_tools_has_force_time_depth_and_work_in_its_units():
    """[N], [s], [mm] and [mJ]; a score is printed to its error, 4 % of the force in all."""
    planted = ToolForce(
        model="msm-mamdani",
        tool="tool",
        peak_n=1.5,
        peak_at_s=0.25,
        peak_travel_m=4.2e-3,
        work_j=3.15e-3,
        relative_error=0.01,
        spacing_error=0.03,
    )
    bare = replace(planted, model="msm-sugeno", relative_error=None, spacing_error=None)
    results = with_record(results_of(), tools=(planted, bare))
    scores = [
        ToolForceScore(model, "fem", "tool", "force", measure, score)
        for model, measure, score in (
            ("msm-mamdani", "iso-18571", 0.1),
            ("msm-mamdani", "relative-l2", 0.87654),
            ("msm-sugeno", "relative-l2", 0.5),
        )
    ]
    first, second = force_rows(replace(results, tool_scores=tuple(scores)))
    assert first[:2] == ["tool", "MSM Mamdani"]
    assert first[2:6] == ["1.50 ± 0.06", "0.250", "4.2", "3.15"]
    assert first[6] == "0.88 (Finite elements)"
    assert second[1:3] == ["MSM Sugeno", "1.50"]
    assert second[6].startswith("0.5")


def test_the_table_of_bounds_has_each_in_its_column_and_rounds_up():
    """Of the curve, its largest [mm], of the energy, at rest, and by steps, by control point."""
    bounds = CertifiedReduction(
        vectors=7,
        energy=0.0312,
        rest=0.0051,
        rounding=1e-9,
        displacement={"tool": 0.0241, "far": 0.0625},
        largest_m={"tool": 1.01e-4, "far": 2e-4},
    )
    by_step = CurveErrors(displacement=0.002, velocity=0.3)
    results = with_elements(certified=bounds)
    results = with_model(results, "fem", time_step_errors={"tool": by_step})
    assert [row[2:] for row in certified_rows(results)] == [
        ["2.5 %", "0.11", "3.2 %", "0.51 %", "0.2 %"],
        ["6.3 %", "0.20", "3.2 %", "0.51 %", "–"],
    ]


def test_the_deepest_overlap_of_any_model_is_printed():
    results = with_model(results_of(), "msm-mamdani", tool_overlap_m=1.26e-4)
    assert overlap(results) == "0.13 mm"
    results = with_model(results, "msm-sugeno", tool_overlap_m=2.5e-3)
    assert overlap(results) == "2.5 mm"
    assert overlap(results_of()) == ""


def test_the_error_of_the_finite_elements_hides_no_difference_from_the_benchmark():
    row = next(row for row in error_rows(differences(0.41)) if row[0] == "Basafa benchmark")
    assert row[2] == "40.0 %"


def test_the_limits_of_the_springs_are_compared_with_that_error_too():
    """The samples' lattice differs by 0.05 at Poisson ratio 1/4, by 0.24 at its own."""
    results = differences(0.06)
    assert document(results)["limits"]["at_quarter"] == "not resolved (< 6.0 %)"
    assert document(results)["limits"]["whole"] == "24 %"
    said = " ".join(sentences(results))
    assert "24 % at Poisson ratio 0.45, 23 % at the best scale factor" in said
    assert "not resolved (< 6.0 %) against Poisson ratio 0.25" in said
    assert "5 % against Poisson ratio 0.25" in " ".join(sentences(differences(0.03)))


def test_a_diverged_model_has_no_real_time_factor():
    """Its wall time is that of a part of the motion."""
    column = glance(results_of())["header"].index("real-time factor")
    row = LABELS.index("Basafa benchmark")
    assert glance(results_of())["rows"][row][column] != "–"
    lost = with_model(results_of(), "basafa", status="diverged", ended_at_s=0.06)
    assert glance(lost)["rows"][row][column] == "–"


def test_the_reference_shows_its_own_error_in_place_of_a_difference():
    column = glance(results_of())["header"].index("field difference from FE")
    assert glance(results_of())["rows"][0][column] == "± 3.0 %"
    assert glance(differences(None))["rows"][0][column] == "–"


def test_a_peak_has_its_error_where_that_is_known_at_the_control_point():
    """The reference peaks near 1 mm; its curve is wrong by 2 % at the tool."""
    results = with_elements(mesh_error=None)
    column = glance(results)["header"].index("peak at tool [mm]")
    largest = 1e3 * peak(results, "fem", "tool")
    assert glance(results)["rows"][0][column] == significant(largest)
    shown = [row[column] for row in glance(with_errors(0.02, 0.5))["rows"]]
    assert shown[0] == f"{fixed(largest, 2)} ± 0.02"
    assert not any("±" in cell for cell in shown[1:])


def test_the_tools_control_point_is_the_nearest_not_the_first():
    results = results_of(probes=["far", "near"])
    assert tool_probe(results) == "far"  # the samples put the first one under the tool
    turned = results.fields | {"probes": results.fields["probes"][::-1]}
    assert tool_probe(replace(results, fields=turned)) == "near"
    assert tool_probe(without_arrays(results)) == "far"


def test_the_peak_is_that_of_the_curve():
    results = results_of()
    samples = [row.displacement_m for row in results.curves if row[:2] == ("fem", "tool")]
    assert peak(results, "fem", "tool") == max(samples)
    assert peak(replace(results, curves=()), "fem", "tool") is None


def test_curves_are_drawn_in_millimetres_between_the_bounds_of_an_interval():
    """The samples' softer bound moves 1.1 times as far, the stiffer 0.9 times."""
    results = results_of()
    drawn = {one.look.label: one for one in motions(results, "far")}
    curve, type_2 = results.curve("msm-interval-type-2", "far"), drawn["MSM type-2"]
    whole = np.stack([curve.time, 1e3 * curve.displacement, 1e3 * curve.velocity])
    np.testing.assert_allclose(type_2.motion, whole)
    softer, stiffer = (whole * [[1.0], [share], [share]] for share in (1.1, 0.9))
    np.testing.assert_allclose(type_2.bounds, [softer, stiffer])
    assert [len(one.bounds) for one in drawn.values()] == [0, 0, 0, 0, 2]


def test_a_column_that_no_model_fills_is_left_out():
    results = results_of(["basafa", *FUZZY])
    assert "field difference from FE" not in glance(results)["header"]
    assert "field difference from FE" in glance(results_of())["header"]


def test_table_iii_stands_beside_the_range_of_all_measures():
    score = fixed(score_of("msm-sugeno", "basafa"), 2)  # whose error is not known
    assert ["Benchmark – Sugeno", "0.8549", score] in paper_rows(results_of())
    assert pytest.approx(0.0049) == TABLE_III_SPREAD
    assert max(TABLE_III, key=TABLE_III.__getitem__) == "interval-type-2"
    assert SOFTNESS["msm-sugeno"] > SOFTNESS["msm-mamdani"]


def test_no_stage_has_the_colour_of_a_model():
    """The output's panel shows both."""
    assert not {colour for colour, _ in SET_LOOKS} & {look.colour for look in LOOKS.values()}


def test_no_model_looks_like_another():
    seen = looks(results_of())
    assert list(seen) == MODELS
    assert len({(look.colour, look.dashes) for look in seen.values()}) == len(MODELS)


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


def test_leads_that_another_window_or_other_axes_may_turn_are_counted():
    results = results_of()

    def said(**spread):
        rows = tuple(row._replace(**spread) for row in results.score_differences)
        return " ".join(sentences(replace(results, score_differences=rows)))

    assert "All exceed their range over time windows" in said(window=0.0, normalised=0.0)
    assert " 7 do not exceed their range over time windows" in said(window=1.0, normalised=0.0)
    assert " 7 do not exceed their range over time windows" in said(window=0.0, normalised=1.0)


def hyperelastic(results):
    """Results whose finite elements have another name and law."""
    of = {"fem": "hyperelastic"}
    models = tuple(
        replace(
            one,
            name=of.get(one.name, one.name),
            elements=one.elements
            and replace(one.elements, law=LAW, method=METHOD, subspace_vectors=None),
        )
        for one in results.record.models
    )

    def renamed(rows):
        return tuple(row._replace(reference=of.get(row.reference, row.reference)) for row in rows)

    return replace(
        results,
        record=replace(results.record, models=models),
        field_differences=renamed(results.field_differences),
        scores=renamed(results.scores),
        score_differences=renamed(results.score_differences),
    )


def test_hyperelastic_elements_are_what_fields_differ_from(small_results):
    linear, renamed = small_results, hyperelastic(small_results)
    assert finite_elements(renamed).name == "hyperelastic"
    assert own_error(renamed) == own_error(linear) > 0.0
    column = glance(linear)["header"].index("field difference from FE")
    assert [row[column] for row in glance(renamed)["rows"]] == [
        row[column] for row in glance(linear)["rows"]
    ]
    said = " ".join(sentences(renamed))
    assert "largest logarithmic strain" in said
    assert "assumed for linear strain" not in said
    how = reference(renamed)["how"]
    assert how.startswith("Neo-Hookean elasticity on")
    assert "implicit steps of SDIRK2" in how
    assert reference(linear)["how"].startswith("Linear elasticity on")


def test_a_number_stays_with_its_error_and_unit():
    assert unbroken("off by 0.144 ± 0.006 mm (8.7 %)") == (
        "off by 0.144\u00a0±\u00a00.006\u00a0mm (8.7\u00a0%)"
    )
    assert unbroken("5 models, 3 skips, a ± b") == "5 models, 3 skips, a ± b"
