"""The corrected lattice: linear elements plus what a coarse lattice does beyond itself linear."""

import dataclasses
import pickle

import numpy as np
import pytest

from msm.model import Automatic
from study.models import corrected
from study.models.keeping import Keeping
from study.models.model import SILENT, Watch
from study.models.remainder import FINER, ORDER, PreparedRemainder, remainder_errors
from study.models.table import kind, model
from study.problem.trajectory import Trajectory
from study.run.study import run_study
from study.scene.file import read_scene, write_scene
from study.scene.problem import problem_of
from study.tradeoff.lineup import configurations
from tests.conftest import SMALL

BRIEF = (
    *SMALL,
    'models=["fem", "corrected"]',
    'tool.history={kind="ramp-hold-release", ramp="0.1 s", hold="1 s", release="1 s"}',
    "time.duration=0.3 s",
    "time.samples=31",
    "corrected.spacing=10 mm",
)
FEW = "reference.element_size=20 mm"


def scene_of(*overrides):
    return read_scene("block", (*BRIEF, *overrides))


def prepared(*overrides, **settings):
    scene = scene_of(*overrides)
    found = model(scene, "corrected")
    return (found.varied(**settings) if settings else found).prepare(problem_of(scene))


def size(curves):
    return float(np.linalg.norm(curves))


def apart(one, other):
    return size(one - other) / size(other)


@pytest.fixture(scope="module")
def pressed():
    """Under a force that strains the block by a tenth and more."""
    return prepared(FEW, "tool.force=0.5 N")


@pytest.fixture(scope="module")
def results():
    return run_study(scene_of(FEW, "tool.force=0.5 N"))


# --- the sum -------------------------------------------------------------------------------------


def test_a_small_load_moves_it_as_the_elements_and_a_larger_one_less_and_less():
    """What is beyond linear grows with the square of the load."""
    shares = []
    for force in ("10 mN", "0.1 N"):
        one = prepared(FEW, f"tool.force={force}")
        linear = one.fine.simulate().trajectory.displacement
        shares.append(apart(one.simulate().trajectory.displacement, linear))
    assert shares[1] / shares[0] == pytest.approx(10.0, rel=0.2)
    assert shares[0] < 3e-3


def test_light_damping_leaves_a_small_load_to_the_elements():
    one = prepared(FEW, "damping.ratio=0.05", "tool.force=1 mN")
    linear = one.fine.simulate().trajectory.displacement
    assert apart(one.simulate().trajectory.displacement, linear) < 5e-3


def test_it_is_nearer_to_fine_lattice_and_elements_than_either_part(pressed):
    """The truth is the elements and what a lattice of half the spacing adds to them."""
    fine = prepared(FEW, "tool.force=0.5 N", spacing=0.005)
    truth = fine.simulate().trajectory.displacement
    own = pressed.simulate().trajectory.displacement
    linear = pressed.fine.simulate().trajectory.displacement
    coarse = pressed.coarse.simulate().trajectory.displacement
    assert apart(own, truth) < 0.5 * apart(linear, truth)
    assert apart(own, truth) < 0.2 * apart(coarse, truth)


def test_what_the_parts_share_cancels_with_the_error_of_the_steps(pressed):
    def curves(longest):
        found = pressed.simulate(longest).trajectory.displacement
        return found, pressed.coarse.simulate(longest).trajectory.displacement

    (long, coarse), (short, finely) = curves(None), curves(1e-4)
    assert apart(long, short) < 0.1 * apart(coarse, finely)


def test_rest_is_that_of_the_elements(pressed):
    np.testing.assert_allclose(pressed.rest(), pressed.fine.rest())


def test_it_is_stepped_as_it_is_run():
    one = prepared(FEW, "tool.force=0.5 N", "lattice.time_step=1 ms")
    found, problem = one.simulate().trajectory, one.problem
    stepper = one.stepper()

    def last():
        for _ in range(300):
            stepper.take_step()
        vertices = stepper.displacement()
        mesh = problem.geometry.mesh.points
        used = [
            int(abs(mesh - point).sum(axis=1).argmin()) for point in problem.geometry.surface.points
        ]
        return vertices[used]

    assert stepper.step == pytest.approx(1e-3)
    first = last()
    assert apart(first, found.surface_field[1]) < 1e-5
    stepper.restart()
    np.testing.assert_array_equal(last(), first)


# --- what goes wrong -----------------------------------------------------------------------------


def test_cells_turned_inside_out_are_counted_and_keep_it_from_scores():
    found = run_study(scene_of(FEW, "tool.force=30 N"))
    record = found.model("corrected")
    assert record.inverted_cells > 0 or record.status == "diverged"
    assert not [row for row in found.scores if row.model == "corrected"]


def test_the_mesh_is_inverted_by_the_sum_though_no_cell_of_the_lattice_is(pressed):
    solved = pressed._on_level
    shape, found = (
        pressed._deformed(solved),
        pressed._remainder(solved).run(Automatic(), keep_nodes=True),
    )
    assert shape.inverted_cells(found) == 0
    pushed = dataclasses.replace(found, nodal=found.nodal.copy())
    pushed.nodal[5, 0, 0] += 1.0
    assert found.lattice.inverted_cells == 0
    assert shape.inverted_cells(pushed) > 0


