"""`tradeoff` and `recommend` of scenes with tools that are moved, gravity and several loads."""

from __future__ import annotations

import csv
from dataclasses import replace

import numpy as np
import pytest

from study.commands import EXIT_BAD_INPUT
from study.run.scene_problem import scene_arguments, scene_problem
from study.scene.file import read_scene
from study.sweep.runner import Backend, Outcome
from study.sweep.store import Store
from study.sweep.task import Task
from study.system.progress import Silent
from study.tradeoff import study as study_module
from study.tradeoff import table
from study.tradeoff.candidates import Candidate
from study.tradeoff.comparison import FINEST, is_finest, lattices, truth_of
from study.tradeoff.contenders import Configuration, configurations
from study.tradeoff.errors import Errors, errors
from study.tradeoff.observation import Observed
from study.tradeoff.prediction import Prediction, predictions
from study.tradeoff.problem import plain, sampled
from study.tradeoff.recommendation import Recommended, lines
from study.tradeoff.reference import ReferenceSolution
from study.tradeoff.table import Cost
from study.tradeoff.timing import Timing
from tests.test_tradeoff import command  # noqa: F401 - a fixture

PRESSED = (
    'organ.size=["60 mm", "60 mm", "40 mm"]',
    'models=["tissue"]',
    "lattice.spacing=20 mm",
    "reference.element_size=20 mm",
    "tissue.poisson_ratio=0.25",
    "tool.shape=sphere",
    "tool.radius=20 mm",
    "tool.displacement=4 mm",
    "tool.history.ramp=0.2 s",
    "tool.history.hold=0.1 s",
    "tool.history.release=0.1 s",
    "time.duration=0.4 s",
    "time.samples=33",
)
OVERRIDES = [word for override in PRESSED for word in ("--set", override)]
SPACING = 0.02
LOADED = (*PRESSED, "gravity.acceleration=9.81 m/s^2", "gravity.given=loaded")


def of(times, **more):
    return Configuration(
        "springs", {"spacing": times * SPACING, "volume_term": False, "step_fraction": 0.8} | more
    )


@pytest.fixture(scope="module")
def scene():
    return sampled(read_scene("block", PRESSED))


@pytest.fixture(scope="module")
def given(scene):
    return scene_problem(**scene_arguments(scene))


def test_samples_show_the_force_and_frames_divide_them(scene):
    """The scene's own 12.5 ms, a quarter of what scenes of one load have."""
    assert scene.time.duration / (scene.time.samples - 1) == pytest.approx(0.0125)


def test_contenders_are_those_that_can_follow(scene):
    entered = configurations(scene)
    assert {one.contender for one in entered} == {
        *("springs", "single-precision", "step-sizes", "integrators", "basafa"),
    }
    integrators = {one.settings.get("integrator") for one in entered} - {None}
    assert integrators == {"split-volume"}
    hung = sampled(read_scene("block", LOADED))
    assert "single-precision" not in {one.contender for one in configurations(hung)}
    with pytest.raises(ValueError, match="contender superposition: its steps do not follow rigid"):
        configurations(scene, ["superposition"])


def test_a_lattice_is_compared_with_a_finer_one_of_the_same_springs(scene):
    found = lattices(scene, [of(1.0), of(1.0, precision="single"), of(2.0)])
    assert list(found) == [("tissue", False)]
    (members,) = found.values()
    assert [one.settings["spacing"] / SPACING for one in members] == [FINEST, 2.0 * FINEST]
    assert is_finest(scene, members[0])
    assert not is_finest(scene, of(1.0))


def run_of(given, times, **values):
    """The outcome of a run whose field, curves and force are so many times those of a planted."""
    problem = given.problem
    shape = len(problem.observation.times), len(problem.rigid_tools), 3
    force = np.linspace(0.0, 1.0, shape[0])[:, None, None] * problem.rigid_tools[0].axis
    field = np.ones((len(problem.observation.volume_points), 3))
    curves = np.ones((shape[0], len(problem.probes), 3))
    whole = {"ended_at_s": None, "inverted_cells": 0, "margin": None, "step_s": 1e-3}
    seen = {"field": plain(times * field), "curves": plain(times * curves)}
    value = vars(Observed(**whole | seen | {"force": plain(times * force)} | values))
    return Outcome(Task("study.tradeoff.observation:observe", {}), "done", value, "", 0.0)


