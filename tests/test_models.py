"""The models there are: what each promises, how scenes name them, what studies ask of them."""

import dataclasses
from pathlib import Path
from typing import get_args, get_type_hints

import numpy as np
import pytest

from msm.integrators import INTEGRATORS
from study.annotation.choice import Choice
from study.known.stability.cases import user_scene
from study.models import tissue
from study.models.estimates import estimates
from study.models.finite_elements import PreparedElements
from study.models.lattice import LatticeModel
from study.models.model import SILENT, ModelKind, Watch
from study.models.persistence import Persistence
from study.models.table import MODELS, kind, model, models_of, references
from study.problem.history import HISTORIES
from study.run import study as running
from study.run.study import run_study
from study.scene import Patient, Scene
from study.scene.file import SceneError, read_scene, resolved, validate
from study.scene.problem import problem_of
from study.similarity.fields import relative_l2
from study.sweep.runner import Backend
from study.sweep.store import Store
from study.tradeoff import study as study_module
from study.tradeoff.candidates import Candidate
from study.tradeoff.contenders import Configuration
from study.tradeoff.prediction import Prediction
from study.tradeoff.problem import sampled
from study.tradeoff.recommendation import Recommended, recommended_scene
from study.tradeoff.table import Cost
from study.tradeoff.timing import Timing
from tests.conftest import SMALL

ROOT = Path(__file__).resolve().parent.parent
UNTUNED = [name for name in MODELS if not kind(name).is_tuned]
HELD = (*SMALL, 'tool.history={kind="step"}', "time.duration=40 s", "time.samples=17")


def changed(scene, table, **keys):
    """The scene with keys of one of its tables replaced."""
    return dataclasses.replace(scene, **{table: dataclasses.replace(getattr(scene, table), **keys)})


# --- the table -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", MODELS)
def test_every_entry_is_a_kind_that_says_what_it_assumes(name, small_scene):
    found = kind(name)
    assert isinstance(found, ModelKind)
    sentences = found.assumptions(small_scene)
    assert sentences
    assert all(text[0].isupper() and text.endswith((".", ")")) for text in sentences)


def test_all_models_of_a_scene_have_names_of_their_own(small_scene):
    every = dataclasses.replace(small_scene, models=tuple(reversed(MODELS)))
    found = list(models_of(every, estimates(every)))
    assert len({one.name for one in found}) == len({one.label for one in found}) == len(found)
    assert len(found) == len(UNTUNED) + len(every.fuzzy.systems)
    assert [one.name for one in found if one.name in MODELS] == UNTUNED  # in the table's order
    assert references(every) == ["fem", "hyperelastic", "basafa"]


def test_a_point_takes_any_kind_that_has_a_form_for_it(monkeypatch):
    monkeypatch.setitem(MODELS, "mine", MODELS["basafa"])
    assert read_scene("paper", ['models=["mine"]']).models == ("mine",)


def test_a_model_that_no_code_runs_is_refused_with_those_there_are():
    """It was once a name that the scene knew and nothing ran."""
    with pytest.raises(SceneError, match=r"models.*'rods'") as refusal:
        read_scene("block", ['models=["fem", "rods"]'])
    assert all(repr(name) in str(refusal.value) for name in MODELS)
    with pytest.raises(ValueError, match="there are fem, hyperelastic, basafa"):
        kind("rods")


@pytest.mark.parametrize("command", ["check", "run"])
def test_so_it_is_by_the_commands_with_exit_code_2(command, typed, tmp_path):
    done = typed(command, "block", "--set", 'models=["fem", "rods"]')
    assert done.returncode == 2
    assert all(repr(name) in done.stderr for name in MODELS)
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.iterdir())


# --- what a model promises ------------------------------------------------------------------------


@pytest.fixture(scope="module", params=UNTUNED)
def one(request, small_scene):
    return model(small_scene, request.param)


@pytest.fixture(scope="module")
def prepared(one, small_posed):
    return one.prepare(small_posed)


@pytest.fixture(scope="module")
def motion(prepared):
    """Its own, simulated once for all who look at it."""
    return prepared.simulate()


def test_a_model_states_what_it_would_run(prepared):
    lines = prepared.describe()
    assert lines
    assert all(line.strip() for line in lines)
    assert prepared.critical_time_step > 0.0