def test_a_lattice_that_diverges_takes_the_sum_with_it():
    one = prepared(FEW, "lattice.time_step=10 ms", "tool.force=0.5 N")
    ran = one.run(SILENT)
    assert ran.record.status == ran.trajectory.status == "diverged"
    assert ran.record.diverged_at_s is not None
    assert ran.record.correction is None
    assert np.isnan(ran.trajectory.displacement[-1]).all()
    assert one.simulate().trajectory.status == "diverged"


def test_more_samples_than_the_memory_holds_are_refused(pressed, monkeypatch):
    monkeypatch.setattr(corrected, "available", lambda: 1e5)
    monkeypatch.setattr(pressed.fine, "refuse", lambda: None)
    with pytest.raises(ValueError, match=r"time\.samples: 31 of .* enlarge corrected\.spacing"):
        pressed.refuse()


def test_an_integrator_whose_material_is_that_of_its_step_is_refused():
    with pytest.raises(ValueError, match=r"lattice\.integrator: xpbd"):
        prepared("lattice.integrator=xpbd")


# --- its errors ----------------------------------------------------------------------------------


def motion(curve):
    nothing = np.zeros((2, 0, 3))
    return Trajectory(curve, 2.0 * curve, nothing, nothing)


def test_two_remainders_of_the_assumed_order_tell_its_error_exactly():
    exact = np.random.default_rng(0).normal(size=(5, 2, 3))
    wrong = 0.3 * np.random.default_rng(1).normal(size=(5, 2, 3))
    coarse, fine = motion(exact + wrong), motion(exact + FINER**ORDER * wrong)
    found = remainder_errors(("a", "b"), coarse, fine, motion(exact))
    for i, name in enumerate("ab"):
        assert found[name].displacement == pytest.approx(
            apart(exact[:, i] + wrong[:, i], exact[:, i])
        )
        assert found[name].velocity == pytest.approx(found[name].displacement)


def test_the_error_by_the_spacing_is_at_most_twice_what_is_told_and_no_small_part_of_it(pressed):
    ran = pressed.run(SILENT)
    told = ran.record.correction.remainder_errors["tool"].displacement
    finest = prepared(FEW, "tool.force=0.5 N", spacing=0.0025)
    true = [
        PreparedRemainder(one.coarse, 24).run(Automatic()).trajectory.displacement[:, 0]
        for one in (pressed, finest)
    ]
    whole = ran.trajectory.displacement[:, 0]
    ratio = size(true[0] - true[1]) / size(whole) / told
    assert 0.25 < ratio < 2.0


def test_the_record_has_each_error_by_itself(results):
    record = results.model("corrected")
    found = record.correction
    assert found.spacing_m == pytest.approx(0.010)
    assert found.compared_spacing_m == pytest.approx(0.005)
    assert found.remainder.keys() == found.remainder_errors.keys() == set(results.record.probes)
    assert 0.0 < found.remainder_errors["tool"].displacement < found.remainder["tool"].displacement
    assert record.elements == dataclasses.replace(
        results.model("fem").elements, levels=record.elements.levels, large_strain=None
    )
    assert record.lattice.springs > 0
    assert record.time_step_errors.keys() == set(results.record.probes)
    names = {check.name for check in results.record.checks}
    parts = ("vectors of the elements", "vectors of the lattice", "spacing")
    assert {f"corrected: {part}" for part in parts} <= names
    assert any("none of them a bound" in text for text in results.record.assumptions)


def test_it_is_scored_and_not_taken_for_linear(results):
    assert [row for row in results.scores if row.model == "corrected"]
    assert results.model("corrected").largest_strain > 0.05
    assert not any("corrected, which is linear" in text for text in results.record.warnings)


def test_the_report_prints_each_error_by_itself(results):
    from reports.tables import correction_rows

    rows = correction_rows(results)
    assert [row[:2] for row in rows] == [
        ["Corrected lattice", probe] for probe in results.record.probes
    ]
    assert all(cell.endswith("%") for row in rows for cell in row[2:])


# --- a model like the others ---------------------------------------------------------------------


def test_its_fields_are_kept(tmp_path):
    one = prepared(FEW, "tool.force=0.2 N")
    ran = one.run(Watch(SILENT.progress, Keeping(tmp_path, fields=tmp_path)))
    assert (tmp_path / "corrected.vtkhdf").stat().st_size > 0
    assert not any("fields" in note.lower() for note in ran.notes)


def test_its_spacing_is_twice_that_of_the_scene_where_none_is_given():
    scene = read_scene("block", ('models=["corrected"]', "lattice.spacing=8 mm"))
    assert model(scene, "corrected").coarse.lattice.spacing == pytest.approx(0.016)
    given = read_scene("block", ('models=["corrected"]', "corrected.spacing=11 mm"))
    assert model(given, "corrected").coarse.lattice.spacing == pytest.approx(0.011)
    assert "spacing" in write_scene(given).split("[corrected]")[1]
    assert "[corrected]" not in write_scene(read_scene("block"))


def test_it_is_settings_that_go_to_another_process(small_scene):
    found = model(small_scene, "corrected")
    assert pickle.loads(pickle.dumps(found)).coarse.lattice == found.coarse.lattice  # noqa: S301


def test_it_enters_a_trade_off_by_spacing_and_mesh(small_scene):
    chosen = configurations(small_scene, ["corrected"])
    made = [one.model(small_scene) for one in chosen]
    assert len({(one.coarse.lattice.spacing, one.fine.level) for one in made}) == len(made) > 3
    assert all(one.coarse.lattice.volume_term for one in made)
    assert not kind("corrected").any_load
