"""Letters that the documents' own fonts lack are taken from further fonts, or told of."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import pytest

from reports import canvas, letters, report
from reports.letters import boxes, without_shape
from reports.motion_figures import motion_figures
from reports.several_pdf import TEMPLATE
from tests.report_samples import results_of

DEJAVU = Path(mpl.get_data_path()) / "fonts" / "ttf"
"""Fonts that are always there, with letters that typst's own lack."""
TIFINAGH = "ⵜⴰⵙⴰ"
"""Liver in Berber: DejaVu Sans has its letters, none of typst's fonts does."""


def content(title: str) -> dict[str, object]:
    """A small document by its title."""
    return {
        "title": title,
        "names": [title],
        "header": ["quantity", "model", "unit", title, "verdict"],
        "rows": [],
        "left_out": 0,
        "said": "",
        "alternative": "",
    }


def made(title: str) -> bytes:
    return report.compile_pdf(content(title), {"curves": []}, TEMPLATE)


@pytest.fixture
def no_fonts(monkeypatch):
    monkeypatch.setattr(letters, "PACKAGES", ("no_such_fonts",))


@pytest.fixture
def fonts(monkeypatch, tmp_path):
    """One further font, as if it were installed."""
    (tmp_path / "DejaVuSans.ttf").write_bytes((DEJAVU / "DejaVuSans.ttf").read_bytes())
    monkeypatch.setattr(letters, "extra_fonts", lambda: [tmp_path])
    monkeypatch.setattr(report, "extra_fonts", lambda: [tmp_path])


@pytest.mark.usefixtures("no_fonts")
def test_letters_without_a_font_are_listed_by_script_with_the_remedy(capsys):
    assert b"pdfuaid:part" not in made(f"a {TIFINAGH} b")
    told = capsys.readouterr().err
    assert "Boxes replace letters that no available font has (3 of Tifinagh)" in told
    assert letters.REMEDY in told


@pytest.mark.usefixtures("fonts")
def test_letters_of_a_further_font_are_printed_and_the_document_is_tagged(capsys):
    assert b"pdfuaid:part" in made(f"a {TIFINAGH} b")
    assert capsys.readouterr().err == ""


@pytest.mark.usefixtures("no_fonts")
def test_a_document_that_does_without_has_the_same_bytes_where_more_fonts_are(request):
    plain = made("Leber κ, ½, ≥")
    request.getfixturevalue("fonts")
    assert made("Leber κ, ½, ≥") == plain


def test_the_note_names_scripts_and_is_in_letters_that_every_font_has():
    said = boxes("肝臓كبد🫀")
    assert "(3 of Arabic, 2 of CJK, 1 of U+1FAC0)" in said
    assert said.isascii()
    assert boxes("") == ""


def test_every_letter_without_a_shape_is_found_one_after_the_other():
    has = set("aκ臓")
    found = without_shape("aκ肝臓🫀肝", lambda left: next((c for c in left if c not in has), None))
    assert sorted(found) == sorted("肝🫀")


def test_a_figure_is_drawn_again_in_further_fonts_only_where_its_own_lack_a_letter(monkeypatch):
    asked = []
    monkeypatch.setattr(canvas, "more_families", lambda: asked.append(1) or ["STIXSizeOneSym"])
    plain = next(motion_figures(results_of(["basafa"], probes=["tool"])))
    assert asked == []
    assert next(motion_figures(results_of(["basafa"], probes=["tool 肝臓"]))) != plain
    assert asked == [1]


@pytest.mark.usefixtures("fonts")
def test_fonts_are_made_known_to_matplotlib():
    assert canvas.more_families() == ["DejaVu Sans"]
