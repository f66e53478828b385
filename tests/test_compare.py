"""Two results folders are compared number by number; an error planted in one of them is found."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from typing import get_args, get_origin, get_type_hints

import numpy as np
import pytest

from reports import canvas, several, several_pdf
from study.commands.compare import compare as command
from study.results import Results
from study.results.comparison import differences, other_words
from study.results.folder import write
from study.similarity.time_history import relative_l2_distance
from tests.report_samples import results_of, whole, with_model, with_record


def quantities(first, second):
    return {one.quantity: one for one in differences(first, second)}


def scaled(results, factor):
    """Displacements of the benchmark's curve at the tool by a factor."""
    rows = (
        row._replace(displacement_m=factor * row.displacement_m)
        if row[:2] == ("basafa", "tool")
        else row
        for row in results.curves
    )
    return replace(results, curves=tuple(rows))


def test_results_differ_in_nothing_from_themselves():
    assert differences(results_of(), results_of()) == []
    assert other_words(results_of(), results_of()) == []


def test_wall_times_do_not_count():
    other = with_record(with_model(results_of(), "fem", wall_s=99.0), study_wall_s=1.0)
    assert differences(results_of(), other) == []


def test_a_difference_of_a_curve_is_relative_to_the_largest_value_of_that_curve():
    """Which the benchmark has, and not the stiffer models."""
    one = quantities(whole(), scaled(whole(), 1.01))
    assert list(one) == ["curves.csv displacement_m"]
    found = one["curves.csv displacement_m"]
    curve = whole().curve("basafa", "tool").displacement
    assert found.largest == pytest.approx(0.01 * curve.max())
    assert found.relative == pytest.approx(0.01 / 1.01)
    assert relative_l2_distance(1.01 * curve, curve) == pytest.approx(0.01)
    assert found.where == f"basafa tool, sample {1 + int(curve.argmax())}"
    assert found.count == np.count_nonzero(curve)
    assert found.total == len(whole().curves)


def rows_by_table():
    """A row for each table of results, of texts and ones."""
    for name, hint in get_type_hints(Results).items():
        if get_origin(hint) is tuple:
            row = get_args(hint)[0]
            kinds = get_type_hints(row).values()
            yield pytest.param(name, row(*["x" if kind is str else 1.0 for kind in kinds]), id=name)


@pytest.mark.parametrize(("name", "row"), [*rows_by_table()])
def test_no_table_of_results_is_left_out(name, row):
    changed = row._replace(**{row._fields[-1]: 2.0})
    one, other = (replace(results_of(), **{name: (found,)}) for found in (row, changed))
    assert [found for found in differences(one, other) if found.quantity.endswith(row._fields[-1])]


def test_rows_and_arrays_that_only_one_has_are_no_small_difference():
    less = replace(whole(), curves=whole().curves[:-1], scores=whole().scores[1:])
    found = quantities(whole(), less)
    assert {q.split()[0] for q in found} == {"curves.csv", "similarity.csv"}
    assert all(math.isinf(one.relative) for one in found.values())
    assert "only in the first" in found["curves.csv velocity_m_per_s"].where
    found = quantities(results_of(["fem"]), results_of(["fem", "basafa"]))
    assert found["fields.npz basafa"].where == "only in the second"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda a: a + 1e-3, "index"),
        (lambda a: a[:1], "shapes (2, 6, 3) and (1, 6, 3)"),
        (lambda a: np.where(a > a.mean(), np.nan, a), "NaN in one of them"),
    ],
)
def test_arrays_are_compared_too(change, said):
    other = whole()
    other = replace(other, fields=other.fields | {"fem": change(other.fields["fem"])})
    found = quantities(whole(), other)
    assert list(found) == ["fields.npz fem"]
    assert said in found["fields.npz fem"].where
    assert differences(other, other) == []


def test_every_number_and_text_of_the_record_counts():
    other = with_model(results_of(), "fem", nodes=1010, status="diverged")
    found = quantities(results_of(), other)
    assert found["results.json models.fem.nodes"].relative == pytest.approx(10 / 1010)
    assert found["results.json models.fem.status"].where == "finished and diverged"


