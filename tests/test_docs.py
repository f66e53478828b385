"""README and pages: figures are those of the tables, commands and code run as they are shown."""

import csv
import functools
import io
import json
import os
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from rich.console import Console

from docs.figures import figures, tables
from docs.figures.lattice import field_error
from docs.figures.pages import MARK, pages, updated
from study.commands import app
from study.scene.file import read_scene

ROOT = Path(__file__).resolve().parent.parent
QUICK = {"scenes", "check", "estimate", "rules"}
BLOCK = re.compile(r"^```(bash|python|toml)\n(.*?)^```", re.DOTALL | re.MULTILINE)
PATH = re.compile(r"`((?:study|fem_reference|msm|fuzzy|reports|tests|docs)/[\w./-]*)`")
COMMAND = re.compile(r"`liver-study ([a-z]+)([^`]*)`")


PAGES = pages()


def blocks(page, kind):
    return [text for name, text in BLOCK.findall(page.read_text()) if name == kind]


def commands(block):
    """The arguments of each `liver-study` in a block of bash."""
    parts = re.split(r"\n|&&", block)
    words = [shlex.split(part) for part in parts if part.strip()]
    return [found[1:] for found in words if Path(found[0]).name == "liver-study"]


def cases(kind, quick=None):
    found = [
        pytest.param(page, block, id=f"{page.stem}-{i}")
        for page in PAGES
        for i, block in enumerate(blocks(page, kind))
        if quick is None or is_quick(block) == quick
    ]
    assert found
    return found


def is_quick(block):
    given = commands(block)
    return bool(given) and all(arguments[0] in QUICK for arguments in given)


@pytest.fixture(scope="module")
def known():
    return figures()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_figures_are_those_of_the_tables(page, known):
    text = page.read_text()
    assert text == updated(text, known), "stale: python -m docs.figures"


def test_a_wrong_figure_and_an_unknown_one_are_seen(known):
    """Negative control."""
    page = (ROOT / "README.md").read_text()
    wrong = re.sub(r"(<!-- figure: springs-10mm -->)24 %", r"\g<1>23 %", page)
    assert wrong != page
    assert updated(wrong, known) == page
    with pytest.raises(ValueError, match="figure springs-11mm"):
        updated("<!-- figure: springs-11mm -->1 %<!-- -->", known)


def test_a_figure_follows_its_table(monkeypatch):
    """Negative control: another table gives other figures."""
    read = tables.read

    def doubled(path):
        lines = read(path)
        return [line | {"error": str(2 * float(line["error"]))} for line in lines]

    before = dict(field_error())
    monkeypatch.setattr(tables, "read", doubled)
    after = dict(field_error())
    assert before["volume-10mm"] == "4.0 %"
    assert after["volume-10mm"] == "8.0 %"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_mark_is_closed_and_opens_no_line_of_prose(page):
    text = page.read_text()
    assert text.count("<!-- figure:") == len(MARK.findall(text))
    # A comment at the start of a line ends the paragraph in Markdown.
    assert not re.search(r"^ *<!-- figure: [\w.-]+ -->[^\n]", text, re.MULTILINE)


def test_every_figure_is_quoted(known):
    quoted = {name for page in PAGES for _, name, _, _ in MARK.findall(page.read_text())}
    assert quoted == set(known)


def test_the_kept_estimates_are_those_of_the_program():
    """The run itself takes minutes; its estimates do not."""
    done = subprocess.run(
        [sys.executable, "-m", "study", "estimate", "--hcv", "9.5", "--json"],
        capture_output=True,
        text=True,
        check=True,
        cwd=ROOT,
    )
    answers = json.loads(done.stdout)
    kept = {line["model"]: line for line in tables.read("docs/data/liver.csv")}
    for system in ("mamdani", "sugeno", "interval-type-2"):
        found = next(value for key, value in walk(answers) if key == system)
        estimate = found["estimate_pa"] if isinstance(found, dict) else found
        assert float(kept[f"msm-{system}"]["modulus_pa"]) == pytest.approx(estimate, rel=1e-6)


def walk(value):
    if isinstance(value, dict):
        for key, inner in value.items():
            yield key, inner
            yield from walk(inner)


