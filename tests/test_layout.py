"""The repository is laid out as the README says, and CI runs what the README says."""

import importlib
import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("study", "fem_reference", "msm", "fuzzy", "reports")
TOP_LEVEL = {
    *PACKAGES,
    "tests",
    "pyproject.toml",
    "README.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "CITATION.cff",
    "LICENSE",
    "MANIFEST.in",
    "docs",
    "requirements.lock",
}


def readme_commands():
    """The two commands of the README's first code block."""
    block = re.search(r"```bash\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    return [line for line in block[1].splitlines() if line.strip()]


def test_ci_runs_the_commands_of_the_readme_word_for_word():
    ci = (ROOT / ".ci/run").read_text().splitlines()
    commands = readme_commands()
    assert len(commands) == 2
    for command in commands:
        assert command in ci


def test_hooks_before_a_commit_are_checks_of_ci():
    ci = (ROOT / ".ci/run").read_text().splitlines()
    hooks = re.findall(r"entry: (.+)", (ROOT / ".pre-commit-config.yaml").read_text())
    assert len(hooks) == 4
    assert {f".venv/bin/{hook}" for hook in hooks} <= set(ci)


@pytest.mark.parametrize("package", PACKAGES)
def test_packages_are_those_of_this_repository(package):
    """Unrelated published packages bear some of these names."""
    assert Path(importlib.import_module(package).__file__).is_relative_to(ROOT)


def test_top_level_holds_what_is_named_and_nothing_else():
    if shutil.which("git") is None:
        pytest.skip("no git")
    listed = subprocess.run(
        ["git", "ls-files"], capture_output=True, text=True, check=False, cwd=ROOT
    ).stdout.split()
    top = {path.split("/")[0] for path in listed}
    if not top:
        pytest.skip("not a git checkout")
    assert {name for name in top if not name.startswith(".")} == TOP_LEVEL


def test_every_dependency_is_pinned_in_the_lock_file():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = ("workers", "test", "docs")
    wanted = project["dependencies"] + [
        line for extra in extras for line in project["optional-dependencies"][extra]
    ]
    names = {re.match(r"[A-Za-z0-9_-]+", line)[0].lower().replace("_", "-") for line in wanted}
    names.remove(project["name"])  # test takes in the extras that tests need
    locked = set(re.findall(r"^([a-z0-9._-]+)==", (ROOT / "requirements.lock").read_text(), re.M))
    assert names <= {name.replace("_", "-") for name in locked}


def test_the_tests_are_not_installed():
    include = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    assert not any(name.startswith("tests") for name in include["packages"]["find"]["include"])
