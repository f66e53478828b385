"""The report says what accuracy costs and where models break as the tables have it, and no more."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from reports import benchmarks, canvas, stability_map, tradeoff_figure
from reports.appearance import series
from reports.robustness import robustness, robustness_figures
from reports.stability import FAILED, boundaries, cases, matrix
from reports.stability import sentences as told
from reports.tradeoff import conditions, configurations, left_out
from reports.tradeoff_answers import answers, sentences
from study.tradeoff import table
from tests.report_samples import beforehand_pdf, printed_beforehand

DATA = Path(benchmarks.__file__).parent / "data"
RATES = {"60hz": 60.0, "1khz": 1000.0}
BAR = 0.003
CASES = """\
family,case,expected,outcome,predicted,measured,difference,passed,message
critical step,E 1 Pa: verlet,"value, within 0.005",value,0.002,0.002002,0.001,True,
critical step,density 9 kg/m3: euler,"value, within 0.005",value,0.002,0.001994,0.003,True,
collapse,1 times its weight: euler,"bounded, within 0.02",bounded,0,0.01,0.01,True,
collapse,5 times its weight: euler,"diverged, within 0.15",diverged,1,1,0,True,
collapse,1 times its weight: verlet,"bounded, within 0.02",bounded,0,0.01,0.01,True,
collapse,5 times its weight: verlet,"diverged, within 0.15",diverged,1,1,0,True,
step,a step of zero,"refused, naming step",refused,,,,True,step must be positive
"""


def row(configuration, error, wall, **changes):
    """A line of the trade-off's table; a frame costs its part of a second."""
    line = {
        "contender": "springs",
        "configuration": configuration,
        "status": "resolved",
        "message": "",
        "any_load": True,
        "field_error": error,
        "field_error_bar": BAR,
        "setup_s": 0.5,
        "wall_per_s": wall,
        "wall_per_s_q1": 0.9 * wall,
        "wall_per_s_q3": 1.2 * wall,
    }
    for name, hertz in RATES.items():
        line |= {
            f"frame_ms_{name}": 1e3 * wall / hertz,
            f"slow_frame_ms_{name}": 2e3 * wall / hertz,
            f"real_time_{name}": 2 * wall <= 1.0,
        }
    return line | changes


def sample():
    """Coarse, fine and too slow; one that no load but its own suits; one that diverged."""
    return [
        row("spacing=0.02 volume_term=True", 0.11, 0.02),
        row("spacing=0.01 volume_term=True", 0.04, 0.3),
        row("spacing=0.005 volume_term=True", 0.02, 0.9),
        row("spacing=0.01 volume_term=False", 0.24, 0.1, contender="basafa"),
        row("count=8", "", 0.001, contender="superposition", any_load=False, status="not resolved"),
        dict.fromkeys(row("", 0, 0), "")
        | {"contender": "springs", "configuration": "step_rate=500", "status": "diverged"}
        | {"message": "at 0.12 s", "any_load": True, "field_error_bar": BAR},
    ]


def with_fronts(lines):
    """The lines with the marks that the study's rule gives them."""

    def place(line):
        return float(line["field_error"]), float(line["wall_per_s"])

    marked = []
    known = [line for line in lines if line["field_error"] and line["wall_per_s"]]
    groups = {"pareto": known, "pareto_any_load": [line for line in known if line["any_load"]]}
    for line in lines:
        marks = {
            name: line in group and not table.is_dominated(place(line), [*map(place, group)])
            for name, group in groups.items()
        }
        marked.append(line | marks)
    return marked


