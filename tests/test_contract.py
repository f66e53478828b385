"""What every model of a study promises, and what the results say of it."""

import dataclasses
import json

import numpy as np
import pytest

from msm.integrators import INTEGRATORS
from study.results import Results, ResultsError
from study.results.folder import read, replacing
from study.results.folder import write as write_files
from study.run.study import run_study
from study.similarity.fields import best_factor, relative_l2
from study.system.folders import FolderError

MODELS = ["fem", "basafa", "msm-mamdani", "msm-sugeno", "msm-interval-type-2", "reading"]


def write(results: Results, folder):
    with replacing(folder) as partial:
        write_files(results, partial)


def plain(record):
    """What results.json says of a record."""
    return json.loads(json.dumps(dataclasses.asdict(record), allow_nan=False))


@pytest.fixture(params=MODELS)
def curve(request, small_results):
    found = [row for row in small_results.curves if row.model == request.param]
    keys = ("time_s", "displacement_m", "velocity_m_per_s")
    return {key: np.array([getattr(row, key) for row in found]) for key in keys}


def test_each_model_gives_finite_curves_from_rest_at_every_sample(curve, small_scene):
    count = small_scene.time.samples * len(small_scene.control_points)
    assert len(curve["time_s"]) == count
    assert curve["displacement_m"][0] == curve["velocity_m_per_s"][0] == 0.0
    assert all(np.isfinite(values).all() for values in curve.values())


def test_each_model_is_pushed_the_way_the_tool_pushes(curve, small_scene):
    first_probe = curve["displacement_m"][: small_scene.time.samples]
    assert first_probe.max() > 1e-5
    assert first_probe.min() > -0.02 * first_probe.max()


def test_velocity_is_the_rate_of_displacement(curve, small_scene):
    n = small_scene.time.samples
    t, u, v = (curve[key][:n] for key in ("time_s", "displacement_m", "velocity_m_per_s"))
    travelled = np.trapezoid(v, t)
    # The trapezoidal rule over the sampled kinks of the ramp.
    assert travelled == pytest.approx(u[-1] - u[0], abs=0.08 * np.ptp(u))


def test_results_name_every_model_and_number(small_results):
    found = small_results.record
    assert [model.name for model in found.models] == MODELS
    assert found.fuzzy.rule_count == 32767
    for model in found.models:
        for key in ("nodes", "time_step_s", "steps", "wall_s"):
            assert getattr(model, key) > 0
        assert (model.critical_time_step_s is None) == (model.name == "fem")
        assert (model.lattice is None) != (model.elements is None)
        assert model.status == "finished"
        assert model.time_step_errors.keys() == set(found.probes)
        assert model.time_step_error.displacement < 0.01
    systems = found.fuzzy.systems
    assert systems.keys() == {"mamdani", "sugeno", "interval-type-2"}
    low, high = systems["interval-type-2"].interval_pa
    assert low < systems["interval-type-2"].estimate_pa < high
    assert all(check.passed for check in found.checks)
    assert {"versions", "commit", "platform", "seed"} <= plain(found)["provenance"].keys()


def test_every_pair_has_every_score_in_the_unit_interval(small_results):
    scores = small_results.scores
    pairs = {(row.model, row.reference) for row in scores}
    assert pairs == {(m, "fem") for m in MODELS[1:]} | {(m, "basafa") for m in MODELS[2:]}
    assert {row.curve for row in scores} == {"displacement", "velocity", "phase-plane"}
    assert len(scores) == len(pairs) * 2 * 7
    assert all(0 <= row.score <= 1 for row in scores)


def test_field_errors_are_those_of_the_whole_organ(small_results):
    quantities = {row.quantity for row in small_results.field_differences}
    assert {"field-relative-l2-peak", "field-relative-l2-final"} <= quantities


def test_the_type_2_band_holds_its_own_curve(small_results):
    """The stiffness lies between the bounds, so at the peak the displacement does."""
    band = [row for row in small_results.bands if row.probe == "tool"]
    curve = small_results.curve("msm-interval-type-2", "tool").displacement
    peak = int(np.argmax(curve))
    assert band[peak].displacement_at_upper_m < curve[peak]
    assert curve[peak] < band[peak].displacement_at_lower_m


def test_the_limits_of_the_lattice_are_stated(small_results):
    limits = small_results.record.lattice_limits
    assert limits.relative_l2_at_best_factor <= limits.relative_l2
    assert limits.relative_l2_at_quarter < limits.relative_l2
    assert limits.relative_l2_with_volume_term < 0.5 * limits.relative_l2_at_best_factor


def lattice_only(scene, **keys):
    """The scene with one fuzzy-tuned lattice, whose keys are changed."""
    return dataclasses.replace(
        scene,
        models=("msm",),
        fuzzy=dataclasses.replace(scene.fuzzy, systems=("sugeno",), sensitivity_readings=0),
        lattice=dataclasses.replace(scene.lattice, **keys),
    )


def largest_displacement(results, model="msm-sugeno"):
    return max(row.displacement_m for row in results.curves if row.model == model)