def test_a_motion_is_whole_starts_from_rest_and_comes_out_again(prepared, motion, small_posed):
    found, again = motion, prepared.simulate()
    run, seen = found.trajectory, small_posed.observation
    assert run.status == "finished"
    assert run.displacement.shape == run.velocity.shape == (len(seen.times), len(seen.probes), 3)
    assert run.volume_field.shape == (len(seen.frames), len(seen.volume_points), 3)
    assert run.surface_field.shape == (len(seen.frames), len(seen.surface_points), 3)
    for name in ("displacement", "velocity", "volume_field", "surface_field"):
        assert np.isfinite(getattr(run, name)).all()
        np.testing.assert_array_equal(getattr(run, name), getattr(again.trajectory, name))
    assert not run.displacement[0].any()
    assert run.displacement[:, small_posed.tool_probe, 2].min() < -1e-5
    assert 0.0 < found.step <= seen.times[1]
    assert found.margin > 1.0


def test_equal_steps_divide_a_sample_and_are_no_longer_than_asked(prepared, motion, small_posed):
    interval = float(small_posed.observation.times[1])
    longest = 0.37 * min(prepared.critical_time_step, interval)
    found = prepared.simulate(longest)
    count = interval / found.step
    assert found.step <= longest * (1 + 1e-9)
    assert count == pytest.approx(round(count), rel=1e-9)
    own = motion.trajectory.displacement
    apart = np.abs(found.trajectory.displacement - own).max() / np.abs(own).max()
    assert apart < 0.02


@pytest.mark.parametrize("name", UNTUNED)
def test_a_load_held_for_long_ends_at_rest(name):
    """Under a load so small that the linearised rest is the rest."""
    scene = read_scene("block", (*HELD, "tool.force=0.1 mN"))
    problem = problem_of(scene)
    ready = model(scene, name).prepare(problem)
    rest, weights = ready.rest(), problem.volume_rule.weights
    assert rest.shape == (len(problem.observation.volume_points), 3)
    end = ready.simulate().trajectory.volume_field[-1]
    assert relative_l2(end, rest, weights) < 2e-3
    assert relative_l2(1.01 * end, rest, weights) > 5e-3


def test_a_stepper_starts_at_rest_and_steps_the_same_again(prepared):
    def moved():
        ready = prepared.stepper()
        assert ready.step > 0.0
        assert ready.unknowns > 0
        assert ready.displacement().shape[1:] == (3,)
        assert not ready.displacement().any()
        for _ in range(40):
            ready.take_step()
        return ready, ready.displacement().copy()

    (ready, found), (_, again) = moved(), moved()
    assert np.isfinite(found).all()
    assert np.abs(found).max() > 1e-9
    np.testing.assert_array_equal(found, again)
    if ready.take_bare_steps is not None:
        ready.restart()
        assert not ready.displacement().any()
        ready.take_bare_steps(40)
        scale = np.abs(found).max()
        np.testing.assert_allclose(ready.displacement(), found, rtol=0.0, atol=1e-12 * scale)


def test_a_run_is_the_simulation_with_its_record(one, motion, small_posed):
    found = one.prepare(small_posed).run(SILENT)
    record = found.record
    assert (record.name, record.label, record.status) == (one.name, one.label, "finished")
    assert record.small_strain_modulus_pa > 0.0
    assert record.time_step_errors.keys() == set(small_posed.probes)
    assert record.time_step_error.displacement < 0.01
    assert found.checks
    assert all(check.passed for check in found.checks)
    np.testing.assert_array_equal(found.trajectory.displacement, motion.trajectory.displacement)


# --- models in a study ----------------------------------------------------------------------------


def test_the_tissue_lattice_runs_without_patient_and_without_estimates(small_scene, monkeypatch):
    def refused(_):
        raise AssertionError("nothing asks for an estimate")

    monkeypatch.setattr(running, "run_fuzzy", refused)
    scene = dataclasses.replace(small_scene, patient=Patient(), models=("tissue", "fem"))
    found = run_study(scene)
    assert [one.name for one in found.record.models] == ["fem", "tissue"]
    assert found.record.fuzzy.systems == found.fuzzy == {}
    assert found.record.lattice_limits is None
    modulus = found.model("tissue").small_strain_modulus_pa
    assert modulus == scene.tissue.youngs_modulus
    assert {(row.model, row.reference) for row in found.scores} == {("tissue", "fem")}
    with pytest.raises(AssertionError, match="nothing asks"):
        run_study(dataclasses.replace(small_scene, models=("msm",)))