def write(lines, folder, mark=with_fronts):
    """The columns of the lines and the fronts that the study marks, as a folder's table."""
    with (folder / "tradeoff.csv").open("w", newline="") as file:
        columns = [*lines[0], "pareto", "pareto_any_load"]
        writer = csv.DictWriter(file, columns, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        writer.writerows(mark(lines))
    return configurations(folder)


@pytest.fixture(name="folder")
def _folder(tmp_path, monkeypatch):
    """Tables made up by hand."""
    write(sample(), tmp_path)
    known = {"unknowns": 12345, "field_error": BAR}
    record_ = {"machine": {"processor": "Some processor"}, "reference": known, "repeats": 5}
    (tmp_path / "tradeoff.json").write_text(json.dumps(record_))
    (tmp_path / "stability.csv").write_text(CASES)
    monkeypatch.setattr(benchmarks, "FOLDER", tmp_path)
    return tmp_path


def test_the_sentences_name_the_best_in_time_and_what_the_next_costs(folder):
    first, second = sentences(configurations(folder))
    assert first == (
        "At 60 Hz the most accurate real-time configuration for any load, within the error of the "
        "reference, is springs and volume term, 10 mm (error 4.0 ± 0.3 %, 60 % of the period); "
        "the next more accurate is springs and volume term, 5 mm (error 2.0 ± 0.3 %, 1.8 "
        "periods); if the place of the load is known beforehand, it is superposition, 8 vectors "
        "(error not resolved (< 0.3 %), 0.20 % of the period), with 0.50 s of set-up."
    )
    assert second.startswith("At 1 kHz")


def test_the_sentence_changes_with_the_data(tmp_path):
    lines = sample()
    lines[2]["real_time_60hz"] = True
    sixty, thousand = sentences(write(lines, tmp_path))
    assert "is springs and volume term, 5 mm (error 2.0 ± 0.3 %" in sixty
    assert "none is more accurate by more than the error of the reference" in sixty
    assert "is springs and volume term, 10 mm" in thousand


def test_an_accuracy_that_the_reference_cannot_tell_is_not_paid_for(tmp_path):
    lines = [*sample(), row("spacing=0.009", 0.04 - 0.5 * BAR, 0.45)]
    said = sentences(write(lines, tmp_path))[0]
    assert "is springs and volume term, 10 mm" in said
    assert "the next more accurate is springs and volume term, 5 mm" in said
    lines[-1] |= {"field_error": 0.04 - 1.5 * BAR}  # and one that it can tell is
    assert "is springs alone, 9 mm" in sentences(write(lines, tmp_path))[0]


def test_where_nothing_is_in_time_the_nearest_is_named(tmp_path):
    lines = [line | {"real_time_1khz": False} for line in sample()]
    found = write(lines, tmp_path)
    said = sentences(found)[1]
    assert (
        "no configuration for any load is real time; the fastest is springs and volume term, 20 mm "
        "(error 11.0 ± 0.3 %, 4.0 % of the period)" in said
    )
    assert [line[2] for line in answers(found)] == [
        "springs and volume term, 10 mm",
        "none",
        "superposition, 8 vectors",
        "none",
    ]


@pytest.fixture(name="fronts")
def _fronts(monkeypatch):
    """Places [(wall, error in per cent)] of the two step lines that a table's figure draws."""
    monkeypatch.setattr(canvas, "svg", lambda figure: figure)

    def drawn(found):
        lines = tradeoff_figure.tradeoff_figure(found).axes[0].lines
        steps = [line for line in lines if line.get_drawstyle() == "steps-post"]
        return {line.get_linestyle(): list(map(tuple, line.get_xydata())) for line in steps}

    return drawn


def marked(lines, column):
    """Places of the lines that a table marks, the cheapest first."""
    chosen = [line for line in lines if line[column] in (True, "True")]
    return sorted((float(o["wall_per_s"]), 100 * float(o["field_error"])) for o in chosen)


def test_the_drawn_front_is_that_which_the_study_marks(fronts):
    if not (found := configurations(DATA)):
        pytest.skip("tradeoff.csv does not come with the program")
    lines = list(csv.DictReader((DATA / "tradeoff.csv").read_text().splitlines()))
    drawn = fronts(found)
    assert drawn["-"] == marked(lines, "pareto_any_load") != []
    assert drawn[":"] == marked(lines, "pareto") != []


def test_a_planted_point_moves_the_drawn_front(fronts, tmp_path):
    before = [(0.02, 11.0), (0.3, 4.0), (0.9, 2.0)]
    assert fronts(write(sample(), tmp_path))["-"] == before
    beaten = [*sample(), row("spacing=0.03", 0.05, 0.5)]
    assert fronts(write(beaten, tmp_path))["-"] == before
    hardly_better = [*sample(), row("spacing=0.03", 0.995 * 0.04, 0.5)]  # within 1 % of the error
    assert fronts(write(hardly_better, tmp_path))["-"] == before
    better = [*sample(), row("spacing=0.03", 0.03, 0.05)]
    assert fronts(write(better, tmp_path))["-"] == [(0.02, 11.0), (0.05, 3.0), (0.9, 2.0)]


def test_the_front_follows_the_marks_and_no_rule_of_its_own(fronts, tmp_path):
    """Negative control: marks that no rule would set."""

    def mark(lines):
        return [line | {"pareto": k == 3} for k, line in enumerate(lines)]

    assert fronts(write(sample(), tmp_path, mark))[":"] == [(0.1, 24.0)]


def test_what_has_no_error_has_no_place_and_is_listed(folder):
    found = configurations(folder)
    assert left_out(found) == [["springs alone, 500 Hz steps", "diverged", "at 0.12 s"]]
    svg = tradeoff_figure.tradeoff_figure(found)
    assert b"500 Hz" in svg
    assert b"diverged at 0.12 s" in svg
    assert tradeoff_figure.tradeoff_figure(found[-1:]) is None


def test_marks_tell_contenders_apart_without_colour():
    looks = series(f"contender {k}" for k in range(7))
    assert len({look["marker"] for look in looks.values()}) == len(looks)


def test_the_figures_of_a_folder_are_drawn_into_it(folder):
    drawn = [*tradeoff_figure.write_figures(folder), *stability_map.write_figures(folder)]
    assert [path.name for path in drawn] == [
        f"{name}.{kind}"
        for name in ("tradeoff", "stability", "critical_step")
        for kind in ("svg", "pdf")
    ]
    assert all(path.stat().st_size > 1000 for path in drawn)
    first = [path.read_bytes() for path in drawn]
    tradeoff_figure.write_figures(folder)
    stability_map.write_figures(folder)
    assert [path.read_bytes() for path in drawn] == first


def test_a_folder_without_tables_has_no_figures(tmp_path):
    assert tradeoff_figure.write_figures(tmp_path) == []
    assert stability_map.write_figures(tmp_path) == []
    assert list(tmp_path.iterdir()) == []


def test_cases_are_counted_by_family_and_outcome(folder):
    assert matrix(cases(folder)) == {
        "critical step": {"value right": 2},
        "collapse": {"bounded": 2, "diverged as predicted": 2},
        "step": {"refused with reason": 1},
    }


def test_a_case_that_failed_is_counted_named_and_drawn_in_alarm(folder):
    good = stability_map.stability_map(cases(folder))
    assert stability_map.ALARM.lower().encode() not in good
    (folder / "stability.csv").write_text(CASES.replace("0.003,True", "0.03,False"))
    found = cases(folder)
    assert matrix(found)["critical step"] == {"value right": 1, FAILED: 1}
    assert told(found)[0] == (
        "Of 7 cases in 3 families 1 does not end as expected: critical step, density 9 kg/m3: "
        "euler."
    )
    assert stability_map.ALARM.lower().encode() in stability_map.stability_map(found)
    assert stability_map.ALARM.lower().encode() in stability_map.critical_step_figure(found)


def test_three_cases_that_failed_are_named_and_more_are_counted(folder):
    (folder / "stability.csv").write_text(CASES.replace("True", "False"))
    ended = told(cases(folder))[0]
    assert ended.startswith("Of 7 cases in 3 families 7 do not end as expected: critical step, E 1")
    assert ended.endswith("; collapse, 1 times its weight: euler and 4 more.")


def test_the_sentences_say_how_well_steps_are_predicted_and_where_models_break(folder):
    ended, steps, where = told(cases(folder))
    assert ended == "Of 7 cases in 3 families all end as expected."
    assert steps.endswith("by at most 0.3 % (density 9 kg/m3: euler).")
    assert where == (
        "Limits found in series of cases: collapse: 1 times its weight is completed, 5 is not "
        "(euler, verlet)."
    )


def test_a_series_that_breaks_elsewhere_is_told_apart(folder):
    changed = CASES.replace("1 times its weight: verlet", "3 times its weight: verlet")
    (folder / "stability.csv").write_text(changed)
    found = boundaries(cases(folder))
    assert [(one.held, one.broke, one.those) for one in found] == [
        (1.0, 5.0, ("euler",)),
        (3.0, 5.0, ("verlet",)),
    ]


@pytest.mark.usefixtures("folder")
def test_the_document_prints_them_and_says_that_they_are_of_no_run():
    texts = printed_beforehand()
    assert "They are not results of your scene." in texts
    assert {"springs and volume term, 10 mm", "4.0 ± 0.3 %", "60 %"} <= set(texts)
    measured = robustness()["tradeoff"]["measured"]
    assert measured == (
        "Measured on Some processor, with 5 repeats, against finite elements with 12\u202f345 "
        "unknowns, whose estimated error is 0.3 %."
    )
    figures = {k: [svg] for k, svg in robustness_figures().items()}
    assert beforehand_pdf(figures).startswith(b"%PDF")


@pytest.mark.parametrize(
    ("missing", "left"), [("tradeoff", ["stability"]), ("stability", ["tradeoff"])]
)
def test_a_table_that_is_missing_is_left_out(missing, left, folder):
    (folder / f"{missing}.csv").unlink()
    assert list(robustness()) == left
    drawn = {place for place, svg in robustness_figures().items() if svg}
    assert drawn == ({"tradeoff"} if missing == "stability" else {"stability", "critical_step"})
    assert beforehand_pdf().startswith(b"%PDF")


def test_without_tables_there_is_no_section(folder):
    for path in folder.iterdir():
        path.unlink()
    assert robustness() is None
    assert conditions() is None
    assert beforehand_pdf().startswith(b"%PDF")