def test_differences_of_the_scene_are_listed_and_do_not_count():
    scene = whole().scene
    other = replace(whole(), scene=replace(scene, tool=replace(scene.tool, force=0.7)))
    assert differences(whole(), other) == []
    assert other_words(whole(), other) == ["scene: tool.force: 0.5 N -> 0.7 N"]


@pytest.fixture
def folders(tmp_path):
    for name, results in (("a", whole()), ("b", scaled(whole(), 1.01))):
        (tmp_path / name).mkdir()
        write(results, tmp_path / name)
    return tmp_path / "a", tmp_path / "b"


def test_the_command_ends_with_1_where_numbers_differ_by_more_than_the_tolerance(folders, capsys):
    command(folders[0], folders[0])
    assert capsys.readouterr().out == "all numbers are the same\n"
    with pytest.raises(SystemExit) as ended:
        command(*folders)
    assert ended.value.code == 1
    line, last = capsys.readouterr().out.splitlines()
    assert line.startswith(
        "curves.csv displacement_m: differs by up to 1.99e-05, relative 0.0099 (ba"
    )
    assert last == "1 quantities differ by more than 0"
    command(*folders, tolerance=0.01)
    said = capsys.readouterr().out
    assert said == "all numbers agree within 0.01: the largest difference is 0.0099\n"
    with pytest.raises(SystemExit):
        command(*folders, tolerance=0.0098)


@pytest.mark.parametrize("tolerance", [-1.0, math.nan, math.inf])
def test_a_tolerance_that_is_none_is_refused(tolerance, folders):
    with pytest.raises(ValueError, match="--tolerance"):
        command(*folders, tolerance=tolerance)


def test_a_folder_that_is_not_whole_is_not_compared(folders):
    (folders[1] / "curves.csv").write_text("")
    with pytest.raises(ValueError, match=r"curves\.csv, line 1"):
        command(*folders)


# --- several runs, by their errors ---------------------------------------------------------------


def rows_of(*runs):
    return {(row.quantity, row.model): row for row in several.compared(runs)}


def at_tool(model):
    return "largest displacement at tool", model


def test_a_number_that_moves_by_less_than_both_errors_does_not_differ():
    found = rows_of(results_of(), scaled(results_of(), 1.001), results_of())
    row = found[at_tool("Basafa benchmark")]
    # By time steps 0.001 of 2 mm each way.
    assert row.values[0].error == pytest.approx(2e-3, rel=0.01)
    assert row.differs is False


def test_a_number_that_moves_by_more_than_both_errors_differs():
    """Negative control of the test above."""
    found = rows_of(results_of(), results_of(), scaled(results_of(), 1.003))
    assert found[at_tool("Basafa benchmark")].differs is True
    assert found[at_tool("MSM Sugeno")].differs is False


def test_a_number_without_an_error_is_not_judged():
    unknown = with_model(scaled(results_of(), 1.5), "basafa", time_step_errors={})
    assert rows_of(results_of(), unknown)[at_tool("Basafa benchmark")].differs is None


def test_a_run_without_a_model_leaves_a_gap_and_one_that_no_other_has_is_left_out():
    found = rows_of(results_of(), results_of(), results_of(["fem", "basafa"]))
    assert found[at_tool("MSM Sugeno")].values[2] is None
    assert at_tool("MSM Sugeno") not in rows_of(results_of(), results_of(["fem", "basafa"]))


def test_three_folders_make_one_table_with_those_that_differ_first(tmp_path, capsys):
    runs = {"a": whole(), "b": scaled(whole(), 1.2), "c": whole()}
    for name, run in runs.items():
        (tmp_path / name).mkdir()
        write(run, tmp_path / name)
    command(*(tmp_path / name for name in runs), out=tmp_path / "table.csv")
    head, first, *_ = capsys.readouterr().out.splitlines()
    assert head.split()[-4:] == ["a", "b", "c", "verdict"]
    assert first.startswith("largest displacement at tool")
    assert first.endswith("differs")
    table = (tmp_path / "table.csv").read_text().splitlines()
    assert table[0] == "quantity,model,unit,a,a ±,b,b ±,c,c ±,verdict"
    assert any(line.endswith("within errors") for line in table)


