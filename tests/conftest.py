"""Shared fixtures: the small block that most tests run, built once."""

from __future__ import annotations

import os
import signal
import sys
import warnings
from dataclasses import dataclass

# Two BLAS threads spin against each other on small factors; must be set before numpy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pytest

from study.__main__ import main
from study.problem.problem import Problem
from study.run.study import run_study
from study.scene import Scene
from study.scene.file import read_scene
from study.scene.problem import problem_of
from study.system import signals
from tests.kept_results import ROOT, as_good_as_now

SMALL = (
    'organ.size=["60 mm", "40 mm", "30 mm"]',
    "tool.radius=15 mm",
    "tool.force=0.05 N",
    "reference.element_size=12 mm",
    "time.samples=101",
    "reference.steps_per_sample=2",
)


def pytest_addoption(parser):
    parser.addoption(
        "--update-scores",
        action="store_true",
        help="rewrite tests/data/scores.json from this run; review the difference",
    )


@pytest.fixture(autouse=True, scope="session")
def _heeding_signals():
    """Tests and their children heed what a shell lets its background jobs ignore, and nohup."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


@pytest.fixture(autouse=True, scope="session")
def _store_of_their_own(tmp_path_factory):
    """Tests and their children neither read nor fill the store of whoever runs them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("LIVER_STUDY_STORE", str(tmp_path_factory.mktemp("store")))
        yield


@dataclass(frozen=True)
class Ended:
    returncode: int
    stdout: str
    stderr: str


@pytest.fixture
def typed(monkeypatch, capsys, tmp_path):
    """The program on words typed in an empty folder, without starting another Python."""

    def enter(*words):
        monkeypatch.setattr(sys, "argv", ["liver-study", *map(str, words)])
        code = 0
        with warnings.catch_warnings():
            # Our words are where the program looks for them; the library expects arguments.
            warnings.filterwarnings("ignore", message="Cyclopts application invoked without tokens")
            try:
                main()
            except SystemExit as left:
                code = left.code or 0
        return Ended(code, *capsys.readouterr())

    handlers = {number: signal.getsignal(number) for number in signals.numbers()}
    monkeypatch.setattr(sys, "unraisablehook", sys.unraisablehook)
    monkeypatch.chdir(tmp_path)
    yield enter
    for number, handler in handlers.items():
        signal.signal(number, handler)


@pytest.fixture(scope="session")
def small_scene() -> Scene:
    return read_scene("block", SMALL)


@pytest.fixture(scope="session")
def small_posed(small_scene) -> Problem:
    return problem_of(small_scene)


@pytest.fixture(scope="session")
def small_results(small_scene):
    return run_study(small_scene)


@pytest.fixture(scope="session")
def paper_scene() -> Scene:
    return read_scene("paper")


@pytest.fixture(scope="session")
def paper_results(paper_scene):
    return run_study(paper_scene)


@pytest.fixture(scope="session")
def liver_scene() -> Scene:
    return read_scene("liver")


@pytest.fixture(scope="session")
def liver_results(liver_scene):
    """Those that `liver-study run` has just left, or a run of its own."""
    kept = as_good_as_now(ROOT / "results" / "liver", liver_scene)
    return run_study(liver_scene) if kept is None else kept


@pytest.fixture
def rng():
    return np.random.default_rng(2026)
