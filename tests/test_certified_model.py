"""The certified error in a scene: run, results, report, and frame by frame."""

import csv
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from fem_reference.certified import Bound
from fem_reference.subspace import ritz_subspace, superposition
from reports import report
from reports.certified import _bounds, certified_rows
from reports.digits import DASH
from study.models import certified as summary
from study.models import superposition as model
from study.models.model import SILENT
from study.results.folder import read, write
from study.run.study import run_study
from study.scene.file import read_scene
from study.scene.problem import problem_of
from tests.conftest import SMALL

DATA = Path(__file__).parents[1] / "reports" / "data"
LIGHT = (
    *('models=["superposition"]', "superposition.count=4", "superposition.certificate=40"),
    *('damping={kind="rayleigh", mass="20 s^-1", stiffness="1e-4 s"}', "time.samples=41"),
)


@pytest.fixture(scope="module")
def scene():
    return read_scene("block", (*SMALL, *LIGHT))


@pytest.fixture(scope="module")
def found(scene):
    return run_study(scene)


def prepared(scene, **settings):
    one = next(iter(model.models(scene, {})))
    return replace(one, **settings).prepare(problem_of(scene))


def test_the_bound_of_a_run_holds_against_many_more_vectors(scene, found):
    ready = prepared(scene)
    seen, body = ready.problem.observation, ready.body
    rich = ritz_subspace(body, 90)
    steps = ready._steps_per_sample()
    times = np.linspace(0.0, seen.times[-1], steps * (len(seen.times) - 1) + 1)
    own, _ = superposition(ready.subspace, ready.model.damping, ready.problem.factor, times)
    nearly, _ = superposition(rich, ready.model.damping, ready.problem.factor, times)
    off = (nearly @ rich.vectors.T - own @ ready.subspace.vectors.T)[::steps]
    probes = model.evaluation(body, seen.probes).toarray()
    true = np.linalg.norm(np.einsum("pn,tnd->tpd", probes, off.reshape(len(off), -1, 3)), axis=2)
    bounds = np.reshape(
        [row.displacement_bound_m for row in found.certified], (-1, len(seen.times))
    ).T
    assert (bounds >= true).all()
    assert bounds[:, 0].max() < 20.0 * true[:, 0].max()


def test_the_record_sums_the_bound_up(found):
    certified = found.model("superposition").elements.certified
    assert certified.vectors == 40
    assert 0.0 < certified.rounding < 1e-5 < certified.energy < 0.2
    assert 0.0 < certified.rest < 1e-6
    for probe in found.record.probes:
        rows = [row for row in found.certified if row.probe == probe]
        assert rows[0].displacement_bound_m == 0.0
        largest = max(row.displacement_bound_m for row in rows)
        assert certified.largest_m[probe] == pytest.approx(largest, rel=1e-10)
    assert certified.displacement["tool"] < 0.5


class Planted:
    """A motion whose bounds are known after each step; the largest energy is between samples."""

    energies, norms = (0.0, 5.0, 1.0, 2.0, 3.0), (0.0, 1.0, 4.0, 8.0, 2.0)

    def __init__(self, _given, _damping, _factor, step):
        self.taken, self.step = 0, step

    def take_step(self):
        self.taken += 1

    @property
    def bound(self):
        return Bound(self.energies[self.taken], self.taken * self.step * np.array([1e-3, 2e-3]))

    @property
    def energy_norm(self):
        return self.norms[self.taken]


def test_the_record_is_that_of_planted_bounds(monkeypatch):
    """Of curves over time, of the energy at any step, and of the largest of either."""
    monkeypatch.setattr(summary, "CertifiedMotion", Planted)
    seen = SimpleNamespace(times=np.array([0.0, 0.2, 0.4]))
    problem = SimpleNamespace(observation=seen, factor=None, probes=("tool", "far"))
    given = SimpleNamespace(squares=np.ones(7), error_at_rest=0.01, rounding=0.02)
    curves = np.array([[[0.0, 0.0, 0.0]] * 2, [[3.0, 0.0, 0.0]] * 2, [[0.0, 0.0, 4.0]] * 2])
    record, bounds = summary.certified(given, None, problem, 2, curves)
    assert bounds == pytest.approx(np.outer([0.0, 0.2, 0.4], [1e-3, 2e-3]))
    assert (record.vectors, record.rest, record.rounding) == (7, 0.01, 0.02)
    assert record.energy == pytest.approx(5.0 / 8.0)
    share = np.hypot(0.2, 0.4) * 1e-3 / 5.0
    assert record.displacement == pytest.approx({"tool": share, "far": 2.0 * share})
    assert record.largest_m == pytest.approx({"tool": 4e-4, "far": 8e-4})


