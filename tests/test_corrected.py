"""The corrected lattice: linear elements plus the nonlinear part of a coarse lattice."""

import dataclasses
import pickle

import numpy as np
import pytest

from fem_reference.subspace import Subspace, SubspaceMotion
from msm import model as msm
from msm.model import Automatic, Counts
from study.models import corrected
from study.models.coupled_stepper import Frame
from study.models.lattice import requested_step
from study.models.model import SILENT, Watch
from study.models.persistence import Persistence
from study.models.remainder import FINER, ORDER, PreparedRemainder, remainder_errors
from study.models.table import kind, model
from study.problem.contact import Load
from study.problem.damping import RayleighDamping
from study.problem.trajectory import Trajectory
from study.run.study import run_study
from study.scene.file import read_scene, write_scene
from study.scene.problem import problem_of
from study.system.progress import Silent
from study.tradeoff.contenders import configurations
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


def test_a_frame_is_the_steps_that_it_has():
    """Under two loads that have corners within it."""
    rng = np.random.default_rng(2)
    loads = rng.standard_normal((2, 3))
    among = Subspace(np.eye(3), np.diag([40.0, 900.0, 9e4]), loads[0], (loads[1],))
    damping = RayleighDamping(30.0, 1e-3)

    def factors(times):
        return np.stack([np.minimum(times / 0.004, 1.0), np.abs(times - 0.007)], axis=1)

    by_steps, by_frames = (SubspaceMotion(among, damping, factors, 1e-3) for _ in range(2))
    frame = Frame(by_frames, damping, 5)
    for _ in range(3):
        by_steps.go_on(5)
        frame.go_on()
    assert by_frames.time == pytest.approx(by_steps.time)
    found, wanted = (one.state[:, :2] for one in (by_frames, by_steps))
    np.testing.assert_allclose(found, wanted, rtol=1e-11, atol=1e-14)


# --- several loads --------------------------------------------------------------------------------


def beside(first, second):
    """A block under two blunt tools of given forces [N], the second pressed as a sinusoid."""
    scene = scene_of(FEW, f"tool.force={first} N")
    problem = problem_of(scene)
    centre = problem.tool.centre + np.array([0.02, 0.0, 0.0])
    other = dataclasses.replace(problem.tool, centre=centre, force=second)

    def wave(times):
        return np.sin(2.0 * np.pi * 5.0 * times)

    posed = dataclasses.replace(problem, loads=(Load(other, wave),))
    return model(scene, "corrected").prepare(posed)


@pytest.fixture(scope="module")
def two():
    return beside(0.3, 0.3)


def test_several_loads_are_followed_as_a_fine_lattice_follows_them(two):
    """The remainder of the coarse lattice is that of one of half its spacing, roughly."""
    found = two.simulate().trajectory.displacement
    elements = two.fine.solved_on(None, Silent()).found.trajectory.displacement
    finer = beside(0.3, 0.3)
    fine = finer.model.coarse.varied(spacing=0.005).prepare(finer.problem)
    step = requested_step(fine.model.lattice)
    truth = elements + PreparedRemainder(fine, 20).run(step).trajectory.displacement
    assert apart(elements, truth) > 0.02
    assert apart(found, truth) < 0.5 * apart(elements, truth)


def test_small_loads_are_superposed():
    """Each alone and both together, small enough to be linear."""
    both, first, second = (
        beside(*forces).simulate().trajectory.displacement
        for forces in ((1e-3, 1e-3), (1e-3, 1e-9), (1e-9, 1e-3))
    )
    assert apart(first + second, both) < 1e-3
    assert apart(first, both) > 0.1


def test_the_linear_lattice_follows_every_load(two):
    """In its vectors as step by step; without the second load it does not."""
    lattice, step = two.coarse, Counts(np.full(30, 20))
    given = lattice.assembly, lattice.springs.material, two.problem.factor, two.problem.observation
    linear = msm.run(*given, step, linear=True).trajectory.displacement
    whole = msm.run(*given, step).trajectory.displacement

    def by_vectors(one):
        return whole - PreparedRemainder(one, 24).run(step).trajectory.displacement

    assert apart(by_vectors(lattice), linear) < 2e-3
    deaf = dataclasses.replace(two.problem, loads=())
    lost = dataclasses.replace(lattice, problem=deaf)
    assert apart(by_vectors(lost), linear) > 0.1