def test_a_model_that_is_lost_in_a_run_is_named():
    runs = [whole(), with_model(whole(), "basafa", status="diverged", ended_at_s=0.5)]
    rows = several.compared(runs)
    assert at_tool("Basafa benchmark") not in {(row.quantity, row.model) for row in rows}
    said = several.said(["a", "b"], runs, rows)
    assert said.endswith("Models without results: Basafa benchmark in b (diverged).")
    assert "Without" not in several.said(["a", "a"], [whole(), whole()], rows)


def test_a_report_lays_the_curves_of_all_runs_over_each_other(tmp_path, capsys):
    runs = {"a": whole(), "b": scaled(whole(), 1.2)}
    for name, run in runs.items():
        (tmp_path / name).mkdir()
        write(run, tmp_path / name)
    folders = [tmp_path / name for name in runs]
    for _ in range(2):
        command(*folders, errors=True, out=tmp_path / "a.pdf")
        assert capsys.readouterr().out.endswith(f"report in {tmp_path / 'a.pdf'}\n")
    made = (tmp_path / "a.pdf").read_bytes()
    assert made.startswith(b"%PDF")
    command(*folders, errors=True, out=tmp_path / "b.pdf")
    assert (tmp_path / "b.pdf").read_bytes() == made
    assert several_pdf.several_pdf(["a", "b"], [whole(), whole()], []) != made


def test_every_run_is_a_line_at_its_own_scale(monkeypatch):
    monkeypatch.setattr(canvas, "svg", lambda figure: figure)
    runs = [whole(), scaled(whole(), 1.2), results_of(["basafa"])]
    figure = several_pdf.curves_figure(["a", "b", "c"], runs)
    heights = {
        axes.get_title(loc="left"): [
            float(max(line.get_ydata())) for line in axes.lines if line.get_label() in "abc"
        ]
        for axes in figure.axes
    }
    first = 1e3 * whole().curve("basafa", "tool").displacement.max()
    assert heights["Basafa benchmark"] == pytest.approx([first, 1.2 * first, first])
    assert len(heights["Finite elements"]) == 2


def test_a_page_of_several_runs_asks_for_nothing_and_draws_each(tmp_path, capsys):
    pytest.importorskip("plotly")
    runs = {"a": whole(), "b": scaled(whole(), 1.2)}
    for name, run in runs.items():
        (tmp_path / name).mkdir()
        write(run, tmp_path / name)
    command(*(tmp_path / name for name in runs), errors=True, out=tmp_path / "a.html")
    assert capsys.readouterr().out.endswith(f"page in {tmp_path / 'a.html'}\n")
    text = (tmp_path / "a.html").read_text()
    own = text[: text.index("<noscript>")]
    assert "default-src 'none'" in own
    assert not re.search(r"https?://|url\(", own)
    data = json.loads(re.search(r'id="data">(.*?)</script>', text)[1])
    ends = {(one["name"], one["xaxis"]): max(one["y"]) for one in data["traces"]}
    assert ends["b", "x2"] == pytest.approx(1.2 * ends["a", "x2"], rel=1e-5)
    assert ends["b", "x1"] == ends["a", "x1"]
    assert sum(one["showlegend"] for one in data["traces"]) == 2


def test_out_has_an_ending_that_says_what_it_is(tmp_path):
    with pytest.raises(ValueError, match=r"end it with \.csv for the table, \.pdf or \.html"):
        command(tmp_path, tmp_path, errors=True, out=tmp_path / "table.txt")


def test_out_is_for_the_table_alone(tmp_path):
    with pytest.raises(ValueError, match="--out"):
        command(tmp_path, tmp_path, out=tmp_path / "table.csv")
