"""The region of interest as a model of a scene: its size, its motion, its refusals, its record."""

from dataclasses import replace

import numpy as np
import pytest

from msm.stepper import LatticeStepper
from study.models.region_size import places
from study.models.table import model
from study.problem.rigid import SPHERE, RigidTool
from study.run.study import run_study
from study.scene.file import SceneError, read_scene, write_scene
from study.scene.problem import problem_of
from tests.benchmarks import graded_cells, graded_places

BLOCK = (
    'organ.size=["60 mm", "40 mm", "30 mm"]',
    "tool.radius=10 mm",
    "support.depth=10 mm",
    "reference.element_size=15 mm",
    "lattice.spacing=5 mm",
    "lattice.volume_term=true",
    "time.duration=0.4 s",
    "time.samples=33",
    "tool.history.ramp=0.2 s",
    'models=["tissue", "region"]',
)


@pytest.fixture(scope="module")
def scene():
    return read_scene("block", BLOCK)


@pytest.fixture(scope="module")
def problem(scene):
    return problem_of(scene)


def at_tool(problem, prepared):
    """The curve (samples, 3) of the control point at the tool."""
    return prepared.simulate().trajectory.displacement[:, problem.tool_probe]


def apart(one, other):
    return np.linalg.norm(one - other) / np.linalg.norm(other)


def test_one_level_moves_as_the_plain_lattice(scene, problem):
    """By list and by grid; what differs is rounding."""
    plain = model(scene, "tissue").prepare(problem)
    found = model(scene, "region").varied(spacing=scene.lattice.spacing, levels=1, volume_term=True)
    np.testing.assert_allclose(
        at_tool(problem, found.prepare(problem)), at_tool(problem, plain), rtol=1e-9, atol=1e-12
    )


@pytest.mark.parametrize("tolerance", [0.05, 0.01])
def test_the_size_follows_from_the_tolerance_and_holds_in_motion(scene, problem, tolerance):
    region = model(scene, "region")
    found = region.varied(tolerance=tolerance, volume_term=True).prepare(problem)
    assert 0.0 < found.region.apart <= tolerance
    throughout = model(scene, "tissue").varied(spacing=region.spacing, volume_term=True)
    whole = throughout.prepare(problem)
    assert len(found.assembly.mass) < 0.7 * len(whole.assembly.mass)
    left = apart(at_tool(problem, found), at_tool(problem, whole))
    assert left < 1.5 * tolerance
    assert left > 0.2 * found.region.apart  # or the rest tells nothing of the motion


def test_a_smaller_radius_is_farther_off(scene, problem):
    region = model(scene, "region")
    whole = at_tool(problem, region.varied(levels=1, volume_term=True).prepare(problem))
    errors = [
        apart(at_tool(problem, region.varied(radius=r, volume_term=True).prepare(problem)), whole)
        for r in (0.004, 0.012)
    ]
    assert errors[0] > 2.0 * errors[1]


def test_cells_are_small_at_a_wanted_control_point(problem, scene):
    other = next(name for name in problem.probes if name != problem.probes[problem.tool_probe])
    wanted = replace(scene, region=replace(scene.region, at=(other,), radius=0.004))
    lattice = model(wanted, "region").prepare(problem).assembly.lattice
    there = problem.observation.probes[problem.probes.index(other)]
    (weights, _), finest = lattice.interpolation(there[None]), lattice.levels[0]
    masters = np.unique(weights.indices[weights.data > 1e-9])
    assert np.isin(masters, finest.cells).all()


def test_cells_are_small_along_the_path_of_a_moved_tool(problem):
    start, across = problem.tool.centre, np.array([0.01, 0.0, 0.0])

    def travel(times):
        return np.outer(times / problem.observation.times[-1], across)

    rigid = RigidTool("tool", SPHERE, 0.005, start, problem.tool.direction, travel)
    found = places(replace(problem, rigid_tools=(rigid,)))
    assert np.abs(found - start).max() == pytest.approx(0.01)
    gaps = np.diff(np.sort(found[:, 0]))
    assert gaps.max() < 0.001


def test_the_step_is_that_of_the_finest_cells(scene, problem):
    """Or a little more, where the support, which is stiff, is held by larger cells."""
    found = model(scene, "region").varied(radius=0.008, volume_term=True).prepare(problem)
    finest = model(scene, "region").varied(levels=1, volume_term=True).prepare(problem)
    assert 0.99 < found.critical_time_step / finest.critical_time_step < 1.5
    stepper = found.stepper()
    assert stepper.step == pytest.approx(0.8 * found.critical_time_step, rel=0.02)