def test_all_models_are_set_up_before_any_of_them_runs(small_scene, monkeypatch):
    """A lattice that is refused would otherwise be so after minutes of finite elements."""
    monkeypatch.setattr(PreparedElements, "run", lambda *_: pytest.fail("it ran"))
    scene = changed(small_scene, "lattice", spacing=0.5)
    scene = dataclasses.replace(scene, models=("fem", "tissue"))
    with pytest.raises(ValueError, match=r"lattice\.spacing"):
        run_study(scene)


def test_the_tissue_lattice_is_the_tuned_one_at_the_tissue_s_modulus(small_scene, small_posed):
    every = estimates(small_scene)
    found = every["mamdani"]
    same = dataclasses.replace(found, estimate=small_scene.tissue.youngs_modulus)
    (tuned,) = kind("msm").models(small_scene, {"mamdani": same})
    a, b = (
        one.prepare(small_posed).simulate().trajectory.displacement
        for one in (tuned, model(small_scene, "tissue"))
    )
    np.testing.assert_array_equal(a, b)


def test_a_recommended_scene_gives_the_error_that_was_measured(tmp_path):
    """Of the lattice against the finite elements; the studies look at the field at other points."""
    scene = read_scene("block", (*SMALL, 'models=["fem"]', "reference.element_size=10 mm"))
    spacing = 0.0125
    settings = {"spacing": spacing, "volume_term": True, "step_fraction": 0.8}
    chosen = Configuration("volume-springs", settings)
    judge, (outcome,) = study_module.judged(
        sampled(scene), [chosen], Store(tmp_path / "runs"), Backend()
    )
    known, measured = judge.reference, judge.errors(chosen, outcome)
    assert measured.status == "resolved"

    cost = Cost(3, 0.0, 1e-3, Timing(np.full((1, 4), 1e-5), None))
    prediction = Prediction(measured.field, known.field_error)
    candidate = Candidate(chosen, prediction, cost, None)
    found = Recommended(candidate, True, measured, None, 0.01)
    path = tmp_path / "advised.toml"
    path.write_text(recommended_scene(scene, found), encoding="utf-8")

    advised = read_scene(str(path))
    assert advised.models == ("fem", "tissue")
    again = tissue_error(advised)
    assert abs(again - measured.field) < known.field_error
    assert again == pytest.approx(measured.field, rel=0.05)
    plain = dataclasses.replace(advised, lattice=scene.lattice)  # without what was advised
    assert tissue_error(plain) > 1.3 * measured.field


def tissue_error(scene):
    """Of the field at the peak, of the tissue's lattice against the finite elements."""
    (value,) = [
        row.value
        for row in run_study(scene).field_differences
        if row[:3] == ("tissue", "fem", "field-relative-l2-peak")
    ]
    return value


WAVE = ('tool.history={kind="sinusoid", frequency="1 Hz"}', "time.duration=2 s")


def test_a_model_that_keeps_no_fields_says_so_where_they_are_wanted(small_scene, tmp_path):
    ready = model(small_scene, "superposition").prepare(problem_of(small_scene))
    wanted = Watch(SILENT.progress, Persistence(tmp_path, fields=tmp_path))
    (note,) = ready.run(wanted).notes
    assert "superposition" in note
    assert not ready.run(SILENT).notes


def test_a_superposition_beyond_small_strain_is_warned_about():
    words = ('models=["superposition"]', "superposition.count=2", "time.samples=33")
    for force, warned in (("0.01 N", False), ("1 N", True)):
        found = run_study(read_scene("block", (*SMALL, *words, f"tool.force={force}")))
        texts = [text for text in found.record.warnings if "superposition, which is linear" in text]
        assert bool(texts) is warned


