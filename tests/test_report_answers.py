"""What the first page says of cost and requirements, and the digits and names that it prints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from reports import canvas
from reports.budget import remaining, signed
from reports.digits import control_point, percent_known
from reports.free_labels import name_places
from reports.letters import without_shape
from reports.page.answer import answer
from reports.page.cost import (
    cost_sentences,
    frame_number,
    frame_range,
    is_undecided,
    same_work,
)
from reports.rule_view import _span
from reports.summary import real_time_factor
from reports.tables import check_rows
from study.results.records import Check
from study.scene import Require
from tests.report_samples import results_of, with_model, with_record


def said(results):
    return " ".join(answer(results).sentences)


@pytest.mark.parametrize(
    ("share", "error", "text"),
    [
        (0.2968, 0.027, "30 %"),
        (0.2968, 0.0027, "29.7 %"),
        (0.2968, 0.00027, "29.7 %"),
        (0.2968, None, "29.7 %"),
        (0.2968, 0.12, "30 %"),
    ],
)
def test_a_share_has_the_digits_of_its_error(share, error, text):
    assert percent_known(share, error) == text


def test_a_cause_is_printed_to_a_tenth_or_the_error_of_the_whole():
    assert [signed(x) for x in (0.00062, -0.0012, 0.0004)] == ["+0.1 %", "−0.1 %", "0"]
    assert [signed(x, 0.03) for x in (0.282, 0.004)] == ["+28 %", "0"]
    assert remaining(0.053, 0.02) == "5 %"


def test_the_point_of_a_scene_without_an_organ_is_named_once():
    assert control_point("control-point") == "the control point"
    assert control_point("tool") == "the control point tool"


def test_a_range_of_degrees_that_print_alike_is_one():
    assert _span(0.001, 0.002) == "<0.01"
    assert _span(0.13, 0.68) == "0.13–0.68"


def test_a_mark_without_shape_hides_no_further_letter():
    """A mark is drawn on what stands before it, which is then what the compiler names."""
    has = "κ"

    def refused(letters):
        lost = next((c for c in letters if c not in has), None)
        return " " if lost == "\u0e31" else lost

    assert set(without_shape("\u0e15\u0e31\u0e1a κ 肝", refused)) == set("\u0e15\u0e31\u0e1a肝")


def test_a_check_has_the_label_of_its_model():
    check = Check(name="msm-interval-type-2: mass", value=0.0, limit=1.0, meaning="mass")
    (row,) = check_rows(with_record(results_of(), checks=(check,)))
    assert row[0] == "MSM type-2: mass"


# --- the cost ------------------------------------------------------------------------------------


def timed(*walls):
    """The fuzzy-tuned lattices of the samples, each with its wall time [s]."""
    results = results_of()
    names = ("msm-mamdani", "msm-sugeno", "msm-interval-type-2")
    for name, wall in zip(names, walls, strict=True):
        results = with_model(results, name, wall_s=wall)
    return results


def test_lattices_of_the_same_work_show_the_spread_of_the_time():
    results = timed(0.05, 0.08, 0.06)
    model = results.model("msm-sugeno")
    assert {one.name for one in same_work(results, model)} == {
        one.name for one in results.record.models if one.name.startswith("msm-")
    }
    low, high = frame_range(results, model)
    assert high / low == pytest.approx(1.6)
    told = " ".join(cost_sentences(results, model))
    assert "The 3 lattices of this run that do the same work took" in told
    assert "does not decide" not in told


def test_a_time_on_both_sides_of_the_period_decides_nothing():
    span = results_of().model("msm-sugeno").simulated_s
    results = timed(0.5 * span, 2.0 * span, 2.0 * span)
    model = results.model("msm-sugeno")
    assert is_undecided(results, model)
    told = " ".join(cost_sentences(results, model))
    assert "does not decide whether they are real time" in told
    assert "real time not decided" in frame_number(results, model)[1]
    assert not is_undecided(timed(0.5 * span, 0.6 * span, 0.5 * span), model)


def test_a_lattice_of_other_springs_is_no_measure_of_the_time():
    results = timed(0.05, 0.08, 0.06)
    other = results.model("msm-mamdani").lattice
    results = with_model(
        results, "msm-mamdani", lattice=replace(other, springs=other.springs + 1), wall_s=5.0
    )
    names = [one.name for one in same_work(results, results.model("msm-sugeno"))]
    assert "msm-mamdani" not in names
    assert "basafa" not in names


def test_a_superposition_has_no_real_time_factor():
    """Its time includes the vectors, which are computed before the motion."""
    model = results_of().model("fem")
    assert real_time_factor(model) != "–"
    prepared = replace(model, name="superposition")
    assert real_time_factor(prepared) == "–"
    told = " ".join(cost_sentences(results_of(), prepared))
    assert "including its vectors" in told
    assert "on average a frame" not in told


# --- requirements --------------------------------------------------------------------------------


def required(*checks, notes=("Planned: model: a lattice of 8 mm (expected error 6.5 %).",)):
    """A run of one model by a plan, without a reference."""
    results = results_of(["msm-mamdani"])
    scene = replace(results.scene, require=Require(error=0.15))
    return replace(with_record(results, checks=checks, notes=notes), scene=scene)


def test_a_plan_is_answered_with_its_model_and_not_with_advice_that_has_no_effect():
    text = said(required())
    assert "The plan for the requirements of the scene chose: a lattice of 8 mm" in text
    assert "15.0 % is required" in text
    assert "Add fem" not in text
    assert "The largest displacement of MSM Mamdani at the control point tool is" in text
    assert [one.name for one in answer(required()).numbers][-1] == "time of a frame at 60 Hz"


def test_a_check_of_the_required_error_is_told_with_its_outcome():
    check = Check(
        name="msm-mamdani: require.error", value=0.05, limit=0.15, meaning="the run's own estimate"
    )
    assert "it is 5.0 %, within the 15.0 % required" in said(required(check))
    assert answer(required(check)).numbers[0].value == "5.0 %"
    failed = replace(check, value=0.2)
    assert "it is 20.0 %, more than the 15.0 % required" in said(required(failed))


# --- names beside marks --------------------------------------------------------------------------


def boxes_of(places, marks=None):
    """Extents [px] of the names written beside places in a plot, by name."""
    with canvas.style():
        figure = canvas.sheet(3.0, 3.0)
        axes = figure.subplots()
        axes.set(xlim=(0, 1), ylim=(0, 1))
        axes.axvline(0.5)
        name_places(axes, places, np.array(marks or [p[:2] for p in places]), {"color": "black"})
        found = {text.get_text(): text.get_window_extent() for text in axes.texts}
        return found, axes.transData


def test_names_cover_neither_marks_nor_lines_nor_each_other():
    rng = np.random.default_rng(3)
    places = [(*rng.uniform(0.1, 0.9, 2), f"{k} mm") for k in range(12)]
    found, to_sheet = boxes_of(places)
    assert 3 <= len(found) < 12
    seen = to_sheet.transform([place[:2] for place in places])
    line = to_sheet.transform((0.5, 0.5))[0]
    for name, box in found.items():
        assert not any(box.contains(*place) for place in seen)
        assert not box.x0 <= line <= box.x1
        assert not any(box.overlaps(other) for key, other in found.items() if key != name)


def test_a_name_stands_nearest_to_its_own_mark():
    places = [(0.40, 0.6, "first"), (0.44, 0.6, "second"), (0.8, 0.2, "third")]
    found, to_sheet = boxes_of(places)
    assert "third" in found
    seen = to_sheet.transform([place[:2] for place in places])
    for name, box in found.items():
        middle = (0.5 * (box.x0 + box.x1), 0.5 * (box.y0 + box.y1))
        nearest = np.linalg.norm(seen - middle, axis=1).argmin()
        assert places[nearest][2] == name