def test_a_run_states_sizes_and_errors(scene):
    given = replace(scene, models=("region",), renders=False)
    found = run_study(given)
    one = found.model("region")
    assert one.status == "finished"
    assert one.lattice.inverted_cells == 0
    assert one.time_step_errors
    (words,) = [text for text in found.record.assumptions if "within 2 %" in text]
    assert "2.5 mm" in words
    lines = model(given, "region").prepare(problem_of(given)).describe()
    assert any("hanging nodes" in text and "at rest" in text for text in lines)


def test_a_graded_lattice_is_corrected(scene):
    """The sum follows large displacements as that of a uniform lattice of the finest cells does."""
    given = replace(scene, models=("corrected",), tool=replace(scene.tool, force=1.0))
    loaded = problem_of(given)
    corrected = model(given, "corrected")
    graded, fine, coarse = (
        at_tool(loaded, one.prepare(loaded))
        for one in (
            corrected.varied(coarse="graded", spacing=0.0025, radius=0.008),
            corrected.varied(spacing=0.0025),
            corrected.varied(spacing=0.010),
        )
    )
    assert apart(graded, fine) < 0.5 * apart(coarse, fine)
    assert apart(coarse, fine) > 0.01


GRAVITY = ("gravity.acceleration=9.81 m/s^2",)
MORE = {
    "gravity": GRAVITY,
    "inclusions": (
        'tissue.inclusion=[{place={fraction=[0.5,0.5,0.5]},radius="9 mm",youngs_modulus="40 kPa"}]',
    ),
    "fixed-surfaces": ("support.kind=clamped",),
    "weights": (
        'weight=[{place={side="superior", at=[0.8, 0.5]}, mass="5 g", radius="8 mm"}]',
        "gravity.acceleration=9.81 m/s^2",
        "gravity.towards=inferior",
        "gravity.given=loaded",
    ),
    "several-loads": (
        'tool=[{place={side="superior", at=[0.5, 0.5]}, force="0.3 N", radius="10 mm"}, '
        '{place={side="superior", at=[0.2, 0.5]}, force="0.2 N", radius="8 mm", '
        'history={kind="sinusoid", frequency="5 Hz"}}]',
    ),
    "travelling-loads": (
        'tool.path=[{time="0 s", offset=[0,0,0]}, {time="0.3 s", offset=["15 mm",0,0]}]',
    ),
    "moved-tools": ("tool.shape=sphere", "tool.radius=8 mm", "tool.displacement=3 mm", *GRAVITY),
}


def following(what):
    """Prepared lattices of a scene: uniform, all fine of the region, and graded."""
    given = read_scene("block", (*BLOCK, "region.radius=12 mm", *MORE[what]))
    assert what in given.features
    posed = problem_of(given)
    uniform = model(given, "tissue").varied(volume_term=True, spacing=0.005)
    region = model(given, "region").varied(volume_term=True, spacing=0.005, levels=2)
    graded = (region.varied(radius=radius) for radius in (1.0, 0.008))
    return [one.prepare(posed) for one in (uniform, *graded)]


@pytest.mark.parametrize("what", MORE)
def test_a_region_throughout_is_what_the_plain_lattice_is(what):
    plain, whole, _ = (one.assembly for one in following(what))
    for name in ("mass", "load", "fixed"):
        one, other = getattr(plain, name), getattr(whole, name)
        assert (one is None) == (other is None)
        if one is not None:
            np.testing.assert_allclose(other, one, rtol=1e-12, atol=1e-18)
    np.testing.assert_allclose(whole.springs.weight, plain.springs.weight, rtol=1e-12)
    assert (whole.external_loads is None) == (plain.external_loads is None)
    if plain.external_loads is not None:
        np.testing.assert_allclose(
            whole.external_loads.dead, plain.external_loads.dead, rtol=1e-12, atol=1e-18
        )
        assert whole.external_loads.tools == plain.external_loads.tools
        for name, has in (("attached_mass", what == "weights"), ("loads", "loads" in what)):
            one, other = getattr(plain.external_loads, name), getattr(whole.external_loads, name)
            assert one.any() == has
            np.testing.assert_allclose(other, one, rtol=1e-12, atol=1e-18)


@pytest.mark.parametrize("what", sorted(set(MORE) - {"gravity"}))
def test_a_region_follows_what_its_scene_has(what):
    """Closer to the uniform lattice than that is to one without."""
    plain, _, graded = following(what)
    assert graded.assembly.lattice.hanging > 0
    truth, found = plain.moved().trajectory, graded.moved().trajectory
    assert found.status == "finished"
    assert apart(found.displacement, truth.displacement) < 0.2
    if what == "moved-tools":
        assert apart(found.tool_force, truth.tool_force) < 0.2


