"""report.html: asks the network for nothing, says what the run found, and moves what it should."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from html import unescape
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from fuzzy.liver import stiffness
from reports.page import write
from reports.page.answer import answer, nearest, question
from reports.page.data import film, interpolation_error, page
from study.commands.view import view
from study.results import ResultsError
from study.results import folder as results_folder
from study.results.records import BudgetPart, CurveErrors, ErrorBudget
from tests.report_samples import (
    MODELS,
    results_of,
    whole,
    with_mesh_error,
    with_model,
    with_record,
    without_arrays,
)

pytest.importorskip("plotly", reason="plotly draws the page")
PROBE = Path(__file__).with_name("page_probe.js")
BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "chrome"))), None)
LARGEST = 10e6
ATTRIBUTES = {"src", "href", "action", "data", "poster", "srcset", "formaction", "xlink:href"}


class Asked(HTMLParser):
    """What the elements of a page would ask for, and the text of its scripts but plotly's."""

    def __init__(self, text):
        super().__init__()
        self.asked, self.elements, self.own, self.inside = [], [], [], None
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))
        self.inside = dict(attributes).get("id", tag)
        self.asked += [value for name, value in attributes if name in ATTRIBUTES]

    def handle_data(self, data):
        if self.inside != "plotly":
            self.own.append(data)


@pytest.fixture(scope="module")
def text():
    return write.page_of(results_of()).decode()


def test_no_element_asks_for_anything_but_a_place_in_the_page(text):
    found = Asked(text)
    assert found.asked
    assert all(value.startswith("#") or value == "data:," for value in found.asked)
    assert not re.search(r"https?://|@import|url\(", "".join(found.own))
    assert "fetch(" not in "".join(found.own)


def test_a_request_would_be_seen():
    """Negative control of the test above."""
    assert Asked('<img src="https://example.org/a.png">').asked == ["https://example.org/a.png"]


def test_the_page_forbids_requests_to_itself(text):
    metas = [attributes for tag, attributes in Asked(text).elements if tag == "meta"]
    policy = next(one["content"] for one in metas if "http-equiv" in one)
    assert policy.startswith("default-src 'none';")
    assert "http" not in policy


def test_the_same_results_give_the_same_bytes_in_another_process(tmp_path):
    (tmp_path / "a").mkdir()
    results_folder.write(whole(), tmp_path / "a")
    write.make_page(tmp_path / "a")
    first = (tmp_path / "a" / write.NAME).read_bytes()
    code = "import sys, pathlib; from reports.page.write import make_page; "
    code += "make_page(pathlib.Path(sys.argv[1]))"
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "a")], check=True)
    assert (tmp_path / "a" / write.NAME).read_bytes() == first
    assert len(first) < LARGEST


def test_other_numbers_give_other_bytes():
    """Negative control of the test above."""
    other = with_model(results_of(), "basafa", wall_s=0.25)
    assert write.page_of(results_of()) != write.page_of(other)


def test_nothing_of_a_scene_opens_an_element():
    evil = "</script><script>alert(1)</script><img src=x>"
    found = Asked(write.page_of(results_of(title=evil, probes=["tool", evil[:40]])).decode())
    assert not any(tag == "img" for tag, _ in found.elements)
    scripts = [attributes for tag, attributes in found.elements if tag == "script"]
    assert len(scripts) == 3


def test_every_control_has_a_label_and_every_picture_says_what_it_is(text):
    elements = Asked(text).elements
    for tag, attributes in elements:
        if attributes.get("role") == "img" and tag == "div":
            assert "aria-label" in attributes or "aria-describedby" in attributes
    for name in re.findall(r'<(?:select|input) id="([\w-]+)"', text):
        assert re.search(rf'<label[^>]*>(?:(?!</label>).)*id="{name}"', text), name
    assert '<html lang="en">' in text


def test_the_scene_can_be_copied_and_read_again(text):
    toml = re.search(r'<pre id="toml" tabindex="0">(.*?)</pre>', text, re.DOTALL)[1]
    from study.scene.file import write_scene

    assert unescape(toml) == write_scene(results_of().scene)