def test_the_own_error_of_the_finest_lattice_is_what_halving_the_spacing_changed(given):
    """Of planted motions 1 + 3 h, whose limit is 1, and which are off it by 3 h / (1 + 3 h)."""
    coarse, fine = 1.0 + 3.0 * SPACING, 1.0 + 3.0 * FINEST * SPACING
    found = truth_of([run_of(given, fine), run_of(given, coarse)], given)
    own = pytest.approx(3.0 * FINEST * SPACING / fine)
    assert (found.field_error, found.force_errors[0], found.peak_errors[0]) == (own, own, own)
    assert found.curve_errors == pytest.approx(found.field_error)
    lost = run_of(given, 1.0, field=None, ended_at_s=0.1)
    with pytest.raises(ValueError, match=r"did not reach the end.*reduce the displacement"):
        truth_of([run_of(given, 1.0), lost], given)


@pytest.mark.parametrize(("away", "status"), [(0.019, "not resolved"), (0.021, "resolved")])
def test_a_configuration_is_judged_by_the_force(given, away, status):
    exact = truth_of([run_of(given, 1.0)] * 2, given)
    known = replace(exact, force_errors=np.array([0.02]), peak_errors=np.array([0.02]))
    found = errors(run_of(given, 1.0 + away), known, given)
    assert (found.of_force, found.status) == (True, status)
    assert found.field == pytest.approx(away)
    expected = pytest.approx(away) if status == "resolved" else None
    assert (found.force, found.peak_force, found.judged) == (expected,) * 3


@pytest.fixture(scope="module")
def found(scene, tmp_path_factory):
    chosen = [of(2.0), of(1.5), of(1.0), of(FINEST)]
    store = Store(tmp_path_factory.mktemp("runs"))
    return study_module.study(scene, chosen, store, Backend(), 1, Silent())


def test_force_errors_fall_with_the_spacing_and_stand_in_the_table(found, scene, tmp_path):
    coarse, _, _, finest = found.entries
    assert coarse.errors.force > coarse.force_bar > 0.1
    assert coarse.errors.force == coarse.errors.discretisation
    assert (finest.errors.status, finest.errors.discretisation) == ("not resolved", None)
    with study_module.place(tmp_path / "out") as folder:
        study_module.write(found, scene, 1, folder)
    with (tmp_path / "out" / study_module.TABLE).open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == table.COLUMNS
    assert float(rows[0]["force_error"]) == pytest.approx(coarse.errors.force, rel=1e-3)
    assert float(rows[0]["force_error_bar"]) == pytest.approx(coarse.force_bar, rel=1e-3)
    assert '"reference": null' in (tmp_path / "out" / study_module.RECORD).read_text()
    assert "finest lattice of the same springs, 10 mm" in found.comparison.words


def test_a_prediction_is_the_measured_error_and_that_of_the_finest_lattice(found):
    (truth,) = found.comparison.finest.values()
    tried = [of(2.0), of(1.0), of(FINEST)]
    outcomes = [run_of(found.comparison.given, 1.0) for _ in tried]
    exact = replace(truth, force=np.reshape(outcomes[0].value["force"], truth.force.shape))
    comparison = replace(found.comparison, finest={("tissue", False): exact})
    outcomes[0] = run_of(found.comparison.given, 1.3)
    outcomes[1] = run_of(found.comparison.given, 1.0, field=None, ended_at_s=0.1)
    expected = predictions(comparison, tried, outcomes, [])
    assert list(expected) == [2.0 * SPACING, FINEST * SPACING]
    assert expected[2.0 * SPACING].error == pytest.approx(0.3)
    assert expected[2.0 * SPACING].bar == truth.force_bar > 0.0
    assert expected[FINEST * SPACING].error == 0.0


def test_steps_are_timed_where_the_tool_is_deepest(given):
    stepper = of(1.0).model(given.scene).prepare(given.problem).stepper()
    stepper.restart()
    deep = stepper.displacement()
    assert np.abs(deep).max() > 2e-3  # of the nodes, which the tip lies between
    stepper.take_step()
    stepper.restart()
    assert np.array_equal(stepper.displacement(), deep)


