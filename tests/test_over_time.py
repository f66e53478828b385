"""The history of benchmarks: every figure is there, as a ratio, under commits; none is of times."""

import json
import re
from pathlib import Path

import pytest

from tests.benchmarks.over_time.__main__ import without_folders
from tests.benchmarks.over_time.benchmarks import calibration, figures

RESULTS = Path(figures.__file__).parents[1] / "results"
FEWEST = 12


def tracked():
    """Names of the figures, as asv has them."""
    found = {f"figures.{name}" for name in vars(figures) if name.startswith("track_")}
    for name, kind in vars(figures).items():
        if isinstance(kind, type) and kind.__module__ == figures.__name__:
            found |= {f"figures.{name}.{one}" for one in vars(kind) if one.startswith("track_")}
    return found


def stored():
    return [json.loads(path.read_text()) for path in RESULTS.glob("*/*-*.json")]


def numbers(results):
    """Figures of a commit by name, all values of its parameters."""
    return {name: line[0] for name, line in results["results"].items()}


def test_the_figures_that_matter_are_tracked():
    parameters = {"Lattice": 3, "Fuzzy": 3}
    counts = [parameters.get(name.split(".")[1], 1) for name in tracked()]
    assert sum(counts) >= FEWEST


def test_the_history_holds_every_figure_of_some_commit():
    assert set().union(*(numbers(one) for one in stored())) == tracked()
    for one in stored():
        assert len(one["commit_hash"]) == 40
        assert all(value > 0.0 for found in numbers(one).values() for value in found)


def test_the_history_names_no_folder():
    """asv names an environment by its interpreter's path, in a file's name and in the file."""
    for one in stored():
        names = {one["env_name"], one["python"], one["params"]["python"]}
        assert len(names) == 1
        assert re.fullmatch(r"python3\.\d+\.\d+", names.pop())
    assert not [path for path in RESULTS.rglob("*.json") if "existing" in path.name]


def test_figures_measured_again_join_the_others(tmp_path):
    """As of `-b`, from a file as asv writes it."""
    for name, value in (("a", 1.0), ("b", 2.0), ("a", 3.0)):
        path = tmp_path / "2a49c0d6-existing-py_folder_python.json"
        parts = {
            "env_name": "x",
            "python": "/folder/python",
            "params": {"python": "/folder/python"},
        }
        path.write_text(json.dumps({**parts, "results": {name: [[value]]}}))
        without_folders(path)
    (kept,) = tmp_path.iterdir()
    assert json.loads(kept.read_text())["results"] == {"a": [[3.0]], "b": [[2.0]]}
    assert "folder" not in kept.name + kept.read_text()


class Clock:
    """A clock that tasks put forward."""

    def __init__(self):
        self.now = 0.0

    def by(self, seconds):
        def task():
            self.now += seconds

        return task


@pytest.mark.parametrize("seconds", [1e-4, 3.0])
def test_a_figure_is_the_ratio_to_the_loop(monkeypatch, seconds):
    clock = Clock()
    monkeypatch.setattr(calibration, "processor", lambda: clock.now)
    monkeypatch.setattr(calibration, "calibration", clock.by(0.5))
    assert calibration.times_calibration(clock.by(seconds)) == pytest.approx(seconds / 0.5)


def test_a_disturbed_turn_does_not_count(monkeypatch):
    clock, taken = Clock(), iter([2.0, 2.0, 9.0, 2.0, 5.0, 2.0, 2.0, 2.0])
    monkeypatch.setattr(calibration, "processor", lambda: clock.now)
    monkeypatch.setattr(calibration, "calibration", clock.by(1.0))

    def task():
        clock.by(next(taken))()

    assert calibration.times_calibration(task) == pytest.approx(2.0)