def test_the_kept_run_is_that_of_today():
    """Where the built-in liver has been run here, as CI does first."""
    folder = ROOT / "results" / "liver"
    if not (folder / "errors.csv").exists():
        pytest.skip("no results/liver: run liver-study run first")
    with (folder / "errors.csv").open(newline="") as file:
        errors = {tuple(row[:3]): float(row[3]) for row in list(csv.reader(file))[1:]}
    for line in tables.read("docs/data/liver.csv"):
        key = (line["model"], "fem", "field-relative-l2-peak")
        if line["field_difference"]:
            assert errors[key] == pytest.approx(float(line["field_difference"]), abs=5e-4)


@pytest.fixture(scope="module")
def workbench(tmp_path_factory):
    """A folder per page, which its blocks share, with `liver-study` on the path."""
    programs = tmp_path_factory.mktemp("bin")
    program = programs / "liver-study"
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m study "$@"\n')
    program.chmod(0o755)
    folders = {page: tmp_path_factory.mktemp(page.stem) for page in PAGES}
    for folder in folders.values():
        (folder / ".venv").mkdir()
        (folder / ".venv" / "bin").symlink_to(programs)
    search = f"{programs}{os.pathsep}{os.environ['PATH']}"
    return folders, os.environ | {"PYTHONPATH": str(ROOT), "PATH": search}


@pytest.mark.parametrize(("page", "block"), cases("bash", quick=True))
def test_quick_commands_run_as_shown(page, block, workbench):
    folders, environment = workbench
    done = subprocess.run(
        ["bash", "-e", "-c", block],
        capture_output=True,
        text=True,
        check=False,
        cwd=folders[page],
        env=environment,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()


@pytest.mark.parametrize(("page", "block"), cases("bash", quick=False))
def test_long_commands_are_understood_by_the_command_line(page, block):  # noqa: ARG001 - its id
    given = commands(block)
    assert given
    for arguments in given:
        parse(arguments)


def parse(arguments):
    """Bind the arguments as the program would, without running it."""
    return app.parse_args(arguments, print_error=False, exit_on_error=False)


def test_a_flag_that_is_none_is_seen():
    """Negative control of the parser."""
    with pytest.raises(Exception, match="workerz"):
        parse(["tradeoff", "--workerz", "2"])


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_commands_in_prose_exist_with_their_flags(page):
    for name, rest in COMMAND.findall(page.read_text()):
        shown = help_of(name)
        for flag in re.findall(r"--[a-z-]+", rest):
            assert re.search(rf"{flag}\b", shown), f"{name} has no {flag}"


@functools.cache
def help_of(name):
    assert name in app, f"there is no command {name}"
    shown = io.StringIO()
    app.help_print([name], console=Console(file=shown, width=200))
    return shown.getvalue()


def test_every_command_is_in_the_readme():
    listed = {name for name, _ in COMMAND.findall((ROOT / "README.md").read_text())}
    assert listed >= {name for name in app if not name.startswith("-")}


@pytest.mark.parametrize(("page", "block"), cases("python"))
def test_python_runs_as_shown(page, block, workbench):
    folders, environment = workbench
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", block],
        capture_output=True,
        text=True,
        check=False,
        cwd=folders[page],
        env=environment,
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(("page", "block"), cases("toml"))
def test_scenes_shown_are_read(page, block, tmp_path):  # noqa: ARG001 - its id
    path = tmp_path / "scene.toml"
    path.write_text(block)
    assert read_scene(str(path)).title == tomllib.loads(block)["title"]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_paths_and_links_lead_somewhere(page):
    text = page.read_text()
    missing = [path for path in PATH.findall(text) if not (ROOT / path).exists()]
    links = [link.split("#")[0] for link in re.findall(r"\]\((?!https?://)([^)#]+)", text)]
    missing += [link for link in links if not (page.parent / link).exists()]
    assert not missing


def test_the_readme_is_an_entrance():
    assert len((ROOT / "README.md").read_text().splitlines()) < 180


def test_versions_agree():
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text()
    assert f"\n## [{version}]" in (ROOT / "CHANGELOG.md").read_text()
