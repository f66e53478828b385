"""Figures and tables of the fuzzy systems: complete, legible, and true to the numbers."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from fuzzy.liver.settings import LiverSettings
from fuzzy.liver.stiffness import liver_row, patient_system
from fuzzy.systems.explain import explain
from fuzzy.systems.explanation_arrays import drawing_arrays
from fuzzy.systems.kinds import SYSTEMS
from reports import canvas
from reports.fuzzy_figures import draw_sets, draw_surfaces, sets_figure, surfaces_figure
from reports.fuzzy_tables import (
    between_systems,
    sensitivity_sentences,
    set_rows,
    system_changes,
    unsourced_count,
    within_systems,
)
from reports.rule_view import draw_rules, kinds, rule_figures, view_names
from reports.sensitivity_figure import layout, sensitivity_figure
from study.results import Results
from study.results.records import StiffnessSet
from study.results.tables import SensitivityEntry
from tests.report_samples import results_of, with_record

T2 = "interval-type-2"
ROWS = tuple(
    SensitivityEntry(*row)
    for row in (
        ("reading", "R1", "R2", "mamdani", -500.0, 400.0, 2000.0, 256.0),
        ("reading", "R1", "R2", T2, -700.0, 600.0, 2200.0, 256.0),
        ("reading", "R1", "R4-drop", "mamdani", 0.0, 0.0, 0.0, 256.0),
        ("reading", "R1", "R4-drop", T2, -90.0, 60.0, 250.0, 256.0),
        ("sugeno_aggregation", "sum", "max", "sugeno", -3200.0, 4050.0, 5800.0, 256.0),
        ("sampling", "matlab", "exact", "mamdani", 40.0, 29.0, 44.0, 24.0),
        ("system", "mamdani", "sugeno", "mamdani", -1190.0, 1130.0, 2940.0, 256.0),
        ("system", "mamdani", T2, "mamdani", 300.0, 350.0, 1090.0, 256.0),
        ("system", "sugeno", T2, "sugeno", 1490.0, 1110.0, 3450.0, 256.0),
    )
)
SET = StiffnessSet(
    aetiology="hcv",
    stage="F2",
    severity="mild",
    placement="stage-mean",
    centre=6.9,
    centre_source="sporea2010",
    within_stage_sd=2.5,
    sd_kind="published",
    sd_source="sporea2010",
    between_study=0.198,
    between_study_kind="transferred",
    between_study_source="chon2012",
    between_operator=0.0798,
    between_operator_kind="published",
    between_operator_source="liv12551",
    n=146,
    sourced="yes",
    note="",
)


@pytest.fixture(scope="module")
def view_arrays() -> dict[str, np.ndarray]:
    readings = {"hcv": 9.5e3, "nafld": 12e3}
    system, row = (
        patient_system(readings, LiverSettings(knowledge="severity")),
        liver_row(readings)[0],
    )
    found = [drawing_arrays(explain(system, row, kind), "kPa") for kind in SYSTEMS]
    return found[0] | found[1] | found[2]


@pytest.fixture(scope="module")
def results(view_arrays) -> Results:
    base = results_of()
    sets = (
        SET,
        replace(SET, aetiology="ald", stage="F4", sourced="partly", n=None),
        replace(SET, aetiology="nafld", sourced="weak", sd_kind="ratio"),
        replace(SET, aetiology="nafld", stage="F3", sourced="no"),
    )
    base = with_record(base, fuzzy=replace(base.record.fuzzy, stiffness_sets=sets))
    return replace(base, fuzzy=base.fuzzy | view_arrays, sensitivity=ROWS)


@pytest.fixture
def drawn(monkeypatch):
    """Call a drawing function and get the figure itself."""
    monkeypatch.setattr(canvas, "svg", lambda figure: figure)
    return lambda function, *arguments: function(*arguments)


@pytest.fixture(scope="module")
def figures(results, view_arrays) -> dict[str, Figure]:
    """Every figure once, laid out."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(canvas, "svg", lambda figure: figure)
        found = {kind: draw_rules(view_arrays, kind) for kind in SYSTEMS}
        found["sensitivity"] = sensitivity_figure(ROWS)
        found["sets"] = sets_figure(results)
        found["surfaces"] = surfaces_figure(results)
    for figure in found.values():
        FigureCanvasAgg(figure).draw()
    return found


