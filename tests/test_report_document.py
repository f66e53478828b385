"""A report is made of whatever a results folder holds, and twice the same."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import zlib
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import typst
from matplotlib.text import Text

from reports import canvas, motion_figures, renders, report
from reports.appearance import LOOKS, looks, other_look
from reports.content import document
from reports.field_figures import views
from reports.ranking import leads
from reports.tables import lead_rows
from study.commands.report import report as report_command
from study.results import Results, ResultsError
from study.results.folder import write
from study.results.records import SCHEMA_VERSION
from study.stages.job_pool import available, job_pool
from study.stages.threads import threads
from study.system import folders
from tests.report_samples import (
    FUZZY,
    LABELS,
    MODELS,
    TITLE,
    beforehand_pdf,
    known,
    results_of,
    whole,
    with_elements,
    with_model,
    with_record,
    without_arrays,
)

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(autouse=True)
def _quick(monkeypatch):
    """Pictures by matplotlib, as VTK has its own tests."""
    monkeypatch.setattr(renders, "WINDOWS", ())


def test_plots_are_the_same_bytes_in_one_process_or_two(monkeypatch):
    results = results_of()
    monkeypatch.setattr(report, "available", lambda: 2)
    two = report._plots(results)
    monkeypatch.setattr(report, "available", lambda: 1)
    assert report._plots(results) == two
    assert {"motion", "sets", "rules"} <= two.keys()


def test_plots_take_no_more_processors_than_a_run_may_use(monkeypatch):
    counts = []

    def counted(count, progress):
        counts.append(count)
        return job_pool(1, progress)

    monkeypatch.setattr(report, "available", lambda: 2)
    monkeypatch.setattr(report, "job_pool", counted)
    monkeypatch.setattr(report, "_drawings", lambda _: [])
    for count in (1, 2):
        with threads(count):
            report._plots(results_of())
    report._plots(results_of())
    assert counts == [1, min(2, available()), 2]


def kept(folder: Path) -> bytes:
    """The report of whole results in a folder."""
    folder.mkdir()
    write(whole(), folder)
    report.make_report(folder)
    return (folder / "report.pdf").read_bytes()


def test_a_second_report_is_the_same_byte_by_byte(tmp_path):
    first = kept(tmp_path / "a")
    report.make_report(tmp_path / "a")
    assert first.startswith(b"%PDF")
    assert (tmp_path / "a" / "report.pdf").read_bytes() == first


def test_another_process_makes_the_same_bytes(tmp_path):
    first = kept(tmp_path / "a")
    code = "import sys, pathlib; from reports import renders; renders.WINDOWS = (); "
    code += "from reports.report import make_report; make_report(pathlib.Path(sys.argv[1]))"
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "a")], check=True, cwd=ROOT)
    assert (tmp_path / "a" / "report.pdf").read_bytes() == first


def test_other_numbers_make_other_bytes():
    """Negative control of the two tests above."""
    results = without_arrays()
    fuzzy = results.record.fuzzy
    sugeno = replace(fuzzy.systems["sugeno"], estimate_pa=1.01 * 12e3)
    fuzzy = replace(fuzzy, systems=fuzzy.systems | {"sugeno": sugeno})
    other = with_record(results, fuzzy=fuzzy)
    assert report.pdf(results) != report.pdf(other)


def test_the_report_is_tagged_and_a_figure_without_a_text_is_refused(monkeypatch):
    """PDF/UA-1 asks for more than is looked at here; typst refuses what it can see lack."""
    results = without_arrays()
    made = report.pdf(results)
    assert b"pdfuaid:part>1<" in made
    sound = report.template
    bare = sound().replace(b", alt: data.alternatives.at(place).at(i)", b"")
    assert bare != sound()
    monkeypatch.setattr(
        report, "template", lambda name: bare if name == report.TEMPLATE else sound(name)
    )
    with pytest.raises(typst.TypstError, match="alt"):
        report.pdf(results)


SCRIPTS = {0.7 * 9.0, 0.5 * 9.0}
"""Sizes [point] of sub- and superscripts of an equation in the text, and of theirs."""


def sizes(made: bytes) -> set[float]:
    """Sizes [point] of all text of a document that typst made, but for that in figures."""
    found: set[float] = set()
    for stream in re.finditer(rb"stream\r?\n(.*?)\r?\nendstream", made, re.DOTALL):
        with suppress(zlib.error):
            text = zlib.decompress(stream[1])
            found |= {float(size) for size in re.findall(rb"/\w+ ([\d.]+) Tf", text)}
    return found


def test_no_text_is_below_8_point_but_scripts_of_equations():
    """Negative control: a running text of 7.6 point is found."""
    found = sizes(report.pdf(without_arrays()))
    assert {8.0, 9.5} <= found
    assert all(size >= 8.0 or any(abs(size - one) < 0.01 for one in SCRIPTS) for size in found)
    assert min(sizes(beforehand_pdf())) >= 8.0
    small = typst.compile(b"#set text(size: 7.6pt)\nsmall")
    assert sizes(small) == {7.6}


def test_no_text_of_a_figure_is_below_8_point(monkeypatch):
    """Figures are printed as large as they are drawn."""
    seen: list[float] = []
    sound = canvas.svg

    def measured(figure):
        seen.extend(text.get_fontsize() for text in figure.findobj(Text) if text.get_text())
        return sound(figure)

    monkeypatch.setattr(canvas, "svg", measured)
    monkeypatch.setattr(report, "available", lambda: 1)
    report.draw(results_of())
    assert len(seen) > 50
    assert min(seen) >= canvas.TEXT_SIZE


def test_every_figure_that_is_drawn_has_a_text_of_its_own():
    results = results_of(probes=[f"point-{i}" for i in range(5)])
    figures, _ = report.draw(replace(results, fuzzy={}))
    texts = document(results)["alternatives"]
    for place, drawn in figures.items():
        assert len(texts[place]) >= len(drawn), place
    assert len(set(texts["motion"])) == len(figures["motion"]) == 2
    assert "Finite elements 0.997 mm" in texts["first"][0]


def test_a_folder_without_results_is_refused(tmp_path):
    with pytest.raises(ResultsError, match="no results here"):
        report.make_report(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_results_of_an_older_schema_are_refused_with_their_version_and_the_remedy(tmp_path):
    old = {"schema_version": 1, "title": TITLE, "stiffness": {}, "models": []}
    (tmp_path / "results.json").write_text(json.dumps(old))
    said = f"results of schema 1, this program reads {SCHEMA_VERSION}; run the scene again"
    with pytest.raises(ResultsError, match=said):
        report_command(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["results.json"]


def test_a_report_that_fails_leaves_the_earlier_one(tmp_path, monkeypatch):
    folder = tmp_path / "a"
    first = kept(folder)
    names = sorted(path.name for path in folder.iterdir())
    sound = report.template
    monkeypatch.setattr(report, "template", lambda name: sound(name) + b"\nSee @nowhere.\n")
    with pytest.raises(typst.TypstError, match="nowhere"):
        report.make_report(folder)
    assert (folder / "report.pdf").read_bytes() == first
    assert sorted(path.name for path in folder.iterdir()) == names


def test_a_folder_that_cannot_be_written_is_said_so(tmp_path, monkeypatch):
    (tmp_path / "a").mkdir()
    write(whole(), tmp_path / "a")
    monkeypatch.setattr(folders.os, "access", lambda *_: False)
    monkeypatch.setattr(report, "draw", lambda _: pytest.fail("drawn though it cannot be written"))
    with pytest.raises(ResultsError, match="a may not be written"):
        report.make_report(tmp_path / "a")


@pytest.mark.parametrize("models", [["fem"], ["basafa"], ["fem", "basafa"], FUZZY, FUZZY[:1]])
def test_models_may_be_missing(models):
    assert report.pdf(without_arrays(results_of(models)))


@pytest.mark.parametrize("models", [["fem"], ["basafa", "msm-sugeno"]])
def test_fields_of_some_models_are_drawn(models):
    assert report.pdf(replace(results_of(models), fuzzy={}))


def test_what_only_some_scenes_have_may_be_missing():
    results = without_arrays(with_elements(mesh_error=None))
    nothing = {"time_step_s": None, "critical_time_step_s": None, "steps": None, "wall_s": None}
    for name in MODELS:
        results = with_model(results, name, time_step_errors={}, **nothing)
    results = with_record(results, lattice_limits=None, dimensionless=None)
    results = with_record(results, checks=(), notes=(), assumptions=())
    assert report.pdf(results)


@pytest.mark.parametrize(("count", "left_out"), [(1, 0), (4, 2)])
def test_control_points_may_be_few_or_many(count, left_out, monkeypatch):
    monkeypatch.setattr(motion_figures, "PROBES_PER_FIGURE", 1)
    monkeypatch.setattr(motion_figures, "MOST_PROBES", 2)
    results = without_arrays(results_of(probes=[f"point-{i}" for i in range(count)]))
    assert report.pdf(results)
    assert document(results)["probes_left_out"] == left_out


def test_names_and_titles_are_inert_whatever_they_hold():
    """Typst's and matplotlib's markup, scripts without a glyph, a word longer than the page."""
    nasty = '#import "x" $ * _ @nowhere <b> & \\frac{ $x_{ 肝臓 \x07 --> ' + 400 * "w"
    results = with_record(results_of(probes=[nasty], title=nasty), warnings=(nasty,))
    assert report.pdf(replace(results, fuzzy={}))


def diverged(late: bool) -> Results:
    """One fuzzy model diverged, before the peak or after it."""
    name, found = "msm-mamdani", results_of()
    found = with_model(
        found, name, status="diverged", ended_at_s=0.31, ended_near_m=(0.0, 0.0, 0.01)
    )
    found = with_model(found, name, time_step_errors={})
    found = with_record(found, warnings=(f"{name} diverged at 0.31 s",))
    field = found.fields[name].copy()
    field[1 if late else 0 :] = np.nan
    scores = tuple(row for row in found.scores if row.model != name)
    return replace(
        found,
        curves=tuple(
            row._replace(displacement_m=1e9 * row.displacement_m) if row.model == name else row
            for row in found.curves
            if row.model != name or row.time_s < 0.31
        ),
        scores=scores,
        **known(scores),
        field_differences=tuple(row for row in found.field_differences if row.model != name),
        fields=found.fields | {name: field},
        fuzzy={},
    )


@pytest.mark.parametrize("late", [False, True])
def test_a_model_that_diverged_is_shown_so_and_has_no_score(late):
    results = diverged(late)
    assert report.pdf(results)
    content = document(results)
    rows = {row[0]: row for row in content["models"]}
    assert rows["MSM Mamdani"][-1] == "diverged at 0.310 s"
    assert rows["MSM Sugeno"][-1] == "finished"
    assert any("diverged" in text for text in content["warnings"])
    scored = {row[0] for t in content["similarity"] for g in t["groups"] for row in g["rows"]}
    assert "MSM Sugeno" in scored
    assert "MSM Mamdani" not in scored


def test_no_curve_at_all_still_makes_a_report():
    bare = replace(results_of(), fields={}, curves=(), bands=(), scores=(), field_differences=())
    assert report.pdf(bare)


def test_a_number_that_is_not_finite_is_refused():
    results = without_arrays()
    first, *others = results.scores
    results = replace(results, scores=(first._replace(score=float("nan")), *others))
    with pytest.raises(ValueError, match="nan is not a number that a report can print"):
        report.pdf(results)
    with pytest.raises(ValueError, match="not JSON compliant"):
        report.compile_pdf(document(results_of()) | {"drawing": float("inf")}, {})


def test_the_document_holds_the_numbers_of_the_run():
    content = document(results_of())
    assert content["title"] == TITLE
    assert [row[0] for row in content["glance"]["rows"]] == LABELS
    assert [row[0] for row in content["models"]] == LABELS
    said = " ".join(content["summary"])
    assert "12.00 to 14.00 kPa, 1.20 to 1.40 times the reference modulus of 10 kPa" in said
    assert "does not contain the reference modulus" in said
    assert "its largest strain is 4.0 %, below the limit of 5.0 %" in said


def test_a_larger_strain_is_said_to_be_too_large():
    results = with_model(results_of(), "fem", largest_strain=0.06)
    assert "6.0 %, not below the limit of 5.0 %" in " ".join(document(results)["summary"])


TOY = "toy"


def with_toy(results: Results, **changes) -> Results:
    """A model that the report knows nothing of, otherwise as Sugeno's, and scored as it."""
    sugeno = results.model("msm-sugeno")
    toy = replace(sugeno, name=TOY, label="Toy model", **changes)
    like = {
        table: (
            *(rows := getattr(results, table)),
            *(row._replace(model=TOY) for row in rows if row.model == sugeno.name),
        )
        for table in ("curves", "scores", "field_differences")
    }
    fields = results.fields | {TOY: results.fields[sugeno.name]}
    results = with_record(results, models=(*results.record.models, toy))
    return replace(results, fields=fields, fuzzy={}, **like, **known(like["scores"]))