@pytest.fixture(scope="module")
def with_volume_term(small_scene):
    scene = lattice_only(small_scene, volume_term=True)
    return scene, run_study(scene)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_every_integrator_runs_a_scene_to_the_same_peak(with_volume_term, integrator):
    """Those without a limit take samples for steps, and XPBD is stiff only in the limit."""
    scene, plain = with_volume_term
    lattice = dataclasses.replace(scene.lattice, integrator=integrator)
    other = run_study(dataclasses.replace(scene, lattice=lattice))
    records = [results.record.models[0] for results in (plain, other)]
    assert [record.status for record in records] == ["finished"] * 2
    assert records[1].lattice.integrator == integrator
    peaks = [largest_displacement(results) for results in (plain, other)]
    assert peaks[1] == pytest.approx(peaks[0], rel=0.5 if integrator == "xpbd" else 0.05)


@pytest.mark.parametrize("keys", [{"time_step": 1e-3}, {"step_rate": 1777.0}])
def test_a_given_step_is_kept(small_scene, keys):
    record = run_study(lattice_only(small_scene, **keys)).record.models[0]
    longest = keys.get("time_step") or 1.0 / keys["step_rate"]
    assert record.status == "finished"
    assert record.lattice.smallest_time_step_s == record.time_step_s <= longest * (1 + 1e-9)


def test_small_displacements_are_nearly_those_of_the_linear_path(small_scene, small_results):
    linear = run_study(lattice_only(small_scene, geometry="linear"))
    peaks = [largest_displacement(results) for results in (small_results, linear)]
    assert peaks[0] != peaks[1]
    assert peaks[0] == pytest.approx(peaks[1], rel=0.05)


def test_runs_repeat_exactly(small_scene, small_results):
    again = run_study(dataclasses.replace(small_scene, models=("basafa", "msm", "reading")))
    first = tuple(row for row in small_results.curves if row.model != "fem")
    assert again.curves == first


def test_only_the_named_models_run(small_scene):
    only = run_study(dataclasses.replace(small_scene, models=("basafa",)))
    assert [model.name for model in only.record.models] == ["basafa"]
    assert only.record.fuzzy.systems == {}
    assert not only.scores


def test_the_paper_s_point_needs_no_mesh(paper_results):
    found = paper_results.record
    assert [model.name for model in found.models] == MODELS[1:]
    assert found.control_point.mass_kg == pytest.approx(0.1358, abs=1e-4)
    assert found.models[0].point.damping_ratio == pytest.approx(0.9)
    assert paper_results.fields == {}


def test_best_factor_and_difference_of_scaled_fields(rng):
    field, volumes = rng.standard_normal((50, 3)), rng.uniform(1, 2, 50)
    assert best_factor(0.5 * field, field, volumes) == pytest.approx(2.0)
    assert relative_l2(1.1 * field, field, volumes) == pytest.approx(0.1)


def test_results_read_back_as_written(small_results, tmp_path):
    write(small_results, tmp_path / "out")
    again = read(tmp_path / "out")
    assert again.record == small_results.record
    assert again.scene == small_results.scene
    for table in ("curves", "bands", "scores", "field_differences", "sensitivity"):
        assert getattr(again, table) == rounded(getattr(small_results, table))
    for stem in ("fields", "fuzzy"):
        arrays, found = getattr(small_results, stem), getattr(again, stem)
        assert found.keys() == arrays.keys() != set()
        for name, array in arrays.items():
            assert np.array_equal(found[name], array)


def rounded(rows):
    """Rows in the twelve digits that the tables have."""
    return tuple(
        row._make(float(f"{v:.12g}") if not isinstance(v, str) else v for v in row) for row in rows
    )


def test_a_failure_while_writing_leaves_nothing_and_keeps_the_old(paper_results, tmp_path):
    target = tmp_path / "out"
    write(paper_results, target)
    before = (target / "results.json").read_bytes()

    def interrupted():
        with replacing(target) as partial:
            write_files(paper_results, partial)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert (target / "results.json").read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_a_folder_with_other_files_is_not_touched(tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(FolderError, match="another folder"), replacing(tmp_path):
        pass
    assert (tmp_path / "thesis.tex").exists()


@pytest.mark.parametrize("damage", ["missing", "json", "version", "columns"])
def test_damaged_results_are_refused_with_a_reason(paper_results, tmp_path, damage):
    target = tmp_path / "out"
    write(paper_results, target)
    if damage == "missing":
        (target / "curves.csv").unlink()
    elif damage == "json":
        (target / "results.json").write_text("{")
    elif damage == "version":
        numbers = plain(paper_results.record) | {"schema_version": 99}
        (target / "results.json").write_text(json.dumps(numbers))
    else:
        (target / "curves.csv").write_text("a,b\n1,2\n")
    with pytest.raises(ResultsError):
        read(target)


def test_a_folder_of_results_with_a_foreign_file_is_not_replaced(paper_results, tmp_path):
    target = tmp_path / "out"
    write(paper_results, target)
    (target / "thesis.tex").write_text("years of work")
    with pytest.raises(FolderError, match=r"thesis\.tex"):
        write(paper_results, target)
    assert (target / "thesis.tex").exists()


def test_names_that_look_like_numbers_stay_names(small_scene, tmp_path):
    places = {"1": small_scene.control_points["tool"], "nan": small_scene.control_points["corner"]}
    scene = dataclasses.replace(small_scene, models=("basafa",), control_points=places)
    write(run_study(scene), tmp_path / "out")
    assert {row.probe for row in read(tmp_path / "out").curves} == {"1", "nan"}
