"""A blunt tool that travels over the surface: its stations, its loads, and what follows it."""

import csv
from dataclasses import replace

import numpy as np
import pytest

from fem_reference.model import start_of
from fem_reference.observation import at_points, evaluation
from fem_reference.subspace import ritz_subspace
from reports import field_figures
from reports.page import data as page_data
from reports.page.data import page
from reports.renders import FLAT
from study.models.table import model
from study.plan import moved
from study.plan.plan import measure, plan
from study.problem import tool_travel
from study.problem.tool_travel import StationFactor, station_loads, stations
from study.results.folder import read, write
from study.run.study import run_study
from study.scene.file import SceneError, read_scene, write_scene
from study.scene.problem import problem_of
from study.system.progress import Silent
from study.tradeoff.candidates import place_dependent
from study.tradeoff.contenders import contender, contenders_of
from study.tradeoff.request import _refuse_demand
from tests.benchmarks import travelling
from tests.benchmarks.corrected_places import TOLERANCE

BLOCK = (
    'organ.size=["80 mm", "40 mm", "30 mm"]',
    "tool.radius=12 mm",
    'tool.place={side="superior", at=[0.3, 0.5]}',
    "support.depth=10 mm",
    "reference.element_size=20 mm",
    "lattice.spacing=10 mm",
    "time.duration=0.4 s",
    "time.samples=41",
    "tool.history.ramp=0.1 s",
    "tool.history.hold=1 s",
    "control_points={}",
)
WAY = 'tool.path=[{time="0 s", offset=[0,0,0]}, {time="0.3 s", offset=["25 mm",0,0]}]'
TOGETHER = 'models=["fem", "tissue", "corrected"]'


@pytest.fixture(scope="module")
def scene():
    return read_scene("block", (*BLOCK, WAY, TOGETHER))


@pytest.fixture(scope="module")
def problem(scene):
    return problem_of(scene)


def loads_of(problem):
    return [(problem.tool, problem.factor), *((one.tool, one.factor) for one in problem.loads)]


def nodal(problem, body, times):
    """Nodal forces [N] (t, nodes, 3) of elements over time."""
    return (problem.factors(times) @ body.loads.T).reshape(len(times), -1, 3)


# --- stations -------------------------------------------------------------------------------------


def moments(corners, times, distance):
    """Moments 0 to 3 of the shares about the tool's own place [m], largest over time, by degree."""
    found, marks = stations(corners, distance)
    at = np.linspace(times[0], times[-1], 101)
    own = np.interp(at, times, marks)
    histories = [
        one
        for _, one in station_loads(found, found.away, times, marks, np.ones_like, 1e-6 * distance)
    ]
    shares = np.column_stack([one.share(at) for one in histories])
    return [np.abs(shares @ found.marks**k - own**k).max() / marks[-1] ** k for k in range(4)]


def test_force_centre_and_two_more_moments_are_the_tools_own():
    corners = np.array([[0.0, 0.0, 0.0], [0.03, 0.0, 0.0]])
    assert max(moments(corners, np.array([0.0, 0.7]), 0.006)) < 1e-12


def test_hats_would_be_off_by_a_quarter_of_the_distance_squared(monkeypatch):
    monkeypatch.setattr("study.problem.tool_travel.DEGREE", 1)
    found = moments(np.array([[0.0, 0.0, 0.0], [0.03, 0.0, 0.0]]), np.array([0.0, 0.7]), 0.006)
    assert max(found[:2]) < 1e-12
    assert found[2] == pytest.approx(0.25 * 0.2**2, rel=0.02)


def test_a_way_with_a_corner_and_a_stop_has_stations_on_both_pieces():
    corners = np.array([[0, 0, 0], [0.01, 0, 0], [0.01, 0, 0], [0.01, 0.02, 0]], dtype=float)
    found, marks = stations(corners, 0.004)
    assert found.pieces == ((0, 3), (3, 8))
    assert marks.tolist() == pytest.approx([0.0, 0.01, 0.01, 0.03])
    np.testing.assert_allclose(found.away[[0, 3, 8]], corners[[0, 1, 3]], atol=1e-15)


def test_there_and_back_takes_each_station_once():
    out = np.array([[0.0, 0.0, 0.0], [0.02, 0.0, 0.0], [0.0, 0.0, 0.0]])
    found, marks = stations(out, 0.005)
    times = np.array([0.0, 1.0, 2.0])
    both = list(station_loads(found, found.away, times, marks, np.ones_like, 1e-9))
    assert len(both) == 5
    for _, one in both:
        np.testing.assert_allclose(one.share(np.array([0.3])), one.share(np.array([1.7])))
    at = np.linspace(0.0, 2.0, 41)
    whole = sum(place[0] * one.share(at) for place, one in both)
    np.testing.assert_allclose(whole, np.interp(at, times, out[:, 0]), atol=1e-15)


