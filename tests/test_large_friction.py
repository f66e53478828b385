"""Tools with friction and sliding punches on neo-Hookean elements, and errors planted in them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fem_reference.contact import kinematics, large_motion
from fem_reference.contact.kinematics import Configuration, PreviousState
from fem_reference.contact.large_motion import Integrator, contact_problem, run
from fem_reference.contact.law import frictional_forces, law_residual
from fem_reference.contact.motion import at_peak
from fem_reference.elasticity import discretise
from study.models import hyperelastic
from study.models.model import SILENT
from study.models.table import models_of
from study.numerics.continuation import NO_EQUILIBRIUM
from study.organ.block import block_mesh
from study.problem.contact import Foundation, ToolPatch
from study.problem.damping import RayleighDamping
from study.problem.rigid import PLATE, PUNCH, SPHERE, RigidTool
from study.problem.tissue import Tissue
from study.problem.trajectory import Observation
from study.scene.file import read_scene
from study.scene.problem import problem_of

DOWN, ALONG = np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0])
SIZE = (0.06, 0.06, 0.03)
TOP = np.array([0.03, 0.03, 0.03])
TISSUE = Tissue(poisson_ratio=0.45)
DAMPING = RayleighDamping(30.0)
RADIUS = 0.015


@pytest.fixture(scope="module")
def body():
    blunt = ToolPatch(TOP, DOWN, 0.02, 0.0)
    base = Foundation(DOWN, 0.0, 1e-3, 1e7)
    return discretise(block_mesh(SIZE, 0.015), TISSUE, base, blunt, "taylor-hood")


def tool(shape=SPHERE, friction=0.0, depth=3e-3, along=(3e-3,), **settings):
    """Pressed in until a half, then dragged from one place to the next by the end of a second."""
    times = 0.5 + 0.5 * np.arange(len(along) + 1) / len(along)

    def travel(at):
        down = np.outer(np.interp(at, [0.0, 0.5], [0.0, depth]), DOWN)
        return down + np.outer(np.interp(at, times, [0.0, *along]), ALONG)

    return RigidTool("tool", shape, RADIUS, TOP, DOWN, travel, friction=friction, **settings)


def way(body, one, stations=16):
    """The body, and its states at rest at stations on the way of a tool."""
    times = np.linspace(0.0, 1.0, stations + 1)
    given = contact_problem(body, TISSUE, (one,), DAMPING, np.zeros_like, times)
    steps, nothing = Integrator(given), np.zeros(given.body.solid.size)
    found = [steps.start()]
    for time in times[1:]:
        found.append(steps.equilibrium(found[-1], time, nothing))
    return given, found


def forces(body, one, stations=16):
    """On the body along the drag and into it [N] (stations + 1, 2)."""
    given, found = way(body, one, stations)
    return np.array(
        [-given.tool_forces(state)[0] @ np.column_stack([ALONG, DOWN]) for state in found]
    )


def slides_at_the_cone(body):
    """Whether the tangential force under a flat punch that slides is that of the cone, not more.

    All of it slides; at its edge some also sideways, for the tissue flows out from under it.
    """
    along, normal = forces(body, tool(PUNCH, 0.3, along=(6e-3,)))[[8, 16]].T
    before = 0.0 <= along[0] < 0.1 * normal[0]
    return before and normal[1] > 0.1 and 0.2995 < along[1] / normal[1] < 0.3 * (1.0 + 1e-6)


def test_a_punch_that_slides_drags_by_the_coefficient_times_its_force(body):
    assert slides_at_the_cone(body)


def of_wrong_sign(exact, compliance, offset, friction, start):
    found = exact(compliance, offset, friction, start)
    found[:, 1:] *= -1.0
    return found


def cone_without_the_normal_force(exact, compliance, offset, friction, start):
    found = exact(compliance, offset, np.full_like(friction, 1e9), start)
    drag = np.linalg.norm(found[:, 1:], axis=1)
    found[:, 1:] *= np.minimum(1.0, friction * 0.02 / np.maximum(drag, 1e-300))[:, None]
    return found


def of_another_coefficient(exact, compliance, offset, friction, start):
    return exact(compliance, offset, 1.01 * friction, start)


@pytest.mark.parametrize(
    "plant", [of_wrong_sign, cone_without_the_normal_force, of_another_coefficient]
)
def test_an_error_planted_in_the_law_is_not_balanced(body, plant, monkeypatch):
    """What does not meet the law is not handed out, whoever found it."""
    monkeypatch.setattr(
        kinematics, "frictional_forces", lambda *given: plant(frictional_forces, *given)
    )
    with pytest.raises(ValueError, match=NO_EQUILIBRIUM):
        slides_at_the_cone(body)


@pytest.mark.parametrize("rows", [lambda r, t: r + 0.02 * t, lambda r, t: r - 2.0 * t])
def test_an_error_planted_in_how_friction_is_shared_out_is_seen(body, rows, monkeypatch):
    """More of it than the cone has, or its sign."""
    exact = Configuration._rows

    def wrong(met, k):
        found = exact(met, k)
        tangential = found.copy()
        tangential.data[np.repeat(np.arange(found.shape[0]) % 3 == 0, np.diff(found.indptr))] = 0.0
        return rows(found, tangential).tocsr()

    monkeypatch.setattr(Configuration, "_rows", wrong)
    try:
        assert not slides_at_the_cone(body)
    except ValueError as error:
        assert NO_EQUILIBRIUM in str(error)  # noqa: PT017 - one of two ways to be seen


@pytest.mark.parametrize(("shape", "off"), [(PUNCH, 1e-2), (PLATE, 2e-3)])
def test_much_friction_holds_as_a_bond_does(body, shape, off):
    """Of a punch up to what its edge draws under itself; without any, tissue flows beside."""
    bonded = forces(body, tool(shape, along=(1.5e-3,), bonded=True), 8)[-1]
    stuck = forces(body, tool(shape, 100.0, along=(1.5e-3,)), 8)[-1]
    smooth = forces(body, tool(shape, 0.0, along=(1.5e-3,)), 8)[-1]
    assert stuck == pytest.approx(bonded, rel=off)
    assert abs(smooth[0]) < 0.02 * bonded[0]


def test_more_friction_drags_more_until_all_of_it_sticks(body):
    found = [
        forces(body, tool(SPHERE, mu, along=(1.5e-3,)), 8)[-1][0] for mu in (0.0, 0.1, 0.3, 1.0)
    ]
    assert (np.diff(found) > 0.0).all()
    assert forces(body, tool(SPHERE, 2.0, along=(1.5e-3,)), 8)[-1][0] == pytest.approx(
        found[-1], rel=1e-3
    )


def test_what_friction_remembers_converges_with_the_stations(body):
    """At first order at least, of a sphere that is dragged aside and back: slip counts by steps."""
    there_and_back = tool(SPHERE, 0.3, along=(1.5e-3, 0.0))
    found = [forces(body, there_and_back, stations)[-1][0] for stations in (4, 8, 16)]
    off = np.abs(np.array(found[:2]) / found[2] - 1.0)
    assert 0.0 < off[1] < 0.6 * off[0] < 0.6e-3


def test_friction_at_small_strains_is_that_of_the_linear_reference(body):
    """Stations alike, up to what the volume's stiffness at each point costs on so coarse a mesh."""
    one = tool(PLATE, 0.3, depth=3e-5, along=(3e-5,))
    seen = Observation(
        np.linspace(0.0, 1.0, 9), TOP[None], (8, 8), np.zeros((0, 3)), np.zeros((0, 3))
    )
    linear = -at_peak(body, (one,), seen).forces[0] @ np.column_stack([ALONG, DOWN])
    found = forces(body, one, 8)[-1]
    assert linear[0] > 0.05 * linear[1]
    assert found == pytest.approx(linear, rel=2e-2)