@pytest.mark.parametrize("on_list", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_hanging_nodes_follow_what_a_tool_pushes(on_list):
    graded = following("moved-tools")[-1]
    one = LatticeStepper(
        graded.assembly, graded.springs.material, graded.problem.factor, "symplectic-euler"
    )
    if on_list:
        one.grids = None
    one.advance(int(0.15 / one.limit_at_rest), 0.8 * one.limit_at_rest)
    assert np.abs(one.tool_force).max() > 0.01
    np.testing.assert_allclose(graded.assembly.masters @ one.u, one.u, rtol=1e-9, atol=1e-15)


def test_a_tolerance_is_refused_where_more_acts_than_one_load():
    with pytest.raises(SceneError, match=r"region\.radius: a tolerance is kept at rest under a"):
        read_scene("block", (*BLOCK, *MORE["gravity"]))


@pytest.mark.parametrize(
    ("words", "key"),
    [
        ("lattice.body_diagonals=0.2", "lattice.body_diagonals"),
        ("lattice.integrator=implicit-euler", "lattice.integrator"),
        ("lattice.precision=single", "lattice.precision"),
        ('region.at=["nowhere"]', "region.at"),
        ("region.levels=0", "region.levels"),
    ],
)
def test_what_a_graded_lattice_has_not_is_refused_by_its_key(words, key):
    with pytest.raises(SceneError, match=key.replace(".", r"\.")):
        read_scene("block", (*BLOCK, words))


def test_a_spacing_beside_a_graded_corrected_lattice_is_refused():
    words = ('models=["corrected"]', "corrected.coarse=graded", "corrected.spacing=5 mm")
    with pytest.raises(SceneError, match=r"corrected\.spacing: a graded lattice"):
        read_scene("block", (*BLOCK, *words))


def test_varied_settings_that_do_not_fit_are_refused(scene, problem):
    with pytest.raises(ValueError, match=r"lattice\.integrator: xpbd"):
        model(scene, "region").varied(integrator="xpbd").prepare(problem)


def test_the_table_is_written_only_where_it_is_used(scene, tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(write_scene(scene))
    assert "[region]" in path.read_text()
    assert read_scene(str(path)).region == scene.region
    assert "[region]" not in write_scene(replace(scene, models=("tissue",)))


def test_a_budget_is_of_lattices_with_the_same_cells():
    """What cells of several sizes change would count as an error of the stiffness."""
    words = ('models=["fem", "tissue", "region"]', "region.radius=8 mm")
    found = run_study(read_scene("block", (*BLOCK, *words)))
    assert [one.model for one in found.record.budgets] == ["tissue"]


# --- at places of the tool on the liver -----------------------------------------------------------


def test_places_on_the_liver_are_those_of_the_corrected_lattice():
    """The table is committed; `tests.benchmarks.graded_places` writes it."""
    others = {(one["at_x"], one["at_z"]): one for one in graded_places.known()}
    rows = list(graded_places.kept().values())
    assert len(rows) >= 12
    for one in rows:
        assert others[one.at_x, one.at_z]["own_10"] == pytest.approx(one.uniform_10)
        assert one.region_apart <= graded_places.TOLERANCE


def test_on_the_liver_motion_keeps_the_tolerance_of_rest():
    rows = list(graded_places.kept().values())
    assert all(one.region_error < 1.25 * graded_places.TOLERANCE for one in rows)
    assert all(one.region_error < min(one.uniform_10, one.uniform_8) for one in rows)


def test_on_the_liver_a_graded_correction_beats_one_of_more_nodes():
    """In the median and at large strain, where what a coarse lattice adds is not small."""
    rows = [one for one in graded_places.kept().values() if one.strain > 0.05]
    gain = [one.corrected_10 / one.graded_error for one in rows]
    assert np.median(gain) > 2.0
    assert max(one.graded_error for one in rows) < max(one.corrected_10 for one in rows)
    assert max(one.graded_nodes for one in rows) < 2525


def test_on_the_liver_gradings_of_a_plan_keep_what_it_foretells_at_a_tenth_of_the_cost():
    rows = graded_cells.kept()
    places = {row[:2] for row in rows}
    assert len(places) >= 2
    assert all(row.error <= row.foretold for row in rows)
    for place in places:
        met = [row.gain for row in rows if row[:2] == place and row.error <= 0.02]
        assert max(met) > 10.0