def test_it_is_stepped_under_several_loads_as_it_is_run(two):
    found, stepper = two.simulate(1e-3).trajectory, two.stepper()
    stepper.take_steps(round(0.3 / stepper.step))
    mesh, seen = two.problem.geometry.mesh.points, two.problem.geometry.surface.points
    used = [int(abs(mesh - point).sum(axis=1).argmin()) for point in seen]
    assert apart(stepper.displacement()[used], found.surface_field[1]) < 0.02


# --- gravity and weights --------------------------------------------------------------------------

LEVEL = ("gravity.acceleration=0.05 m/s^2", "gravity.towards=right", "tool.force=0.5 mN")
"""So little that all is linear, across the block."""
HUNG = 'weight=[{mass="30 g", radius="10 mm", place={side="superior", at=[0.8, 0.5]}}]'


def beside_elements(*overrides):
    """The sum, and its elements by themselves, as displacement [m] (samples, probes, 3)."""
    one = prepared(FEW, *overrides)
    return (found.simulate().trajectory.displacement for found in (one, one.fine))


@pytest.mark.parametrize("more", [(), (HUNG,)])
def test_little_gravity_moves_it_as_the_elements_from_the_sag_on(more):
    """The sag of both lattices cancels, and so does what weights do to the motion."""
    own, linear = beside_elements(*LEVEL, *more)
    assert size(linear[0]) > 0.3 * size(linear[-1])
    assert apart(own[0], linear[0]) < 5e-3
    assert apart(own - own[0], linear - linear[0]) < 5e-3


def test_a_shape_given_loaded_starts_where_it_is_and_is_moved_by_its_prestress_too():
    given = "tool.force=1 mN", "gravity.towards=inferior", "gravity.given=loaded"
    own, linear = beside_elements(*given, "gravity.acceleration=9.81 m/s^2")
    assert not own[0].any()
    prestressed = apart(own, linear)  # the load is small, and what it meets is not
    own, linear = beside_elements(*given, "gravity.acceleration=0.05 m/s^2")
    assert prestressed > 2e-3 > 2.0 * apart(own, linear)


def test_under_gravity_it_is_nearer_to_fine_lattice_and_elements_than_either_part():
    heavy = FEW, "gravity.acceleration=9.81 m/s^2", "gravity.towards=right", "tool.force=0.5 N"
    one, finer = prepared(*heavy), prepared(*heavy, spacing=0.005)
    truth = finer.simulate().trajectory.displacement
    own, linear, coarse = (
        part.simulate().trajectory.displacement for part in (one, one.fine, one.coarse)
    )
    assert apart(own, truth) < 0.5 * apart(linear, truth)
    assert apart(own, truth) < 0.2 * apart(coarse, truth)


def test_it_is_stepped_from_its_sag_as_it_is_run():
    heavy = "gravity.acceleration=9.81 m/s^2", "gravity.towards=right", "tool.force=0.3 N"
    one = prepared(FEW, *heavy, HUNG, "lattice.time_step=0.5 ms")
    found, stepper = one.simulate().trajectory, one.stepper()
    mesh, seen = one.problem.geometry.mesh.points, one.problem.geometry.surface.points
    used = [int(abs(mesh - point).sum(axis=1).argmin()) for point in seen]
    for _ in range(2):
        stepper.restart()
        assert apart(stepper.displacement()[used], found.surface_field[0]) > 0.01
        stepper.take_steps(600)
        assert apart(stepper.displacement()[used], found.surface_field[1]) < 1e-5


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
    assert ran.record.ended_at_s is not None
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


def test_two_remainders_of_the_assumed_order_give_its_error_exactly():
    exact = np.random.default_rng(0).normal(size=(5, 2, 3))
    wrong = 0.3 * np.random.default_rng(1).normal(size=(5, 2, 3))
    coarse, fine = motion(exact + wrong), motion(exact + FINER**ORDER * wrong)
    found = remainder_errors(("a", "b"), coarse, fine, motion(exact))
    for i, name in enumerate("ab"):
        assert found[name].displacement == pytest.approx(
            apart(exact[:, i] + wrong[:, i], exact[:, i])
        )
        assert found[name].velocity == pytest.approx(found[name].displacement)


def test_the_error_by_the_spacing_is_at_most_twice_the_estimate_and_no_small_part_of_it(pressed):
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
    ran = one.run(Watch(SILENT.progress, Persistence(tmp_path, fields=tmp_path)))
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