def test_a_punch_at_small_depth_has_the_force_of_the_linear_reference(body, monkeypatch):
    """All of the volume by the pressure, as there."""
    monkeypatch.setattr(large_motion, "POINTWISE", 0.0)
    one = tool(PUNCH, depth=3e-5, along=(0.0,))
    seen = Observation(
        np.linspace(0.0, 1.0, 3), TOP[None], (2, 2), np.zeros((0, 3)), np.zeros((0, 3))
    )
    linear = at_peak(body, (one,), seen).forces[0] @ -DOWN
    assert forces(body, one, 4)[-1][1] == pytest.approx(linear, rel=2e-3)


@pytest.mark.parametrize("shape", [SPHERE, PUNCH])
def test_a_problem_in_turned_axes_has_turned_forces(body, shape):
    """The tool's axis, its normals and the way that it slips are its own."""
    Q, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    Q *= np.linalg.det(Q)
    one = tool(shape, 0.2, along=(2e-3,))
    other = replace(one, tip=Q @ TOP, axis=Q @ DOWN, travel=lambda t: one.travel(t) @ Q.T)
    mesh = block_mesh(SIZE, 0.015)
    blunt, base = ToolPatch(Q @ TOP, Q @ DOWN, 0.02, 0.0), Foundation(Q @ DOWN, 0.0, 1e-3, 1e7)
    turned = replace(mesh, points=mesh.points @ Q.T)
    other_body = discretise(turned, TISSUE, base, blunt, "taylor-hood")
    (given, exact), (there, found) = way(body, one, 8), way(other_body, other, 8)
    force = given.tool_forces(exact[-1])[0]
    assert abs(force[0]) > 0.1 * abs(force[2])
    size = np.linalg.norm(force)
    assert there.tool_forces(found[-1])[0] == pytest.approx(Q @ force, abs=1e-4 * size)