def test_a_superposition_in_a_scene_has_record_scores_and_an_error_by_steps():
    words = ('models=["fem", "superposition"]', "superposition.count=6")
    scene = read_scene("block", (*SMALL, *WAVE, "time.samples=33", *words))
    found = run_study(scene)
    record = found.model("superposition")
    assert record.elements.method == "ritz"
    assert record.elements.subspace_vectors == 6
    assert record.elements.unknowns == found.model("fem").elements.unknowns
    assert record.largest_strain == pytest.approx(found.model("fem").largest_strain, rel=0.05)
    scored = [row for row in found.scores if row.model == "superposition"]
    assert len(scored) == 2 * 7  # control points and measures
    assert {row.reference for row in scored} == {"fem"}
    (peak,) = [row for row in found.field_differences if row.quantity == "field-relative-l2-peak"]
    assert 0.0 < peak.value < 0.02
    assert any("6 load-dependent Ritz vectors" in text for text in found.record.assumptions)

    ready = model(scene, "superposition").prepare(problem_of(scene))
    own, exact = (ready.simulate(step).trajectory.displacement for step in (None, 1e-3))
    for i, probe in enumerate(found.record.probes):
        true = np.linalg.norm(own[:, i] - exact[:, i]) / np.linalg.norm(exact[:, i])
        assert true > 1e-4
        assert record.time_step_errors[probe].displacement == pytest.approx(true, rel=0.4)


# --- the stability of a scene's own models --------------------------------------------------------

SHORT = (*SMALL, "time.duration=1 s", "time.samples=17", 'tool.history={kind="step"}')
STIFFER = "lattice.law={strain=[-0.5, 0, 0.5], relative_tension=[-2, 0, 2]}"


def own(function, *overrides, **more):
    """What a case of the scene with these overrides finds."""
    scene = read_scene("block", (*SHORT, *overrides))
    return getattr(user_scene, function)("tissue", resolved(scene), None, **more)


def test_the_critical_step_that_is_tried_is_that_of_the_scene_s_law_and_integrator():
    soft = "support.stiffness=1 kPa/m"  # so that the springs set the step
    plain, stiffer, other = (
        own("steps", soft, *words)
        for words in ((), (STIFFER,), ("lattice.integrator=runge-kutta-4",))
    )
    # Four times the stiffness; 2.83 in place of 2 over the highest frequency.
    assert stiffer.predicted == pytest.approx(plain.predicted / 2.0, rel=0.01)
    assert other.predicted == pytest.approx(plain.predicted * np.sqrt(2.0), rel=0.01)
    for found in (plain, stiffer, other):
        assert found.difference < user_scene.MEASURED


def test_the_motion_that_is_tried_is_that_of_the_scene_s_law_geometry_and_integrator():
    def moved(*words):
        found = own("moves", "tool.force=0.2 N", *words, times=1.0)
        assert found.ending == "value"
        assert found.difference < user_scene.FINER
        return found.measured

    plain = moved()
    assert moved(STIFFER) < 0.8 * plain
    assert abs(moved("lattice.geometry=linear") / plain - 1.0) > 1e-3
    assert moved("lattice.integrator=velocity-verlet") != plain
    assert moved() == plain


def test_models_of_a_scene_are_tried_but_the_reference_and_those_of_estimates(small_scene):
    every = dataclasses.replace(small_scene, models=tuple(MODELS))
    assert user_scene.tried(every) == [
        *("tissue", "hyperelastic", "basafa", "region", "superposition", "corrected")
    ]
    lattices = {
        name for name in user_scene.tried(every) if isinstance(model(every, name), LatticeModel)
    }
    cases = [case.name for case in user_scene.cases(every)]
    rests = {name for name in cases if name.endswith("rest under its load")}
    assert rests == {f"{name}, rest under its load" for name in lattices}


# --- choices --------------------------------------------------------------------------------------


def choices(of, prefix=""):
    """Path, choice and default of each field of a dataclass, and of those within it."""
    hints = get_type_hints(of, include_extras=True)
    for field in dataclasses.fields(of):
        path, hint = prefix + field.name, hints[field.name]
        default = field.default
        if default is dataclasses.MISSING and field.default_factory is not dataclasses.MISSING:
            default = field.default_factory()
        for found in within(hint):
            if isinstance(found, Choice):
                yield path, found, default
            elif dataclasses.is_dataclass(found):
                yield from choices(found, f"{path}.")


def within(hint):
    """A hint and all that it is made of."""
    yield hint
    yield from getattr(hint, "__metadata__", ())
    for part in get_args(hint):
        yield from within(part)


