"""Write report.html: the template filled with text, what is to be drawn, and plotly's program.

Nothing in it asks the network: the page forbids that to itself by its content security policy.
"""

from __future__ import annotations

import html as markup
import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from string import Template

from reports import summary, tradeoff, tradeoff_answers
from reports.digits import Table, symbols, unbroken, words
from reports.page.answer import Answer, answer, question
from reports.page.data import page
from reports.tables import provenance_rows
from study.results import Results, ResultsError
from study.results.folder import read
from study.scene.file import write_scene
from study.system.folders import FolderError, check_file, write_bytes

NAME = "report.html"
MISSING = "plotly is not installed, which draws report.html: pip install 'plotly>=6'"


def is_drawable() -> bool:
    """Whether plotly is there to draw the page."""
    return find_spec("plotly") is not None


def make_page(folder: Path) -> None:
    """Write report.html into a results folder.

    Raises ResultsError for a folder without results or with some that are not whole, or one that
    cannot be written, or where plotly is missing.
    """
    if not is_drawable():
        raise ResultsError(MISSING)
    results = read(folder)
    try:
        check_file(folder / NAME)
    except FolderError as error:
        raise ResultsError(str(error).replace("--out ", "")) from None
    write_bytes(folder / NAME, page_of(results))


def page_of(results: Results) -> bytes:
    """The page of results in memory; the same results and plotly give the same bytes."""
    title = markup.escape(words(results.record.title or "Untitled scene"))
    text = Template(part("page.html")).substitute(
        _written(results),
        head=head(title),
        title=title,
        organ=part("organ.js"),
        program=part("page.js"),
        data=_data(results),
        plotly=plotly(),
    )
    return text.encode()


def part(name: str) -> str:
    """Text of a file of the page's own."""
    return resources.files("reports.page").joinpath(name).read_text(encoding="utf-8")


def head(title: str) -> str:
    """The start of a page up to its body: it forbids requests. The title is escaped already."""
    return Template(part("head.html")).substitute(title=title, style=part("page.css"))


def plotly() -> str:
    """Plotly's whole program as its package ships it; no smaller bundle of it is on PyPI."""
    file = resources.files("plotly").joinpath("package_data", "plotly.min.js")
    return file.read_text(encoding="utf-8").replace("</script", "<\\/script")


def _data(results: Results) -> str:
    """What is drawn, as JSON."""
    return inert(asdict(page(results)))


def inert(content: object) -> str:
    """Content as JSON that closes no element of a page."""
    text = json.dumps(content, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


# --- what is written in words --------------------------------------------------------------------


def _written(results: Results) -> Mapping[str, str]:
    """Parts of the page that are read without its program."""
    found = answer(results)
    return {
        "question": markup.escape(question(results)),
        "answer": _paragraphs(found.sentences),
        "numbers": _numbers(found),
        "warnings": _warnings(results),
        "glance": _glance(results),
        "summary": _items(summary.sentences(results)),
        "tradeoff": _items(tradeoff_answers.sentences(tradeoff.configurations())),
        "scene": markup.escape(write_scene(results.scene)),
        "provenance": _provenance(results),
        "notes": _items(words(text) for text in results.record.notes),
        "assumptions": _items(words(symbols(text)) for text in results.record.assumptions),
    }


def _glance(results: Results) -> str:
    header, rows = summary.glance_table(results)
    return table(
        header, rows, "Overview of the models (MSM: mass-spring model; FE: finite elements)"
    )


def _provenance(results: Results) -> str:
    made = table(("item", "value"), provenance_rows(results), "Provenance")
    return made.replace("<table>", '<table class="text">')


def _paragraphs(lines: Iterable[str]) -> str:
    return "\n".join(f"<p>{_text(line)}</p>" for line in lines)


def _items(lines: Iterable[str]) -> str:
    found = "\n".join(f"<li>{_text(line)}</li>" for line in lines)
    return f"<ul>\n{found}\n</ul>" if found else "<p>None.</p>"


def _text(line: str) -> str:
    """Text of an element, whose numbers stay with their units."""
    return markup.escape(unbroken(line))


def _numbers(found: Answer) -> str:
    return "\n".join(
        f'<div class="number"><dt>{markup.escape(one.name)}</dt>'
        f"<dd><strong>{markup.escape(one.value)}</strong> "
        f"<small>{markup.escape(one.error)}</small></dd></div>"
        for one in found.numbers
    )


def _warnings(results: Results) -> str:
    lines = [words(text) for text in results.record.warnings]
    if not lines:
        checks = "and every check of the run passed"
        return f"<p>No warning, {checks if results.record.checks else 'but no check either'}.</p>"
    return f'<div class="warnings" role="note">{_items(lines)}</div>'


def table(header: Iterable[str], rows: Table, caption: str) -> str:
    """A table whose first column names its rows."""
    head = "".join(f'<th scope="col">{markup.escape(cell)}</th>' for cell in header)
    body = "\n".join(f"<tr>{_row(row)}</tr>" for row in rows)
    return (
        f'<div class="wide"><table><caption>{markup.escape(caption)}</caption>'
        f"<thead><tr>{head}</tr></thead><tbody>\n{body}\n</tbody></table></div>"
    )


def _row(row: list[str]) -> str:
    first, *others = row
    cells = "".join(f"<td>{_text(cell)}</td>" for cell in others)
    return f'<th scope="row">{markup.escape(first)}</th>{cells}'