@pytest.fixture(scope="module")
def loop(body):
    """Pressed in, and dragged to and fro twice."""
    one = tool(PUNCH, 0.2, along=(4e-3, -4e-3, 4e-3, -4e-3, 4e-3))
    return one, *way(body, one, 40)


def test_friction_takes_energy_at_every_step_and_gives_none(loop):
    _, given, found = loop
    heat = []
    for state in found[1:]:
        slip, force = (
            one.reshape(-1, 3)[:, 1:] for one in (given.configuration(state).gaps, state.force)
        )
        heat.append(-float((slip * force).sum()))
    largest = max(heat)
    assert min(heat) > -1e-6 * largest
    assert sum(heat[-16:]) > 4.0 * 0.004 * 0.2 * 0.5  # N m, of a path of 16 mm under some newtons


def test_a_closed_loop_costs_what_slips_on_it(loop):
    """The work of the tool in one round is heat; what is stored comes back."""
    one, given, found = loop
    ends = found[-17], found[-1]
    force = np.array([-given.tool_forces(state)[0] for state in found[-17:]])
    times = [state.time for state in found[-17:]]
    places = one.travel(np.array(times))
    work = float((0.5 * (force[1:] + force[:-1]) * np.diff(places, axis=0)).sum())
    stored = [given.energy(state) for state in ends]
    heat = 0.0
    for state in found[-16:]:
        slip, pushed = (
            each.reshape(-1, 3)[:, 1:] for each in (given.configuration(state).gaps, state.force)
        )
        heat -= float((slip * pushed).sum())
    assert work > 0.0
    assert abs(stored[1] - stored[0]) < 0.02 * work
    assert heat == pytest.approx(work, rel=0.1)


def test_forces_of_body_and_tool_are_in_balance(body, rng):
    one = tool(SPHERE, 0.5)
    contact = contact_problem(
        body, TISSUE, (one,), DAMPING, np.zeros_like, np.linspace(0.0, 1.0, 5)
    ).body.contact
    u, force = 1e-3 * rng.standard_normal(contact.size), rng.random(len(contact.bonded))
    met = contact.at(u, 1.0, PreviousState(np.zeros_like(u), 0.0))
    on_body = (met.derivative.T @ force).reshape(-1, 3).sum(axis=0)
    assert met.tool_forces(force)[0] == pytest.approx(-on_body)