CHOICES = {
    path: (choice, default)
    for path, choice, default in choices(Scene)
    if not path.startswith("further_")  # those of `tool` and `support`, in files entries of lists
}


def test_what_the_code_implements_is_chosen_by_name():
    paths = {"models", "lattice.integrator", "reference.element", "reference.method"}
    assert CHOICES.keys() >= paths | {"tool.history.kind"}
    assert set(CHOICES["models"][0].names()) == set(MODELS)
    assert set(CHOICES["tool.history.kind"][0].names()) == set(HISTORIES)


@pytest.mark.parametrize("path", CHOICES)
def test_a_choice_holds_its_default_and_refuses_other_names_with_those_there_are(path):
    choice, default = CHOICES[path]
    names = choice.names()
    assert len(names) == len(set(names)) > 1
    assert [choice.read(name) for name in names] == list(names)
    assert set(choice.usual) <= set(names)
    taken = default if isinstance(default, tuple) else (default,)
    assert set(taken) <= set(names)
    wrong = '["nonesuch"]' if isinstance(default, tuple) else "nonesuch"
    with pytest.raises(SceneError) as refusal:
        read_scene("block", [f"{path}={wrong}"])
    assert path in str(refusal.value)
    assert all(repr(name) in str(refusal.value) for name in names)


def test_the_integrator_by_default_suits_every_lattice():
    """So that the check of a scene need not look at it."""
    method = INTEGRATORS[CHOICES["lattice.integrator"][1]]
    assert method.stiffness_damping
    assert not method.implicit_volume
    assert not method.linear_only


def test_an_entry_added_to_a_table_is_a_choice(monkeypatch):
    monkeypatch.setitem(MODELS, "rods", MODELS["tissue"])
    scene = read_scene("block", ['models=["rods"]'])
    assert [one.name for one in models_of(scene, {})] == ["tissue"]


# --- kinds of one's own ------------------------------------------------------------------------

LAW = "lattice.law={kind = 'piecewise', strain = [-1, 0, 1], relative_tension = [-1, 0, 1]}"


@pytest.fixture
def second_tissue(monkeypatch):
    """The tissue's lattice under another name of the table."""
    monkeypatch.setitem(MODELS, "mine", "study.models.tissue:KIND")


@pytest.mark.usefixtures("second_tissue")
def test_a_kind_of_ones_own_that_follows_the_law_may_be_given_one(monkeypatch):
    models = "models=['fem', 'mine']"
    assert read_scene("block", [models, LAW]).lattice.law.kind == "piecewise"
    deaf = dataclasses.replace(tissue.KIND, follows_law=False)
    monkeypatch.setattr(tissue, "KIND", deaf)
    with pytest.raises(SceneError, match=r"lattice\.law: only springs"):
        read_scene("block", [models, LAW])


@pytest.mark.usefixtures("second_tissue")
def test_two_models_of_one_name_are_refused():
    scene = read_scene("block", ["models=['tissue', 'mine']"])
    with pytest.raises(ValueError, match="second model named tissue"):
        list(models_of(scene, {}))


def test_the_model_of_the_reading_needs_no_fuzzy_system():
    scene = read_scene("paper", ("models=['basafa','reading']", "patient.hbv='4 kPa'"))
    found = run_study(scene)
    assert not found.record.fuzzy.systems
    assert found.model("reading").small_strain_modulus_pa == pytest.approx((9.5e3 * 4e3) ** 0.5)
    assert {row.model for row in found.scores} == {"reading"}


def test_the_model_of_the_reading_needs_a_reading():
    with pytest.raises(ValueError, match="models: reading needs a reading"):
        validate({"organ": {"shape": "point"}, "models": ["basafa", "reading"]}, "own.toml")


def test_a_scene_without_readings_says_which_key_is_missing():
    table = {"organ": {"shape": "point"}, "models": ["basafa", "msm"]}
    scene = validate(table | {"fuzzy": {"systems": ["sugeno"]}}, "own.toml")
    with pytest.raises(ValueError, match=r"patient: no reading .* patient\.hcv"):
        run_study(scene)
    fuzzy = dataclasses.replace(scene.fuzzy, absent="normal", sensitivity_readings=0)
    normal = dataclasses.replace(scene, fuzzy=fuzzy)
    assert run_study(normal).record.fuzzy.systems.keys() == set(scene.fuzzy.systems)