# --- the answer ----------------------------------------------------------------------------------


def said(results):
    return " ".join(answer(results).sentences)


def test_the_nearest_model_is_named_with_the_error_of_the_reference():
    rows = tuple(
        row._replace(value=0.2)
        if (row.model, row.quantity) == ("msm-sugeno", "field-relative-l2-peak")
        else row
        for row in results_of().field_differences
    )
    results = replace(results_of(), field_differences=rows)
    assert nearest(results).model.name == "msm-sugeno"
    assert "The model nearest to the finite-element reference is MSM Sugeno" in said(results)
    assert "a spring lattice with the stiffness that the fuzzy system Sugeno" in said(results)
    assert "20 ± 3 % in relative L2 (± is the discretisation error" in said(results)
    assert answer(results).numbers[0].value == "20 ± 3 %"
    assert "Its lead over" not in said(results)


def test_a_lead_within_the_error_of_the_reference_is_not_resolved():
    found = said(results_of())
    assert re.search(r"Its lead over MSM .* is not resolved by this reference\.", found)


def test_a_difference_below_the_error_of_the_reference_is_not_resolved():
    found = said(with_mesh_error(field_peak=0.5))
    assert "less than 50.0 % in relative L2, the discretisation error of the reference" in found
    assert "a more accurate reference (reference.accuracy) is needed" in found


def test_a_diverged_model_is_told_and_never_the_nearest():
    results = with_model(results_of(), "basafa", status="diverged", ended_at_s=0.25)
    assert "Basafa benchmark diverged at 0.250 s: do not use it" in said(results)
    assert nearest(results).model.name != "basafa"


def test_where_nothing_finished_the_answer_says_so():
    results = results_of()
    for name in MODELS:
        results = with_model(results, name, status="diverged", ended_at_s=0.5)
    assert "No model finished" in said(results)
    assert answer(results).numbers == ()
    assert write.page_of(results)


def test_without_a_reference_no_error_is_claimed():
    found = said(results_of(["basafa"]))
    assert "no error can be stated. Add fem to models." in found


def test_a_run_of_the_finite_elements_alone_is_not_told_to_add_them():
    found = said(results_of(["fem"]))
    assert found == "No finished model is compared with a reference: no error can be stated."


def test_of_a_point_the_curves_are_compared_and_called_a_difference_of_two_models():
    results = replace(without_arrays(results_of(["basafa", "msm-sugeno"])), field_differences=())
    found = nearest(results)
    assert not found.is_field
    assert found.share == pytest.approx(0.6)  # softness 0.8 beside 2.0
    assert "a difference between two models, not an error" in said(results)


def test_the_largest_cause_of_the_budget_limits_it_and_has_a_remedy():
    parts = tuple(
        BudgetPart(cause=cause, size=size, contribution=size, left=0.1, error=None)
        for cause, size in (("Poisson ratio", 0.2), ("remainder", 0.9), ("lattice spacing", 0.1))
    )
    budgets = tuple(
        ErrorBudget(model=m, reference="fem", total=0.4, total_error=0.03, parts=parts)
        for m in MODELS[1:]
    )
    found = said(with_record(results_of(), budgets=budgets))
    assert "the Poisson ratio, which contributes +20 % to a total of 40 %." in found
    assert "lattice.volume_term = true" in found


def test_the_error_at_the_tool_is_told_with_the_errors_of_both():
    found = answer(results_of())
    assert "control point tool is 1.993 ± 0.002 mm" in said(results_of())
    assert "reference is 1.00 ± 0.01 mm. The difference is +1.00 ± 0.01 mm" in said(results_of())
    assert found.numbers[1].value == "+1.00 ± 0.01 mm"


def test_a_gap_at_the_tool_below_its_errors_is_not_resolved():
    unsure = {name: CurveErrors(displacement=1.2, velocity=1.2) for name in ("tool", "far")}
    found = with_mesh_error(by_probe=unsure)
    assert "below the sum of their errors, 1.2 mm, and not resolved" in said(found)
    assert answer(found).numbers[1].value == "< 1.2 mm"


