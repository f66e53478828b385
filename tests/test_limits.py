"""At and beyond the limits: divergence is a result, never a score."""

import dataclasses
import json

import numpy as np
import pytest

from study.run.study import run_study
from study.scene.file import read_scene
from study.scene.problem import problem_of


def changed(scene, **tables):
    """The scene with fields of its tables replaced."""
    return dataclasses.replace(
        scene,
        **{
            name: dataclasses.replace(getattr(scene, name), **values)
            for name, values in tables.items()
        },
    )


@pytest.fixture(scope="module")
def unstable(small_scene):
    """Lattices without damping, driven at five times their critical step."""
    scene = changed(small_scene, lattice={"step_fraction": 5.0}, damping={"ratio": 0.0})
    scene = changed(scene, time={"samples": 16})
    return run_study(scene)


def test_an_unstable_step_is_recorded_as_divergence_with_its_time(unstable):
    diverged = unstable.model("msm-mamdani")
    assert diverged.status == "diverged"
    assert diverged.time_step_s > 1.5 * diverged.critical_time_step_s
    assert 0 < diverged.ended_at_s <= diverged.simulated_s
    assert len(diverged.ended_near_m) == 3
    assert unstable.model("fem").status == "finished"


def test_a_diverged_model_has_no_score_and_no_error(unstable):
    for table in (unstable.scores, unstable.field_differences):
        assert not [row for row in table if row.model == "msm-mamdani"]
    assert any("msm-mamdani diverged" in text for text in unstable.record.warnings)
    assert any("msm-mamdani" in note for note in unstable.record.notes)


def test_no_number_of_a_diverged_run_is_not_finite(unstable):
    json.dumps(dataclasses.asdict(unstable.record), allow_nan=False)
    found = unstable
    for rows in (
        *(found.curves, found.bands, found.scores),
        *(found.field_differences, found.sensitivity),
    ):
        values = [value for row in rows for value in row if not isinstance(value, str)]
        assert np.isfinite(values).all()


@pytest.mark.parametrize("ratio", [0.0, 0.05, 12.0])
def test_lattices_stay_bounded_over_the_damping_range(small_scene, ratio):
    scene = changed(small_scene, damping={"ratio": ratio})
    results = run_study(dataclasses.replace(scene, models=("msm",)))
    assert all(model.status == "finished" for model in results.record.models)


def test_crushing_the_block_ends_in_a_status_not_an_exception(small_scene):
    scene = changed(small_scene, tool={"force": 200.0})
    results = run_study(dataclasses.replace(scene, models=("basafa", "msm")))
    assert {model.status for model in results.record.models} <= {"finished", "diverged"}
    json.dumps(dataclasses.asdict(results.record), allow_nan=False)


def test_a_strained_reference_is_warned_about(small_scene):
    scene = changed(small_scene, tool={"force": 1.0})
    results = run_study(dataclasses.replace(scene, models=("fem",)))
    assert results.model("fem").largest_strain > 0.05
    assert any("should not be trusted" in text for text in results.record.warnings)


@pytest.mark.parametrize("nu", [0.0, 0.25, 0.49, 0.499])
def test_the_reference_runs_over_the_range_of_poisson_ratios(small_scene, nu):
    scene = changed(small_scene, tissue={"poisson_ratio": nu}, time={"samples": 16})
    results = run_study(dataclasses.replace(scene, models=("fem",)))
    assert results.model("fem").status == "finished"


def test_scores_stay_in_the_unit_interval_against_a_benchmark_that_hardly_moves():
    scene = read_scene("paper", ["tool.force=1 nN", "basafa.k1=1e6 N", "basafa.gamma_0=1e6 N*s/m"])
    results = run_study(scene)
    assert results.scores
    for row in results.scores:
        assert 0 <= row.score <= 1


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("tool.radius=0.01 mm", "tool"),
        ("lattice.spacing=500 mm", r"lattice\.spacing"),
        ("reference.element_size=1 mm", r"reference\.element_size"),
    ],
)
def test_a_scene_that_cannot_be_posed_names_the_key(override, message):
    scene = read_scene("block", [override])
    with pytest.raises(ValueError, match=message):
        run_study(scene)