def test_what_stays_where_it_is_has_a_bound_in_metres_but_no_relative_one(monkeypatch):
    """Neither a point that never moves, nor a motion without any energy."""
    monkeypatch.setattr(summary, "CertifiedMotion", Planted)
    monkeypatch.setattr(Planted, "norms", (0.0,) * 5)
    seen = SimpleNamespace(times=np.array([0.0, 0.2, 0.4]))
    problem = SimpleNamespace(observation=seen, factor=None, probes=("tool", "far"))
    given = SimpleNamespace(squares=np.ones(7), error_at_rest=0.01, rounding=0.02)
    curves = np.zeros((3, 2, 3))
    curves[1:, 0, 0] = 3.0, 4.0
    record, _ = summary.certified(given, None, problem, 2, curves)
    assert record.displacement == {
        "tool": pytest.approx(np.hypot(0.2, 0.4) * 1e-3 / 5.0),
        "far": None,
    }
    assert record.largest_m == pytest.approx({"tool": 4e-4, "far": 8e-4})
    assert record.energy is None
    printed = _bounds(record, "far")
    assert printed[0] == printed[2] == DASH
    assert printed[1] == "0.80"


def test_results_keep_it_and_the_report_prints_it_apart(found, tmp_path):
    write(found, tmp_path)
    again = read(tmp_path)
    assert [row[:2] for row in again.certified] == [row[:2] for row in found.certified]
    (tool, *_) = certified_rows(again)
    assert tool[:2] == ["Superposition", "tool"]
    error = found.model("superposition").time_step_errors["tool"].displacement
    assert tool[6].endswith("%")
    assert error < 0.05
    assert report.pdf(again)


def test_a_bound_is_printed_no_smaller_than_it_is(found):
    certified = found.model("superposition").elements.certified
    for row in certified_rows(found):
        assert float(row[2].split()[0]) >= 100.0 * certified.displacement[row[1]]
        assert float(row[4].split()[0]) >= 100.0 * certified.energy


def test_without_a_certificate_nothing_is_certified(scene):
    ready = prepared(scene, certificate=0)
    assert ready._certified(np.zeros((41, 2, 3)), SILENT) == (None, ())
    assert len(ready.describe()) == 1
    assert ready.stepper().bound is None


def test_where_the_memory_holds_no_factors_a_note_says_so(scene, monkeypatch):
    monkeypatch.setattr(model, "factors_fit", lambda *_: False)
    bound, notes = prepared(scene)._certified(np.zeros((41, 2, 3)), SILENT)
    assert bound is None
    assert "certified by 40 vectors" in prepared(scene).describe()[1]
    assert "not certified: the memory holds no factors" in notes[0]


def test_each_frame_has_its_bound_and_none_is_computed_unasked(scene, monkeypatch):
    ready, built = prepared(scene), []
    whole = model.certificate
    monkeypatch.setattr(model, "certificate", lambda *given: built.append(1) or whole(*given))
    stepper = ready.stepper()
    bounds = []
    for n in range(30):
        stepper.take_step()
        if n % 3 == 2:
            bounds.append(stepper.bound())
        assert bool(built) == (n >= 2)
    again = ready.stepper()
    for _ in range(30):
        again.take_step()
    assert again.bound() == pytest.approx(bounds[-1], rel=1e-12)
    assert np.shape(bounds) == (10, 2)
    assert np.min(bounds) > 0.0


def test_the_committed_table_has_no_bound_below_its_error():
    with (DATA / "certified.csv").open(encoding="utf-8") as file:
        lines = [
            {key: float(text) for key, text in line.items() if key not in ("damping", "load")}
            for line in csv.DictReader(file)
        ]
    assert len(lines) == 72
    for line in lines:
        assert line["bound"] >= line["error"] - line["error_change"]
        assert line["bound_at_tool"] >= line["error_at_tool"] - line["error_change"]
    light = [line for line in lines if line["mass_per_s"] == 32.0 and line["certificate"] == 128.0]
    nearest = sorted(line["bound"] / line["error"] for line in light)
    assert nearest[0] < 1.3