def test_a_model_that_the_report_does_not_know_is_legible_everywhere():
    """Under its label and in a look of its own."""
    results = with_toy(results_of(), system=None)
    content, seen = document(results), looks(results)
    for rows in (content["glance"]["rows"], content["models"], content["numerics"]):
        assert [row[0] for row in rows] == [*LABELS, "Toy model"]
    assert ["Finite elements", "Toy model"] in [row[:2] for row in content["errors"]]
    scored = {row[0] for t in content["similarity"] for g in t["groups"] for row in g["rows"]}
    assert "Toy model" in scored
    assert any("Toy model 40 %" in sentence for sentence in content["summary"])
    assert not any(TOY in sentence for sentence in content["summary"])
    others = [look for name, look in seen.items() if name != TOY]
    assert seen[TOY].colour not in {look.colour for look in others}
    assert "Toy model" in [one.look.label for one in motion_figures.motions(results, "tool")]
    assert "Toy model − finite elements" in [one.title for one in views(results).sheets[1].panels]
    assert report.pdf(results)


def test_a_model_that_the_report_does_not_know_is_ranked_where_it_has_a_fuzzy_system():
    """It scores as Sugeno's, which was the highest, so no lead is left."""
    ranked = next(leads(with_toy(results_of()), "fem", "tool"))
    assert (ranked.best, ranked.runner_up, ranked.margin) == (TOY, "msm-sugeno", 0.0)
    assert "Toy model" in lead_rows(with_toy(results_of()))[0]
    benchmark = next(leads(with_toy(results_of(), system=None), "fem", "tool"))
    assert benchmark.best == "msm-sugeno"


def test_models_that_the_report_does_not_know_differ_from_each_other():
    seen = [other_look(k) for k in range(20)]
    assert len({(look.colour, look.dashes) for look in seen}) == 20
    assert len({look.colour for look in seen[:5]}) == 5
    assert not {look.colour for look in seen} & {look.colour for look in LOOKS.values()}