# --- the scene ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("path", "said"),
    [
        (
            WAY.replace("25 mm", "70 mm"),
            r"tool\.path: leaves the surface that faces the tool, .* s;",
        ),
        (WAY.replace('"25 mm",0,0', '0,0,"25 mm"'), r"tool\.path: stays where it is"),
    ],
)
def test_a_path_off_the_surface_or_without_length_is_refused_by_name(path, said):
    given = read_scene("block", (*BLOCK, path, TOGETHER))
    with pytest.raises(ValueError, match=said):
        problem_of(given)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((WAY.replace('offset=["25 mm",0,0]', 'travel="2 mm"'),), "blunt tool stays on the surf"),
        ((WAY.replace("[0,0,0]", '["1 mm",0,0]'),), r"tool\.path: starts elsewhere"),
        ((WAY.replace("0.3 s", "0 s"),), r"tool\.path: give two points or more at rising times"),
        ((WAY, 'models=["superposition"]'), "superposition cannot follow a blunt tool that travel"),
        ((WAY, "tool.history.hold=0 s", "tool.history.ramp=0 s"), "nothing is ever loaded"),
    ],
)
def test_what_a_travelling_tool_has_not_is_refused_with_the_remedy(words, said):
    with pytest.raises(SceneError, match=said):
        read_scene("block", (*BLOCK, TOGETHER, *words))


def test_too_many_stations_are_refused_with_the_remedy():
    small = read_scene("block", (*BLOCK, WAY, "tool.radius=0.4 mm"))
    with pytest.raises(ValueError, match=r"tool\.path: 25 mm take more than 200 places"):
        problem_of(small)


def test_the_scene_is_written_and_read_back(scene, tmp_path):
    path = tmp_path / "own.toml"
    path.write_text(write_scene(scene))
    again = read_scene(str(path))
    assert again.tool == scene.tool
    assert again.features == ("travelling-loads",)


def test_control_points_are_where_the_way_starts_and_ends(scene, problem):
    assert problem.probes == scene.probes == ("tool", "tool-end")
    assert problem.tool_probe == 0
    apart = problem.observation.probes[1] - problem.observation.probes[0]
    np.testing.assert_allclose(apart, [0.025, 0.0, 0.0], atol=1e-12)


# --- what the models are given --------------------------------------------------------------------


def test_elements_carry_the_whole_force_at_the_tool(scene, problem):
    """On a mesh, whose patches have their force but not quite their centre."""
    body = model(scene, "fem").prepare(problem).body()
    times = np.array([0.05, 0.13, 0.22, 0.3, 0.4])
    forces = nodal(problem, body, times)
    share, force = scene.tool.history.factor(times), scene.tool.force
    np.testing.assert_allclose(forces.sum(axis=1)[:, 2], -share * force, rtol=1e-9)
    centre = np.einsum("tn,nd->td", forces[..., 2], body.points) / forces[..., 2].sum(1)[:, None]
    start, way = problem.tool.centre[0], np.minimum(times / 0.3, 1.0) * 0.025
    assert np.abs(centre[:, 0] - start - way).max() < 0.1 * scene.tool.radius


def test_a_lattice_carries_the_whole_force(scene, problem):
    found = model(scene, "tissue").prepare(problem).assembly
    times = np.array([0.05, 0.22, 0.4])
    first, *others = problem.factors(times).T
    whole = first[:, None, None] * found.load + np.einsum(
        "kt,knd->tnd", np.array(others), found.external_loads.loads
    )
    expected = -scene.tool.history.factor(times) * scene.tool.force
    np.testing.assert_allclose(whole.sum(axis=1)[:, 2], expected, rtol=1e-9)


def test_rest_is_told_where_the_tool_is_at_the_peak(scene, problem):
    """One tool in full, not all of its stations."""
    body = model(scene, "fem").prepare(problem).body()
    last, turn = loads_of(problem)[-1]
    assert isinstance(turn, StationFactor)
    np.testing.assert_allclose(problem.full, [0.0] * len(problem.loads) + [1.0], atol=1e-12)
    single = replace(problem, tool=last, factor=turn.history, loads=())
    alone = model(scene, "fem").prepare(single).body()
    np.testing.assert_allclose(body.whole_load, alone.load, rtol=1e-9, atol=1e-15)
    among = ritz_subspace(body, len(problem.loads) + 1)
    np.testing.assert_allclose(
        body.stiffness @ among.rest(body.full), alone.load, atol=1e-6 * np.abs(alone.load).max()
    )
    assert np.abs(body.loads.sum(axis=1) - body.full_load).max() > 0.1 * np.abs(alone.load).max()