def test_the_reference_judges_where_the_scene_names_it(given):
    """Its own error then is of the force too, and the finest lattice is told beside it."""
    scene = replace(given.scene, models=("fem", "tissue"))
    assert study_module.has_reference(scene)
    assert not study_module.has_reference(given.scene)
    exact = truth_of([run_of(given, 1.0)] * 2, given)
    truth = replace(exact, force_errors=np.array([0.03]), peak_errors=np.array([0.03]))
    finest = truth_of([run_of(given, 1.1)] * 2, given)
    comparison = study_module.Comparison(given, truth, None, {("tissue", False): finest})
    found = comparison.errors(of(1.0), run_of(given, 1.2))
    assert found.force == pytest.approx(0.2)
    assert found.discretisation == pytest.approx(0.1 / 1.1)
    assert isinstance(comparison.truth(of(1.0)), ReferenceSolution)
    assert comparison.words == "the scene's finite elements"


def test_what_is_recommended_says_what_its_errors_are_of_and_against():
    cost = Cost(3, 0.0, 1e-3, Timing(np.full((1, 4), 1e-5), None))
    measured = Errors(
        "resolved", field=0.1, force=0.2, peak_force=0.3, discretisation=0.2, of_force=True
    )
    chosen = Candidate(of(1.0), Prediction(0.2, 0.05), cost, None)
    found = Recommended(chosen, True, measured, None, 0.01, (chosen,), "a finer one")
    text = "\n".join(lines(found))
    assert "force error expected 20.0 +- 5.0 %, measured 20.0 %, as expected" in text
    assert "errors are against a finer one" in text
    assert "other measured errors: of the largest force 30.0 %, of the displacement over" in text
    assert "finest lattice" not in text
    other = replace(found, measured=replace(measured, discretisation=0.4))
    assert "the finest lattice of the same springs 40.0 %" in "\n".join(lines(other))


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("recommend", "--error", "1 mm"), "that of their force; give a share"),
        (("recommend", "--rate", "60", "--known-place"), "--known-place: what"),
        (("tradeoff", "--contender", "finite-elements"), "choose from springs"),
    ],
)
def test_what_does_not_apply_is_refused(command, words, told, tmp_path):  # noqa: F811
    code, said = command(words[0], "block", *OVERRIDES, *words[1:])
    assert code == EXIT_BAD_INPUT
    assert told in said
    assert list(tmp_path.iterdir()) == []


def test_several_loads_and_gravity_are_judged_by_the_reference(tmp_path):
    """As a load alone, with finite elements stepped and timed too."""
    more = (
        'organ.size=["60 mm", "40 mm", "30 mm"]',
        "tool.radius=15 mm",
        "tool.force=0.05 N",
        "reference.element_size=12 mm",
        "gravity.acceleration=9.81 m/s^2",
        "gravity.towards=inferior",
        'weight=[{place={side="superior", at=[0.5, 0.5]}, mass="5 g", radius="15 mm"}]',
        'models=["fem", "tissue"]',
        "time.duration=1 s",
    )
    scene = sampled(read_scene("block", more))
    elements = Configuration("finite-elements", {"element": "p1", "level": -1, "rate": 60.0})
    springs = Configuration(
        "volume-springs", {"spacing": 0.01, "volume_term": True, "step_fraction": 0.8}
    )
    store = Store(tmp_path / "runs")
    found = study_module.study(scene, [elements, springs], store, Backend(), 1, Silent())
    assert [one.errors.status for one in found.entries] == ["resolved"] * 2
    assert [one.errors.of_force for one in found.entries] == [False] * 2
    assert found.comparison.reference is not None
    assert "superposition" not in {one.contender for one in configurations(scene)}
    prepared = elements.model(scene).prepare(found.comparison.given.problem)
    stepper, seen = prepared.stepper(), found.comparison.given.problem.observation
    start = prepared.simulate().trajectory.displacement[0]
    from fem_reference.observation import evaluation

    assert evaluation(prepared.body(), seen.probes) @ stepper.displacement() == pytest.approx(start)