def test_a_gap_whose_errors_are_not_all_known_has_no_bar():
    found = with_model(results_of(), "basafa", time_step_errors={})
    assert "+1.0 mm (100 % of the reference); the errors of the two are not all known" in said(
        found
    )


def test_the_nearest_real_time_model_is_named_where_the_nearest_is_not_real_time():
    assert "a frame at 60 Hz takes 8.3 ms of the available 16.7 ms (50 %)" in said(results_of())
    assert "nearest real-time model" not in said(results_of())
    slow = with_model(results_of(), "basafa", wall_s=2.0)
    assert "takes 33 ms, more than the available 16.7 ms" in said(slow)
    assert "The nearest real-time model is MSM Mamdani: its difference is 40 %" in said(slow)
    hidden = with_model(with_mesh_error(field_peak=0.9), "basafa", wall_s=2.0)
    assert "its difference is not resolved (< 90.0 %), and a frame" in said(hidden)
    for name in MODELS:
        slow = with_model(slow, name, wall_s=2.0)
    assert "No finished model of this run is real time" in said(slow)


def test_earlier_measurements_are_quoted_only_for_the_organ_that_they_are_of():
    results = results_of()
    assert "measured beforehand on the built-in liver" in said(results)
    block = replace(results.scene, organ=replace(results.scene.organ, shape="block"))
    assert "measured beforehand" not in said(replace(results, scene=block))


def test_the_question_is_not_how_far_the_finite_elements_are_from_themselves():
    asked = question(results_of())
    assert "Basafa benchmark" in asked
    assert "Finite elements" not in asked


def test_a_slider_without_a_reading_starts_at_the_reading_of_the_other():
    results = results_of()
    patient = replace(results.scene.patient, hcv=9.5e3, hbv=None)
    found = page(replace(results, scene=replace(results.scene, patient=patient))).fuzzy
    assert found.start == (9.5, 9.5)
    assert found.unread == ("hbv",)


def test_the_page_has_the_front_of_those_that_follow_any_load():
    """None of them beats one on it in time and error, and one is on no other front."""
    shown = page(results_of()).tradeoff.configurations
    free = [one for one in shown if one.any_load]
    front = [one for one in shown if one.on_any_load_front]
    assert front
    assert all(one.any_load for one in front)
    assert any(not one.on_front for one in front)
    for one in front:
        assert not any(
            other.wall < one.wall and (other.error or 0.0) < (one.error or 0.0) - one.bar
            for other in free
        )


def test_digits_of_the_table_of_motion_follow_the_error_of_the_curve():
    """Of 1 mm and 3.1 mm/s known to 1 and 1.2 %, and of curves whose error is a thousandth."""
    lines = {one.model: one for one in page(results_of()).probes[0].lines}
    assert lines["fem"].decimals == (2, 2)
    assert lines["basafa"].decimals == (3, 2)


# --- what is drawn -------------------------------------------------------------------------------


def test_a_model_lost_before_the_end_keeps_the_frames_before():
    results = results_of()
    fields = results.fields | {"film.basafa": results.fields["film.basafa"].copy()}
    fields["film.basafa"][2] = np.nan
    found = page(replace(results, fields=fields)).organ
    assert found.films["basafa"].values.shape[0] == 2
    assert found.films["fem"].values.shape[0] == 3


def test_a_film_is_off_by_half_of_its_unit_at_most():
    frames = np.random.default_rng(5).normal(size=(4, 50, 3))
    made = film(frames)
    bytes_ = base64.b64decode(made.values.base64)
    back = made.unit * np.frombuffer(bytes_, dtype="<i2").reshape(made.values.shape)
    assert made.unit == np.abs(frames).max() / 32767
    assert 0.4 * made.unit < np.abs(back - frames).max() <= 0.5 * made.unit * (1 + 1e-9)
    assert film(np.zeros((2, 3, 3))).unit == 1.0