def at_end(scene, name):
    posed = problem_of(scene)
    return model(scene, name).prepare(posed).simulate().trajectory.displacement[-1, -1]


def test_after_its_way_the_tissue_settles_as_under_a_tool_that_was_always_there(scene):
    slow = replace(
        scene,
        damping=replace(scene.damping, ratio=3.0),
        time=replace(scene.time, duration=1.2, samples=41),
    )
    there = read_scene("block", (*BLOCK, 'tool.place={side="superior", at=[0.6125, 0.5]}'))
    still = replace(slow, tool=replace(there.tool, path=()), control_points={})
    found, wanted = at_end(slow, "tissue"), at_end(still, "tissue")
    assert np.linalg.norm(found - wanted) < 0.02 * np.linalg.norm(wanted)


# --- the corrected lattice ------------------------------------------------------------------------


@pytest.fixture(scope="module")
def results(scene):
    given = replace(scene, models=("corrected",), tool=replace(scene.tool, force=0.3))
    return run_study(given)


def test_a_run_compares_all_that_follow(results):
    one = results.model("corrected")
    assert one.status == "finished"
    assert one.correction is not None
    for words in ("at most 0.25 radii apart", "for this path of the load only"):
        assert any(words in said for said in results.record.assumptions)
    assert results.record.probes == ("tool", "tool-end")
    start, end = (results.curve("corrected", name) for name in results.record.probes)
    assert np.abs(start.displacement).argmax() < np.abs(end.displacement).argmax()


def test_results_keep_the_way_and_a_picture_draws_it(results, tmp_path):
    write(results, tmp_path)
    fields = read(tmp_path).fields
    (way,) = fields["ways"]
    start, end = way[[0, -1]]
    np.testing.assert_allclose(end - start, [0.025, 0.0, 0.0], atol=1e-9)
    dashes = page_data._dashes(fields["ways"])
    np.testing.assert_allclose(dashes, way[:-1])  # whose pairs are drawn
    assert page(results).organ.ways == page_data.packed(1e3 * dashes)
    drawn = field_figures.views(results)
    assert field_figures.explain(drawn)["travels"] == "1"
    picture = field_figures._scene(drawn, drawn.sheets[0], FLAT)
    dashed = [line for line in picture.axes[0].lines if line.get_linestyle() == "--"]
    assert len(dashed) == 1
    still = replace(drawn, ways=drawn.ways[:0])
    picture = field_figures._scene(still, still.sheets[0], FLAT)
    assert not [line for line in picture.axes[0].lines if line.get_linestyle() == "--"]


def test_a_small_load_that_travels_moves_the_corrected_lattice_as_the_elements(scene):
    light = replace(scene, tool=replace(scene.tool, force=1e-3))
    one = model(light, "corrected").prepare(problem_of(light))
    elements = one.fine.solved_on(None, Silent()).found.trajectory.displacement
    found = one.simulate().trajectory.displacement
    assert np.linalg.norm(found - elements) < 2e-3 * np.linalg.norm(elements)


WANTED = ('require.quantities=["history"]', "require.error=90 %", "tool.force=0.3 N")


def looked(*more):
    wanted = read_scene("block", (*BLOCK, WAY, *WANTED, *more))
    posed = problem_of(wanted)
    return wanted, moved.look(wanted, posed, measure(wanted.require, posed))


def test_a_plan_foretells_lattices_and_corrected_ones():
    wanted, seen = looked()
    found = list(moved.corrected(wanted, seen))
    assert {one.scene.models for one in found} == {("corrected",)}
    parts = {
        (one.scene.corrected.spacing, one.scene.reference.element_size): [
            part.error for part in one.prediction.parts
        ]
        for one in found
    }
    left, mesh, _ = parts[0.01, 0.02]
    coarser, _, _ = parts[0.02, 0.02]
    finer = parts[0.01, 0.015][1]
    assert coarser / left == pytest.approx(2.0**1.5)
    assert mesh / finer == pytest.approx(1.0 / 0.75**2)
    assert seen.finest.spacing == 0.01
    assert left < seen.error  # which the error of this lattice alone is
    with pytest.raises(ValueError, match=r"require\.error: .* nearest is"):
        plan(replace(wanted, require=replace(wanted.require, error=1e-3)))