def test_slip_counts_from_where_body_and_tool_were(body):
    """A body that moves with the tool does not slip; one that stays slips back."""
    one = tool(PLATE, 0.5, depth=0.0, along=(3e-3,))
    contact = contact_problem(
        body, TISSUE, (one,), DAMPING, np.zeros_like, np.linspace(0.0, 1.0, 5)
    ).body.contact
    still, carried = np.zeros(contact.size), np.tile(3e-3 * ALONG, contact.size // 3)
    before = PreviousState(still, 0.5)
    slip = contact.at(carried, 1.0, before).gaps.reshape(-1, 3)[:, 1:]
    assert np.abs(slip).max() < 1e-12
    slip = contact.at(still, 1.0, before).gaps.reshape(-1, 3)[:, 1:]
    assert np.hypot(*slip.T) == pytest.approx(3e-3)
    half = contact.at(still, 1.0, PreviousState(still, 0.75)).gaps.reshape(-1, 3)[:, 1:]
    assert np.hypot(*half.T) == pytest.approx(1.5e-3)


def test_tangents_are_across_the_normal_and_turn_smoothly_with_it(rng):
    axis = np.array([0.48, -0.6, 0.64])
    normals = rng.normal(size=(200, 3))
    tangents = kinematics._tangents(axis, normals)
    unit = normals / np.linalg.norm(normals, axis=1)[:, None]
    frames = np.concatenate([unit[:, :, None], tangents], axis=2)
    assert np.einsum("vik,vil->vkl", frames, frames) == pytest.approx(
        np.broadcast_to(np.eye(3), (200, 3, 3)), abs=1e-6
    )
    assert np.linalg.det(frames) == pytest.approx(1.0)
    ahead = unit @ axis > -0.9
    moved = kinematics._tangents(axis, unit + 1e-4 * rng.normal(size=(200, 3)))
    assert np.abs(moved - tangents)[ahead].max() < 0.01


def test_tangents_under_a_sphere_are_across_the_mean_normal_of_each_vertex(body):
    one = tool(SPHERE, 0.5, depth=8e-3)
    contact = contact_problem(
        body, TISSUE, (one,), DAMPING, np.zeros_like, np.linspace(0.0, 1.0, 5)
    ).body.contact
    met = contact.at(np.zeros(contact.size), 0.5)
    rows = met.derivative.toarray().reshape(len(contact.bonded) // 3, 3, -1, 3)
    normal, first, second = rows.sum(axis=2).transpose(1, 0, 2)
    leaning = np.linalg.norm(np.cross(normal, DOWN), axis=1)
    assert leaning.max() > 0.1
    for tangent in (first, second):
        assert np.abs((normal * tangent).sum(axis=1)).max() < 1e-9


def test_what_sticks_moves_with_the_tool(body):
    """To the velocity, from the end of the step on within which the tool is dragged off."""
    one = tool(PLATE, 100.0, depth=1e-3, along=(2e-3,))
    given = contact_problem(body, TISSUE, (one,), DAMPING, np.zeros_like, np.linspace(0.0, 1.0, 5))
    steps = Integrator(given)
    for state in steps.march(steps.start(), 0.06):
        if state.time > 0.5:
            break
    pushed = given.configuration(state).derivative @ state.v
    moving = (
        given.configuration(state).derivative @ np.tile(4e-3 * ALONG, given.body.solid.size // 3)
    )[state.force.reshape(-1, 3)[:, 0].repeat(3) > 0.0]
    found = pushed[state.force.reshape(-1, 3)[:, 0].repeat(3) > 0.0]
    assert len(found) > 30
    assert found == pytest.approx(moving, abs=1e-5 * 4e-3)


def test_a_dragged_sphere_in_motion_stays_in_its_cone_and_gains_nothing(body):
    one = tool(SPHERE, 0.4, depth=3e-3, along=(5e-3, 0.0))
    seen = Observation(
        np.linspace(0.0, 1.0, 41), TOP[None], (20, 40), np.zeros((0, 3)), np.zeros((0, 3))
    )
    given = contact_problem(body, TISSUE, (one,), DAMPING, np.zeros_like, seen.times)
    found = run(body, given, seen, 1)
    assert found.trajectory.status == "finished"
    force = -found.trajectory.tool_force[:, 0]
    steps = 0.5 * (force[1:] + force[:-1]) * np.diff(one.travel(seen.times), axis=0)
    work = np.append(0.0, np.cumsum(steps.sum(axis=1)))
    held = np.array([given.energy(state) for state in found.states])
    assert (held <= work + 0.02 * work.max()).all()
    for state in found.states[1:]:
        normal, *drag = state.force.reshape(-1, 3).T
        assert (np.hypot(*drag) <= 0.4 * normal * (1.0 + 1e-6) + 1e-9).all()
    slid = found.states[30].force.reshape(-1, 3)
    assert np.linalg.norm(slid[:, 1:], axis=1).sum() > 0.39 * slid[:, 0].sum()


def test_beside_a_smooth_tool_friction_is_that_of_the_other_alone(body):
    """All tools have slips where one has friction; the smooth one's bear no force."""
    left, right = TOP - 0.015 * ALONG, TOP + 0.015 * ALONG
    rough = replace(tool(SPHERE, 0.5), name="rough", tip=left, radius=0.012)
    smooth = replace(tool(SPHERE, 0.0), name="smooth", tip=right, radius=0.012)
    given = contact_problem(
        body, TISSUE, (rough, smooth), DAMPING, np.zeros_like, np.linspace(0.0, 1.0, 9)
    )
    state = Integrator(given).peak_equilibrium(1.0, np.zeros(given.body.solid.size))
    contact = given.body.contact
    drag = [np.abs(state.force[part].reshape(-1, 3)[:, 1:]).max() for part in contact.parts]
    assert drag[0] > 1e-3
    assert drag[1] == 0.0


def test_a_bonded_tool_is_the_same_beside_one_that_could_rub(body):
    """The law with tangents holds it as that of normals alone does."""
    held = replace(tool(PUNCH, bonded=True, depth=1e-3), radius=0.01, tip=TOP - 0.015 * ALONG)
    lifted = replace(tool(SPHERE, 0.5), name="lifted", radius=0.01, tip=TOP + 0.02 * ALONG)
    lifted = replace(lifted, travel=lambda t: np.outer(-1e-3 * t, DOWN))
    found = []
    for tools in ((held, lifted), (held,)):
        given = contact_problem(
            body, TISSUE, tools, DAMPING, np.zeros_like, np.linspace(0.0, 1.0, 9)
        )
        state = Integrator(given).peak_equilibrium(1.0, np.zeros(given.body.solid.size))
        found.append(given.tool_forces(state))
    assert abs(found[1][0, 0]) > 0.05 * abs(found[1][0, 2])
    assert found[0][0] == pytest.approx(found[1][0], rel=1e-4)
    assert (found[0][1] == 0.0).all()


def test_tissue_that_rises_beside_a_punch_passes_its_side(body):
    """And is under it only where its face comes down on it."""
    one = tool(PUNCH, depth=0.0, along=(0.0,))
    contact = contact_problem(
        body, TISSUE, (one,), DAMPING, np.zeros_like, np.linspace(0.0, 1.0, 5)
    ).body.contact
    points = contact.patches[0].points
    outside = np.linalg.norm((points - TOP)[:, :2], axis=1) > RADIUS
    assert outside.sum() > 100  # what may be drawn under is seen
    nodes = contact.size // 3
    lifted, drawn = np.zeros((2, nodes, 3))
    lifted[:, 2] = 0.3 * RADIUS
    drawn[:, 0] = 0.5 * RADIUS
    still = contact.at(np.zeros(contact.size), 1.0, None)
    risen = contact.at(lifted.ravel(), 1.0, PreviousState(lifted.ravel(), 1.0))
    assert np.isfinite(still.gaps).sum() > 4
    assert np.isinf(risen.gaps).all()
    assert risen.penetration == 0.0
    assert (risen.derivative.data == 0.0).all()
    moved = contact.at(drawn.ravel(), 1.0, PreviousState(drawn.ravel(), 1.0))
    assert (np.isfinite(moved.gaps) != np.isfinite(still.gaps)).any()


def test_a_punch_that_is_lifted_is_left(body):
    def travel(at):
        return np.outer(np.interp(at, [0.0, 0.5, 1.0], [0.0, 2e-3, -1e-3]), DOWN)

    found = forces(body, replace(tool(PUNCH), travel=travel))[:, 1]
    assert found[8] > 0.5
    assert found.min() > -1e-9
    assert found[-2:] == pytest.approx(0.0, abs=1e-9)


def wedged():
    """A compliance and offsets by which whole sweeps of relaxation go round."""
    rng = np.random.default_rng(SEED)
    A = rng.normal(size=(12, 12))
    return A @ A.T + 0.05 * np.eye(12), rng.normal(size=(4, 3))


SEED = 91


def test_relaxation_settles_where_whole_sweeps_go_round():
    compliance, offset = wedged()
    friction = np.full(4, 1.0)
    found = frictional_forces(compliance, offset, friction, np.zeros((4, 3)))
    gaps = (compliance @ found.ravel()).reshape(-1, 3) + offset
    assert law_residual(gaps, found, friction, 1.0) < 1e-7


def test_residuals_of_the_law_of_friction_are_stated():
    friction = np.array([0.5, 0.5, 0.5, np.inf])
    gaps = np.array([[0.0, 0.0, 0.0], [0.0, -1.0, 0.0], [1.0, 3.0, 0.0], [0.0, 0.0, 0.0]])
    force = np.array([[2.0, 0.0, 0.9], [2.0, 1.0, 0.0], [0.0, 0.0, 0.0], [-1.0, 5.0, 0.0]])
    assert law_residual(gaps, force, friction, 10.0) < 1e-12
    for place, value in [((0, 2), 1.1), ((1, 1), 0.9), ((1, 1), -1.0), ((2, 0), 0.1)]:
        other = force.copy()
        other[place] = value
        assert law_residual(gaps, other, friction, 10.0) > 0.005
    for place, value in [((0, 1), 0.1), ((1, 2), 1.0), ((0, 0), -0.1), ((3, 1), 0.1)]:
        other = gaps.copy()
        other[place] = value
        assert law_residual(other, force, friction, 10.0) > 0.005
    away = np.where(np.arange(4)[:, None] == 2, np.inf, gaps)
    assert law_residual(away, force, friction, 10.0) < 1e-12


def test_the_mesh_is_fine_along_the_way_of_a_tool_and_not_in_its_depth():
    times = np.linspace(0.0, 1.0, 41)
    deep = hyperelastic._along_surface(tool(depth=0.1, along=(0.0,)), times)
    assert len(deep) == 1
    aside = np.array(hyperelastic._along_surface(tool(depth=0.01, along=(0.03, 0.0)), times))
    assert len(aside) == 4  # of a way of four halves of a radius, at samples
    assert aside[:, 2] == pytest.approx(0.03)
    assert np.diff(np.sort(aside[:, 0])).min() >= 0.5 * RADIUS


SCENE = """
title = "A punch that rubs"
models = ["hyperelastic"]
[organ]
shape = "block"
size = ["60 mm", "60 mm", "40 mm"]
[support]
side = "inferior"
[tool]
shape = "punch"
radius = "20 mm"
friction = 0.3
place = { side = "superior", at = [0.5, 0.5] }
path = [
  { time = "0 s", travel = "0 mm" },
  { time = "0.2 s", travel = "2 mm" },
  { time = "0.4 s", offset = ["8 mm", "0 mm", "-2 mm"] },
]
[reference]
element_size = "30 mm"
steps_per_sample = 1
[time]
duration = "0.4 s"
samples = 17
"""


@pytest.mark.slow
def test_a_scene_with_a_punch_that_rubs_is_followed_with_errors_of_its_force(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE)
    scene = read_scene(str(path))
    (model,) = models_of(scene, {})
    prepared = model.prepare(problem_of(scene))
    prepared.refuse()
    found = prepared.run(SILENT)
    force = found.record.elements.contact.forces["tool"]
    assert found.trajectory.status == "finished"
    assert 0.0 < force.by_mesh < 0.5
    assert 0.0 < force.by_steps < 0.3
    on_tool = found.trajectory.tool_force[:, 0]
    normal, drag = on_tool[:, 2], -on_tool[:, 0]
    assert normal[1:].min() > 0.1
    assert (drag <= 0.3 * normal * (1.0 + 1e-6)).all()
    assert drag[-3:] == pytest.approx(0.3 * normal[-3:], rel=0.02)
    assert np.abs(drag[:9]).max() < 0.02 * normal.max()