def test_the_stated_error_of_interpolation_bounds_what_is_missed_of_the_fuzzy_systems():
    random = np.random.default_rng(3)
    for system in ("mamdani", "sugeno"):
        x, y, z = stiffness.surface(system, "hcv", "hbv", base={"hcv": 9.5e3})
        points = random.uniform(x[0], x[-1], (300, 2))
        whole_row = np.tile(stiffness.liver_row({"hcv": 9.5e3}) * 1e3, (300, 1))
        for k, name in enumerate(("hcv", "hbv")):
            whole_row[:, stiffness.AETIOLOGIES.index(name)] = points[:, k]
        exact, _ = stiffness.evaluate(whole_row, system, present=("hcv", "hbv"))
        missed = np.abs(bilinear(x, y, z, points) - exact).max()
        assert 0.0 < missed < interpolation_error(z)


def bilinear(x, y, z, points):
    from scipy.interpolate import RegularGridInterpolator

    return RegularGridInterpolator((y, x), z)(points[:, ::-1])


def test_a_plane_is_interpolated_without_error_and_a_crease_is_not():
    """Negative control of the bound."""
    grid = np.arange(9.0)
    assert interpolation_error(np.add.outer(grid, grid)) == pytest.approx(0.0, abs=1e-12)
    assert interpolation_error(np.add.outer(np.abs(grid - 4.0), grid)) == pytest.approx(1.0)


# --- commands ------------------------------------------------------------------------------------


def test_view_makes_a_missing_page_and_opens_it(tmp_path, monkeypatch, capsys):
    opened = []
    monkeypatch.setattr("webbrowser.open", lambda uri: opened.append(uri) or True)
    (tmp_path / "a").mkdir()
    results_folder.write(whole(), tmp_path / "a")
    view(tmp_path / "a")
    made = tmp_path / "a" / write.NAME
    assert opened == [made.resolve().as_uri()]
    assert capsys.readouterr().out == f"{made}\n"
    results_folder.read(tmp_path / "a")  # a page is no foreign file


def test_view_says_so_where_there_is_no_browser_or_no_result(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("webbrowser.open", lambda _: False)
    with pytest.raises(ResultsError, match="no results here"):
        view(tmp_path)
    (tmp_path / "a").mkdir()
    results_folder.write(whole(), tmp_path / "a")
    view(tmp_path / "a")
    assert "open the file by hand" in capsys.readouterr().err


# --- in a browser --------------------------------------------------------------------------------

FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader"),
    *("--use-angle=swiftshader", "--virtual-time-budget=60000", "--enable-logging=stderr"),
    *("--window-size=1200,900", "--dump-dom"),
)
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no Chromium here")


def in_browser(folder, results, readings=()):
    """What the probe told of a page, and the lines of its console."""
    probe = f"window.probeReadings = {json.dumps(list(readings))};\n{PROBE.read_text()}"
    text = write.page_of(results).decode()
    made = folder / "page.html"
    made.write_text(text.replace("<noscript>", f"<script>{probe}</script><noscript>"))
    done = subprocess.run(
        [BROWSER, *FLAGS, f"--user-data-dir={folder / 'profile'}", made.as_uri()],
        capture_output=True,
        text=True,
        check=True,
        timeout=170,
    )
    told = re.search(r'<pre id="told">(.*?)</pre>', done.stdout, re.DOTALL)
    assert told, done.stderr[-2000:]
    return json.loads(unescape(told[1])), [x for x in done.stderr.splitlines() if "CONSOLE" in x]


@pytest.fixture(scope="module")
def moved(tmp_path_factory):
    if BROWSER is None:
        pytest.skip("no Chromium here")
    readings = [("mamdani", 9.5, 30.0), ("sugeno", 3.3, 70.0)]
    return in_browser(tmp_path_factory.mktemp("page"), results_of(), readings)


def test_nothing_is_asked_for_and_no_error_is_told(moved):
    told, console = moved
    assert told["violations"] == told["errors"] == told["requests"] == []
    assert not [line for line in console if "rror" in line], console