def test_support_and_tool_stay_where_they_are_whatever_the_mesh(small_scene):
    """The places must not move with the element size, or no study could converge."""
    posed = [
        problem_of(changed(small_scene, reference={"element_size": size}))
        for size in (0.015, 0.006)
    ]
    assert np.allclose(posed[0].tool.centre, posed[1].tool.centre, atol=1e-15)
    assert posed[0].foundation.level == posed[1].foundation.level
    for a, b in zip(posed[0].observation.probes, posed[1].observation.probes, strict=True):
        assert np.allclose(a, b, atol=1e-15)


def test_a_peak_at_the_last_sample_keeps_its_field(small_scene):
    step = dataclasses.replace(small_scene.tool.history, kind="step")
    results = run_study(changed(small_scene, tool={"history": step}))
    errors = {
        row.quantity: row.value
        for row in results.field_differences
        if (row.model, row.reference) == ("basafa", "fem")
    }
    assert errors["field-relative-l2-peak"] == errors["field-relative-l2-final"] > 0


def test_halved_steps_are_halved_even_where_the_samples_set_the_step(small_scene):
    """Negative control: an error estimate from two equal runs would be zero."""
    scene = changed(small_scene, time={"duration": 0.1, "samples": 1001})
    scene = changed(scene, tool={"history": dataclasses.replace(scene.tool.history, kind="step")})
    results = run_study(dataclasses.replace(scene, models=("msm",)))
    assert all(model.time_step_error.displacement > 1e-6 for model in results.record.models)


def test_a_collapsed_lattice_has_a_warning_and_no_score(small_scene):
    scene = changed(small_scene, tool={"force": 5.0})
    results = run_study(dataclasses.replace(scene, models=("fem", "msm")))
    inverted = {model.name for model in results.record.models if model.inverted_cells}
    assert inverted
    assert any("turned inside out" in text for text in results.record.warnings)
    assert not {row.model for row in results.scores + results.field_differences} & inverted


def test_a_stiff_support_on_cut_cells_still_lets_the_lattice_settle(small_scene):
    """Negative control of a former scheme: added inertia held cut cells back by 20 %, unseen."""
    from msm.damping import NodalDamping
    from msm.laws import Hooke
    from msm.model import Material, assemble, run, static_displacement
    from study.problem.trajectory import Observation

    scene = changed(small_scene, organ={"size": (0.06, 0.04, 0.035)}, support={"stiffness": 1e8})
    place = dataclasses.replace(scene.tool.place, side="inferior")
    scene = changed(scene, support={"side": "superior"}, tool={"place": place})
    posed = problem_of(dataclasses.replace(scene, control_points={}))
    lattice = assemble(
        posed.geometry.body, posed.surface_rule, 1054, 0.01, posed.foundation, posed.tool, 0.2
    )
    material, none = Material(Hooke(38.0), damping=NodalDamping(300.0)), np.zeros((0, 3))
    watch = Observation(np.linspace(0, 1.0, 17), lattice.lattice.nodes, (16,), none, none)
    found = run(lattice, material, np.ones_like, watch).trajectory
    settled, static = found.displacement[-1], static_displacement(lattice, material)
    assert np.linalg.norm(settled - static) < 0.02 * np.linalg.norm(static)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("tool.direction=[0, 0, 1]", r"tool\.direction"),
        ('control_points.far={point=["3 m", "3 m", "3 m"], snap=false}', r"control_points\.far"),
    ],
)
def test_what_would_give_a_number_without_meaning_is_refused(override, message):
    with pytest.raises(ValueError, match=message):
        run_study(read_scene("block", [override]))


def test_a_sinusoid_faster_than_the_samples_is_refused():
    history = 'tool.history={kind="sinusoid", frequency="100 Hz"}'
    with pytest.raises(ValueError, match="8 samples a period"):
        read_scene("block", [history])


@pytest.mark.parametrize("override", ["damping.ratio=0", "basafa.gamma_0=0 N*s/m"])
def test_a_point_without_damping_needs_its_mass(override):
    with pytest.raises(ValueError, match=r"organ\.mass"):
        read_scene("paper", [override])