def test_what_is_foretold_of_large_displacements_is_what_a_finer_lattice_finds(monkeypatch):
    """No more, as it has a factor of two; by coarser lattices it is far less than what is found."""
    wanted, seen = looked()
    foretold = _left(wanted, seen, 0.01)
    with monkeypatch.context() as coarser:
        coarser.setattr(moved, "LOOK", 1.25)
        too_little = _left(*looked(), 0.01)
    posed = problem_of(wanted)
    known = model(wanted, "corrected")
    fine, coarse = (
        known.varied(spacing=h).prepare(posed).simulate().trajectory.displacement
        for h in (0.005, 0.01)
    )
    off = np.linalg.norm(coarse - fine, axis=(0, 2)) / np.linalg.norm(fine, axis=(0, 2))
    assert 0.2 * foretold < off.max() < foretold
    assert off.max() > 2.0 * too_little


def _left(wanted, seen, spacing):
    """What is foretold that large displacements leave on a corrected lattice of a spacing."""
    of_it = (o for o in moved.corrected(wanted, seen) if o.scene.corrected.spacing == spacing)
    return next(of_it).prediction.parts[0].error


def test_no_corrected_lattice_is_foretold_of_what_it_cannot_follow():
    wanted, seen = looked("lattice.geometry=linear")
    assert seen.beyond is None
    assert not list(moved.corrected(wanted, seen))


def test_what_is_foretold_of_elements_is_of_their_sag_too():
    sagging = "gravity.acceleration=9.81 m/s^2", "gravity.towards=right"
    wanted, seen = looked(*sagging)
    assert list(moved.corrected(wanted, seen))
    body = model(wanted, "fem").prepare(problem_of(wanted)).body()
    finest = seen.elements.elements[-1]
    assert finest.unknowns >= body.unknowns
    sag = evaluation(body, seen.elements.problem.observation.probes)
    _, light = looked()
    added = finest.rest.probes - light.elements.elements[-1].rest.probes
    known = at_points(sag, start_of(body))
    assert np.linalg.norm(added - known) < 0.1 * np.linalg.norm(known)


def test_rest_is_refused_of_a_tool_that_travels():
    with pytest.raises(SceneError, match="a blunt tool that travels"):
        read_scene("block", (*BLOCK, WAY, 'require.quantities=["rest"]'))


# --- on the liver ---------------------------------------------------------------------------------


def test_the_sentence_on_stations_is_what_was_measured():
    """The table is committed; `tests.benchmarks.travelling` writes it."""
    with travelling.STATIONS.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    used = [one for one in rows if float(one["apart"]) == tool_travel.APART]
    assert len(used) == 2
    for one in used:
        assert float(one["spline"]) < tool_travel.MEASURED
        assert float(one["hat"]) > 3.0 * tool_travel.MEASURED  # which is why they are not hats


def test_on_the_liver_small_strain_is_met_by_coarse_corrected_lattices():
    """Beside it as controls the correction at rest alone and lattices without any."""
    rows = list(travelling.kept().values())
    small = [one for one in rows if one.strain <= 0.05]
    assert (len(small), len(rows)) == (5, 10)
    assert all(one.error_20 < TOLERANCE for one in small)
    assert max(one.static_20 for one in small) > 5.0 * TOLERANCE
    assert all(one.error_20 < 0.6 * one.own_10 for one in rows)
    assert all(one.error_8 < one.error_20 for one in rows)
    assert not any(one.inverted for one in rows)


# --- in other studies -----------------------------------------------------------------------------


def test_contenders_are_those_that_follow(scene):
    found = contenders_of(scene)
    assert {"corrected", "corrected-graded", "region", "finite-elements", "springs"} <= set(found)
    assert "superposition" not in found


def test_where_the_way_is_known_all_that_is_chosen_from_follows_it(scene, problem):
    """First the elements alone, which are the linear part of what is beside them, and no more."""
    chosen = list(place_dependent(scene))
    assert [one.contender for one in chosen] == [
        *("fem", "corrected", "corrected", "corrected"),
        *("corrected-graded", "region", "corrected-graded", "region"),
    ]
    assert not any(contender(one.contender).lacks(scene) for one in chosen)
    alone, both = (one.model(scene).prepare(problem) for one in chosen[:2])
    linear = alone.simulate().trajectory.displacement
    np.testing.assert_allclose(both.fine.simulate().trajectory.displacement, linear, rtol=1e-9)


def test_where_the_place_is_known_tools_that_are_moved_are_refused():
    moved_tool = read_scene("press")
    with pytest.raises(ValueError, match=r"--known-place: .* leave it out"):
        _refuse_demand(moved_tool, None, known_place=True)
    _refuse_demand(moved_tool, None, known_place=False)