def test_the_organ_turns_on_both_sides_and_shows_differences(moved):
    organ = moved[0]["steps"]["organ"]
    assert all(a != b for a, b in zip(organ["first"], organ["turned"], strict=True))
    assert organ["keyed"] != organ["turned"][0]
    assert "− Finite elements" in organ["difference"]["title"]
    assert organ["difference"]["picture"] != organ["turned"][1]


def test_the_surface_follows_the_time_and_the_sliders_move_each_other(moved):
    """Of the samples the surface is at rest at first, at its peak half way, and at a fifth last.

    Displacements are known to 1 % of the largest.
    """
    organ, peak = moved[0]["steps"]["organ"], 1e3 * np.abs(results_of().fields["fem"][0]).max()
    assert f"Finite elements{0.2 * peak:.2f}" in organ["end"]["table"]
    assert "at 1.000 s" in organ["end"]["table"]
    assert organ["end"]["other"] == "19"
    assert organ["end"]["cursor"] == pytest.approx(1.0)
    assert f"Finite elements{0.5 * peak:.2f}" in organ["middle"]["table"]
    assert organ["middle"]["picture"] != organ["end"]["picture"]


def test_the_time_slider_moves_the_cursor_the_phase_plane_and_the_control_points(moved):
    motion, samples = moved[0]["steps"]["motion"], 20
    time = 5 / (samples - 1)
    assert motion["after"] == pytest.approx(time, abs=1e-6)
    assert motion["before"] != motion["after"]
    u, v = np.sin(np.pi * time), np.pi * np.cos(np.pi * time)
    assert motion["phase"][0] == pytest.approx([time, u], rel=1e-5)
    assert motion["phase"][2] == pytest.approx([u, v], rel=1e-5)
    assert motion["organMoved"]
    assert f"Finite elements{u:.2f}{v:.2f}1.00" in motion["table"]  # known to 1 % of the largest


def test_the_readings_move_estimates_sets_and_surface(moved):
    fuzzy = moved[0]["steps"]["fuzzy"]
    assert fuzzy["before"] != fuzzy["after"]
    assert fuzzy["moved"] == fuzzy["marker"] == 31.25
    assert "43.75" in fuzzy["after"]  # the surface of the samples is the sum of both readings


def test_live_evaluation_agrees_with_interpolation_in_python(moved):
    grid = np.linspace(2e3, 75e3, 5)
    z = np.add.outer(grid, grid)
    wanted = [
        bilinear(grid, grid, z, np.array([p]))[0] / 1e3 for p in ((9.5e3, 30e3), (3.3e3, 70e3))
    ]
    assert moved[0]["grid"] == pytest.approx(wanted, rel=1e-6)


def test_similarity_and_theme_follow_their_controls(moved):
    steps = moved[0]["steps"]
    assert steps["similarity"]["before"] != steps["similarity"]["after"]
    assert steps["theme"]["before"] != steps["theme"]["after"]
    assert steps["theme"]["plot"] in {"#15181c", "#ffffff"}


@needs_browser
def test_a_point_has_no_organ_and_the_page_still_works(tmp_path):
    told, _ = in_browser(tmp_path, without_arrays(results_of(["basafa", "msm-sugeno"])))
    assert told["errors"] == told["requests"] == []
    assert "no surface to show" in told["steps"]["organ"]["absent"]
    assert "no fuzzy systems" in told["steps"]["fuzzy"]["absent"]


@needs_browser
def test_a_defect_of_the_page_is_seen(tmp_path, monkeypatch):
    """Negative control: a program that throws and asks the network."""
    part = write.part
    planted = 'new Image().src = "https://example.invalid/x"; undefinedName();'
    monkeypatch.setattr(
        write,
        "part",
        lambda name: (
            part(name).replace(
                "function startPage() {",
                f"function startPage() {{ setTimeout(() => {{ {planted} }}, 0);",
            )
            if name == "page.js"
            else part(name)
        ),
    )
    told, _ = in_browser(tmp_path, without_arrays(results_of(["basafa", "msm-sugeno"])))
    assert any("example.invalid" in one for one in told["violations"])
    assert any("undefinedName" in one for one in told["errors"])