def cut_off(figure: Figure) -> list[str]:
    """Texts that reach beyond the sheet by more than a pixel."""
    renderer, sheet = figure.canvas.get_renderer(), figure.bbox
    found = []
    for text in figure.findobj(Text):
        box = text.get_window_extent(renderer)
        inside = box.min.min() >= -1 and (box.max <= sheet.max + 1).all()
        if text.get_text() and not is_number(text.get_text()) and not inside:
            found.append(text.get_text())
    return found


def is_number(text: str) -> bool:
    """Numbers of ticks beyond an axis exist, but are not drawn."""
    return text.replace("−", "").replace(".", "").isdigit()


def words_of(figure) -> str:
    return " | ".join(t.get_text() for t in figure.findobj(Text))


def test_figures_are_svg_and_the_same_twice(view_arrays):
    for draw in (lambda: draw_rules(view_arrays, "sugeno"), lambda: sensitivity_figure(ROWS)):
        svg = draw()
        assert svg == draw()
        assert ET.fromstring(svg).tag.endswith("svg")  # noqa: S314 our own


def test_no_text_is_cut_off(figures):
    assert {name: cut_off(figure) for name, figure in figures.items()} == {
        name: [] for name in figures
    }


def test_a_text_beyond_the_sheet_is_noticed(figures):
    figure = figures["mamdani"]
    label = figure.text(0.97, 0.5, "a label much too long")
    assert cut_off(figure) == ["a label much too long"]
    label.remove()


def test_no_text_is_too_small_to_read(figures):
    for figure in figures.values():
        assert min(text.get_fontsize() for text in figure.findobj(Text)) >= canvas.TEXT_SIZE


def test_three_rule_views_fit_a_page(figures):
    heights = [figures[kind].get_figheight() for kind in SYSTEMS]
    assert sum(heights) < 259 / 25.4  # an A4 page between its margins


def test_a_rule_view_shows_readings_rules_answer_interval_and_switches(figures, view_arrays):
    text = words_of(figures[T2])
    low, high = view_arrays[f"view.{T2}.interval"]
    for part in ("HCV 9.5 kPa", "NAFLD 12.0 kPa", "mild", "severe", "bounds switch"):
        assert part in text
    assert f"Interval type-2: {view_arrays[f'view.{T2}.answer']:.2f} kPa" in text
    assert f"interval {low:.2f} to {high:.2f} kPa" in text
    rules = [f"rule {n}" for n in view_arrays[f"view.{T2}.rules.number"]]
    assert all(rule in text for rule in rules)


def test_a_sugeno_view_shows_constants_and_weights_without_an_interval(figures):
    text = words_of(figures["sugeno"])
    assert text.count(", weight") == 3
    assert "interval" not in text


def test_rule_views_are_made_for_the_systems_there_are(results, view_arrays):
    assert kinds(view_arrays) == list(SYSTEMS)
    assert view_names(results) == ["Mamdani", "Sugeno", "Interval type-2"]
    assert rule_figures(results_of()) == []
    one = {name: a for name, a in view_arrays.items() if name.startswith("view.sugeno.")}
    assert len(rule_figures(replace(results, fuzzy=one))) == 1


def test_sets_of_one_stage_look_alike_and_estimates_are_named(drawn, results):
    arrays = dict(results.fuzzy)
    arrays["hbv.sets"], arrays["hcv.sets"] = np.array(["F2", "F4"]), np.array(["F1", "F4"])
    figure = drawn(draw_sets, arrays, {"mamdani": 14e3})
    lines = {
        (axes.get_title(), line.get_label().split(",")[0]): line.get_color()
        for axes in figure.axes
        for line in axes.lines
    }
    assert lines["HCV", "F4"] == lines["HBV", "F4"] == lines["output: stiffness", "severe"]
    assert len({lines["HCV", "F1"], lines["HBV", "F2"], lines["HCV", "F4"]}) == 3
    assert "Mamdani" in words_of(figure)


