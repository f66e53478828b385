"""Settings of the pages: `sphinx-build -W docs build/docs` builds them, without a network."""

import ast
import importlib
import pkgutil
import shutil
import sys
import tomllib
from pathlib import Path

from sphinx.application import Sphinx

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))

from reports.cut_figure import cut_figure  # noqa: E402 - once the path leads there
from reports.page.answer import answer  # noqa: E402 - as above
from study.results import Results  # noqa: E402 - as above

PROJECT = tomllib.loads((HERE.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]
FACES = {
    "study.problem": "The problem",
    "study.models": "Models",
    "fem_reference": "Finite-element reference",
    "msm": "Mass-spring models",
    "fuzzy": "Fuzzy systems",
    "study.similarity": "Similarity",
    "study.results": "Results",
}
"""Packages whose interface has a page each, with their titles."""
SITE = "site"
"""Folder of files that the site takes as they are."""
REPORTS = ("report.pdf", "report.html")
RESULTS = sorted(path for path in (HERE.parent / "results").glob("*") if path.is_dir())
FINISHED = [path for path in RESULTS if all((path / name).is_file() for name in REPORTS)]
"""Results of this clone that have both reports, which a page shows; there need be none."""

project = PROJECT["name"]
author = PROJECT["authors"][0]["name"]
copyright = author  # noqa: A001 - Sphinx reads it by this name
release = PROJECT["version"]

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
default_role = "code"  # docstrings quote code with single backticks
myst_heading_anchors = 3

html_theme = "furo"
html_title = f"{project} {release}"
html_copy_source = False
html_show_copyright = False
html_extra_path = [f"generated/{SITE}"] if FINISHED else []

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
autodoc_type_aliases = {name: name for name in ("Floats", "Ints")}  # arrays of float64, of int64
napoleon_google_docstring = False
suppress_warnings = ["ref.python"]  # a short name in an annotation may stand in two packages


def modules(name: str) -> list[str]:
    """What shows the interface of a package: itself if it lists names, else its modules."""
    package = importlib.import_module(name)
    if hasattr(package, "__all__"):
        return [name]
    found = (module.name for module in pkgutil.iter_modules(package.__path__))
    return [f"{name}.{module}" for module in found if not module.startswith("_")]


def api_page(name: str, title: str) -> str:
    """The page of a package, whose text is that of its docstrings."""
    parts = [f"# {title}\n"]
    for module in modules(name):
        if module != name:
            parts.append(f"## `{module}`\n")
        parts += [
            "```{eval-rst}",
            f".. automodule:: {module}",
            "   :members:",
            *(["   :imported-members:"] if module == name else []),
            "```\n",
        ]
    return "\n".join(parts)


def example_page(scripts: list[Path]) -> str:
    """The page of the programs in gallery/, each under the sentence it opens with."""
    parts = ["# Short programs\n"]
    for script in scripts:
        sentence = ast.get_docstring(ast.parse(script.read_text(encoding="utf-8")))
        parts += [f"## {script.stem.replace('_', ' ').capitalize()}\n", f"{sentence}\n"]
        parts += [f"```{{literalinclude}} ../gallery/{script.name}", ":language: python", "```\n"]
    return "\n".join(parts)


def finished_page(runs: list[Path], folder: Path) -> str:
    """The page of finished reports, which are copied into a folder of the site with a picture."""
    parts = [
        "# Finished reports\n",
        "As the commands left them, to look at before a run of your own.\n",
    ]
    for run in runs:
        at = folder / "finished" / run.name
        at.mkdir(parents=True)
        for name in REPORTS:
            shutil.copyfile(run / name, at / name)
        results = Results.load(run)
        parts += [f"## {results.record.title or run.name}\n", f"`liver-study run {run.name}`\n"]
        parts += ["\n\n".join(answer(results).sentences) + "\n"]
        links = " · ".join(
            f'<a href="../finished/{run.name}/{name}">{name}</a>' for name in REPORTS
        )
        if (drawn := cut_figure(results)) is not None:
            (at / "cut.svg").write_bytes(drawn)
            picture = f"../finished/{run.name}/cut.svg"
            links += f'<br><img src="{picture}" alt="A cut through the tool in each model">'
        parts += [f"<p>{links}</p>\n"]
    return "\n".join(parts)


def write_pages(folder: Path) -> None:
    """Write a page for every package of FACES that there is, of short programs, and of reports."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for name, title in FACES.items():
        if (HERE.parent / name.replace(".", "/")).is_dir():
            (folder / f"{name}.md").write_text(api_page(name, title), encoding="utf-8")
    scripts = sorted((HERE / "gallery").glob("*.py"))
    if scripts:
        (folder / "examples.md").write_text(example_page(scripts), encoding="utf-8")
    if FINISHED:
        text = finished_page(FINISHED, folder / SITE)
        (folder / "reports.md").write_text(text, encoding="utf-8")


write_pages(HERE / "generated")


def plain_text(
    _app: object, _what: str, _name: str, _obj: object, _options: object, lines: list[str]
) -> None:
    """Let the signs of formulas stand for themselves, and show indented lines as they are.

    Docstrings are written to be read in the source: |x| and a * b are no markup there. From the
    first section of numpydoc on, indentation has its meaning.
    """
    end = next((i - 1 for i, line in enumerate(lines) if line.startswith("---")), len(lines))
    text: list[str] = []
    for i, line in enumerate(lines):
        before = next((old for old in reversed(text) if old.strip()), "")
        formula = i < end and _indent(line) > 0 and not before.startswith("- ")
        if formula and not _indent(before):
            text += ["", "::", ""]
        elif i < end and line.strip() and _indent(before) and not _indent(line):
            text.append("")
        text.append(line if formula else _escaped(line))
    lines[:] = text


def _escaped(line: str) -> str:
    """Outside backticks a bar or a star is itself."""
    parts = line.split("`")
    parts[::2] = [part.replace("|", r"\|").replace("*", r"\*") for part in parts[::2]]
    return "`".join(parts)


def _indent(line: str) -> int:
    return len(line) - len(line.lstrip())


def setup(app: Sphinx) -> None:
    """Read docstrings as the text that they are, before numpydoc's sections are looked for."""
    app.connect("autodoc-process-docstring", plain_text, priority=400)