def test_surfaces_are_labelled_with_their_inputs_and_end_where_they_come_to_rest(drawn, results):
    over = replace(results.scene.fuzzy, surface=("ald", "nafld"))
    named = replace(results, scene=replace(results.scene, fuzzy=over))
    text = words_of(drawn(surfaces_figure, named))
    assert "ALD [kPa]" in text
    assert "NAFLD [kPa]" in text
    x = np.linspace(2e3, 75e3, 74)
    flat = np.minimum(x, 10e3)
    arrays = {"surface.x": x, "surface.y": x, "surface.sugeno": np.add.outer(flat, flat)}
    figure = drawn(draw_surfaces, arrays, ("hcv", "hbv"))
    flat_panel = next(axes for axes in figure.axes if axes.name != "3d")
    assert 10.0 <= flat_panel.get_xlim()[1] < 13.0


@pytest.mark.parametrize("height", [0.0, 5e3])
def test_a_constant_surface_is_drawn_whole(drawn, height):
    x = np.linspace(0.0, 75e3, 9)
    arrays = {"surface.x": x, "surface.y": x, "surface.sugeno": np.full((9, 9), height)}
    figure = drawn(draw_surfaces, arrays, ("hcv", "hbv"))
    assert next(a for a in figure.axes if a.name != "3d").get_xlim()[1] == 75.0


def test_the_sensitivity_figure_has_a_line_per_alternative_and_the_band(drawn):
    lines, heads = layout(within_systems(ROWS))
    assert [label for _, label, _ in lines] == ["R2", "R4-drop", "max", "exact"]
    assert heads[0][1] == "reading of Table I: R1 →"
    places = sorted([y for y, _, _ in lines] + [y for y, _ in heads])
    assert min(np.diff(places)) >= 1.0
    figure = drawn(sensitivity_figure, ROWS)
    (band,) = figure.axes[0].patches
    assert (band.get_x(), band.get_x() + band.get_width()) == pytest.approx((0.35, 1.13))


def test_marks_stand_at_the_rms_and_whiskers_end_at_the_largest(drawn):
    figure = drawn(sensitivity_figure, ROWS)
    drawn_at = {round(float(x), 6) for line in figure.axes[0].lines for x in line.get_xdata()}
    changed = [row for row in within_systems(ROWS) if row.rms_change_pa > 0]
    assert drawn_at >= {row.rms_change_pa / 1e3 for row in changed}
    assert drawn_at >= {row.largest_change_pa / 1e3 for row in changed}
    assert min(drawn_at) == 1e-3  # no change at all is drawn at the foot of the scale


def test_without_rows_there_is_no_sensitivity():
    bare = results_of()
    assert sensitivity_figure(bare.sensitivity) is None
    assert system_changes(bare) == []
    assert sensitivity_sentences(bare) == []
    assert between_systems([]) is None
    assert set_rows(bare) == []


def test_the_changes_between_two_systems_are_in_kilopascal(results):
    assert system_changes(results)[0] == ["Mamdani → Sugeno", "−1.19", "1.13", "2.94"]


def test_the_summary_names_what_moves_the_estimate_more_than_the_system(results):
    (sentence,) = sensitivity_sentences(results)
    assert "two systems differ by 0.35 to 1.13 kPa (rms" in sentence
    assert "Sugeno's weights: sum → max (Sugeno, 4.05 kPa)" in sentence
    assert "Choices with an effect within that range: reading of Table I." in sentence
    assert "integration" not in sentence
    calm = tuple(row for row in ROWS if row.choice in ("system", "sampling"))
    (sentence,) = sensitivity_sentences(replace(results, sensitivity=calm))
    assert "No choice within a system has a larger effect." in sentence


def test_sets_without_a_full_source_are_marked(results):
    rows = set_rows(results)
    assert [row[1] for row in rows] == ["F2", "F4 †", "F2 ‡", "F3 §"]
    assert rows[0] == [
        *("hcv", "F2", "6.9", "stage-mean", "2.5", "published", "19.8 %", "8.0 %", "146"),
        "sporea2010",
    ]
    assert rows[1][8] == "–"
    assert unsourced_count(results) == (3, 4)
