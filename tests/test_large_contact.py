"""Rigid tools on neo-Hookean elements: derivatives, closed forms, press and lift, free fall."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from scipy.sparse import csc_array

from fem_reference.contact import large_motion
from fem_reference.contact.equilibrium import NoEquilibriumError
from fem_reference.contact.large_motion import (
    Integrator,
    contact_body,
    contact_problem,
    run,
)
from fem_reference.contact.motion import at_peak
from fem_reference.elasticity import discretise
from study.known.verification.finite_strain import uniaxial
from study.models import hyperelastic
from study.models.model import SILENT
from study.models.table import models_of
from study.organ.block import block_mesh
from study.problem.contact import Foundation, ToolPatch
from study.problem.damping import RayleighDamping
from study.problem.rigid import PLATE, PUNCH, SPHERE, RigidTool
from study.problem.tissue import Tissue
from study.problem.trajectory import Observation
from study.scene.file import read_scene
from study.scene.problem import problem_of

DOWN = np.array([0.0, 0.0, -1.0])
SIZE = (0.06, 0.06, 0.03)
TOP = np.array([0.03, 0.03, 0.03])
TISSUE = Tissue(poisson_ratio=0.45)
DAMPING = RayleighDamping(30.0)
NOTHING = np.zeros((0, 3))
EDGE = 0.04


def block(cell=0.015, tissue=TISSUE):
    blunt = ToolPatch(TOP, DOWN, 0.02, 0.0)
    base = Foundation(DOWN, 0.0, 1e-3, 1e7)
    return discretise(block_mesh(SIZE, cell), tissue, base, blunt, "taylor-hood")


def tool(shape=SPHERE, depth=3e-3, corners=(0.0, 0.1, 0.2, 0.3), **settings):
    """Pressed in, held and lifted again by as much again as it went in."""
    heights = np.array([0.0, depth, depth, -depth])[: len(corners)]

    def travel(times):
        return np.outer(np.interp(times, corners, heights), DOWN)

    return RigidTool("tool", shape, 0.015, TOP, DOWN, travel, **settings)


def observed(duration, samples, peak):
    frames = (peak, samples - 1)
    return Observation(np.linspace(0.0, duration, samples), TOP[None], frames, NOTHING, NOTHING)


def moved(body, one, seen, per_sample=1, damping=DAMPING):
    given = contact_problem(body, TISSUE, (one,), damping, np.zeros_like, seen.times)
    return given, run(body, given, seen, per_sample)


def at_rest(body, one, tissue=TISSUE, times=(0.0, 1.0)):
    given = contact_problem(body, tissue, (one,), DAMPING, np.zeros_like, np.array(times))
    return given, Integrator(given).peak_equilibrium(times[-1], np.zeros(given.body.solid.size))


def steady(depth, shape=SPHERE, **settings):
    return tool(shape, depth, (0.0, 1.0), **settings)


@pytest.mark.parametrize(
    "one",
    [steady(3e-3), steady(3e-3, PLATE), steady(3e-3, PUNCH), steady(1e-3, bonded=True)],
    ids=["sphere", "plate", "punch", "bonded"],
)
def test_derivatives_of_the_gaps(rng, one):
    """Of vertices under the tool; beside a punch a gap is infinite."""
    contact = contact_body(block(), TISSUE, (one,), np.array([0.0, 1.0])).contact
    u, du = 1e-3 * rng.standard_normal((2, contact.size))
    force = rng.random(len(contact.bonded))
    steps = 0.5 ** np.arange(2, 7)
    begun = contact.at(u, 1.0)
    G, bend, under = begun.derivative, begun.curvature(force), np.isfinite(begun.gaps)
    assert under.sum() > 3
    of_gaps, of_slope = [], []
    for h in steps:
        moved = contact.at(u + h * du, 1.0)
        off = moved.gaps[under] - begun.gaps[under] - h * (G @ du)[under]
        of_gaps.append(np.linalg.norm(off))
        turned = moved.derivative.T @ force - G.T @ force
        of_slope.append(np.linalg.norm(turned - h * (bend @ du)))
    for off in (of_gaps, of_slope):
        if max(off) > 1e-12:  # of a bonded tool they are linear
            assert np.polyfit(np.log(steps), np.log(off), 1)[0] == pytest.approx(2.0, abs=0.3)


@pytest.mark.parametrize(("shape", "bonded"), [(PLATE, False), (PUNCH, False), (PLATE, True)])
def test_gaps_of_flat_faces_are_the_ways_of_body_and_tool(shape, bonded):
    """3 mm of the tool after 1 mm of the body as a whole, both from the middle of its top."""
    one = steady(3e-3, shape, bonded=bonded)
    contact = contact_body(block(), TISSUE, (one,), np.array([0.0, 1.0])).contact
    gaps = contact.at(np.tile(1e-3 * DOWN, contact.size // 3), 1.0).gaps
    if bonded:
        assert gaps.reshape(-1, 3) == pytest.approx(np.tile(-2e-3 * DOWN, (len(gaps) // 3, 1)))
    else:
        assert gaps[np.isfinite(gaps)] == pytest.approx(-2e-3)
        assert np.isfinite(gaps).sum() > 3


def test_the_body_has_a_potential_whose_second_derivative_is_its_tangent(rng):
    """With a part of the volume's stiffness at each point beside the pressure's."""
    solid = contact_body(block(), TISSUE, (), np.array([0.0, 1.0])).solid
    assert np.min(solid.pointwise) > 0.0
    w, dw = rng.standard_normal((2, solid.size + solid.pressures))
    scale = np.where(np.arange(len(w)) < solid.size, 3e-4, 50.0)
    w, dw = scale * w, scale * dw
    g, K, steps = solid.gradient(w), solid.tangent(w), 0.5 ** np.arange(3, 7)
    off = [np.linalg.norm(solid.gradient(w + h * dw) - g - h * (K @ dw)) for h in steps]
    assert abs(K - K.T).max() < 1e-12 * abs(K).max()
    assert np.polyfit(np.log(steps), np.log(off), 1)[0] == pytest.approx(2.0, abs=0.1)
    # Where no pressure acts, forces are the derivative of what is stored.
    w[solid.size :] = dw[solid.size :] = 0.0
    h, force = 1e-4, solid.gradient(w)
    bare = [solid.energy(w + s * h * dw) for s in (1.0, -1.0)]
    assert (bare[0] - bare[1]) / (2.0 * h) == pytest.approx(force @ dw, rel=1e-5)


def test_forces_of_body_and_tool_are_in_balance(rng):
    contact = contact_body(block(), TISSUE, (steady(3e-3),), np.array([0.0, 1.0])).contact
    u, force = 1e-3 * rng.standard_normal(contact.size), rng.random(len(contact.bonded))
    met = contact.at(u, 1.0)
    on_body = (met.derivative.T @ force).reshape(-1, 3).sum(axis=0)
    assert met.tool_forces(force)[0] == pytest.approx(-on_body)


@pytest.mark.parametrize("nu", [0.3, 0.499])
def test_frictionless_plates_take_the_closed_form(nu):
    """An eighth of a block, the plate pressed on it by contact alone."""
    tissue = Tissue(poisson_ratio=nu)
    blunt = ToolPatch(np.full(3, EDGE), DOWN, EDGE, 0.0)
    mesh = block_mesh((EDGE,) * 3, 0.5 * EDGE)
    bare = discretise(mesh, tissue, Foundation(DOWN, 0.0, 1e-3, 1.0), blunt, "taylor-hood")
    nothing = csc_array(bare.support.shape)
    body = replace(bare, support=nothing, fixed=(bare.points < 1e-9).ravel())
    plate = replace(steady(0.3 * EDGE, PLATE), tip=np.array([0.0, 0.0, EDGE]))
    given, state = at_rest(body, plate, tissue)
    lateral, stress = uniaxial(tissue, 0.7)
    exact = body.points * (np.array([lateral, lateral, 0.7]) - 1.0)
    found = given.body.given(state.w).reshape(-1, 3)
    assert np.abs(found - exact).max() < 1e-5 * EDGE
    assert given.tool_forces(state)[0] @ DOWN == pytest.approx(stress * EDGE**2, rel=1e-4)


@pytest.mark.parametrize("bonded", [False, True])
def test_small_strains_are_those_of_the_linear_reference(bonded, monkeypatch):
    """Exactly, where all of the volume goes by the pressure; else up to what the mesh costs."""
    body, plate = block(), steady(1e-5, PLATE, bonded=bonded)
    linear = at_peak(body, (plate,), observed(1.0, 3, 2)).forces[0] @ DOWN
    given, state = at_rest(body, plate)
    assert given.tool_forces(state)[0] @ DOWN == pytest.approx(linear, rel=2e-2)
    with monkeypatch.context() as bare:
        bare.setattr(large_motion, "POINTWISE", 0.0)
        given, state = at_rest(body, plate)
    assert given.tool_forces(state)[0] @ DOWN == pytest.approx(linear, rel=1e-3)
    # Of ten per cent the law makes more than of a thousandth.
    deep, far = at_rest(body, steady(3e-3, PLATE, bonded=bonded))
    assert abs(deep.tool_forces(far)[0] @ DOWN / (300.0 * linear) - 1.0) > 0.03


@pytest.fixture(scope="module")
def cycle():
    """A sphere that goes in and out smoothly, and leaves."""

    def travel(times):
        return np.outer(3e-3 * np.sin(np.pi * np.minimum(times / 0.2, 1.25)), DOWN)

    body, seen = block(), observed(0.3, 61, 20)
    sphere = replace(tool(), travel=travel)
    return [moved(body, sphere, seen, n) for n in (1, 2)], body, sphere, seen


def test_a_body_is_pushed_and_never_pulled(cycle):
    found = cycle[0][0][1].trajectory
    force = found.tool_force[:, 0] @ DOWN
    assert found.status == "finished"
    assert force.min() < -0.1
    assert force.max() <= 1e-12
    assert (found.tool_force[-8:] == 0.0).all()
    assert np.abs(found.displacement[-1]).max() < 0.05 * np.abs(found.displacement).max()


def test_the_tools_work_is_stored_or_damped(cycle):
    """Up to the steps' error, which falls as they are halved."""
    off = []
    for given, found in cycle[0]:
        body, sphere, seen = cycle[1:]
        force = -found.trajectory.tool_force[:, 0]
        steps = 0.5 * (force[1:] + force[:-1]) * np.diff(sphere.travel(seen.times), axis=0)
        work = np.append(0.0, np.cumsum(steps.sum(axis=1)))
        power = [DAMPING.mass * float(one.v @ (body.mass @ one.v)) for one in found.states]
        taken = cumulative_trapezoid(power, seen.times, initial=0.0)
        held = [given.energy(one) for one in found.states]
        off.append(np.abs(taken + held - work).max() / work.max())
    assert off[1] < 0.03
    assert off[1] < off[0]


def test_halved_steps_change_the_force_little(cycle):
    whole, half = (one[1].trajectory.tool_force for one in cycle[0])
    assert 0.0 < np.linalg.norm(whole - half) < 0.1 * np.linalg.norm(half)


def test_a_guess_extrapolates_two_states_unless_that_inverts_elements():
    """Compressed evenly by 0.4 in a second: by 0.6 after one and a half, by 1.2 after three."""
    body = block()
    seen = np.array([0.0, 1.0])
    given = contact_problem(body, TISSUE, (steady(3e-3),), DAMPING, np.zeros_like, seen)
    integrator, size = Integrator(given), given.body.solid.size
    rest = integrator.start()
    w = rest.w.copy()
    w[:size] = (-0.4 * body.points * -DOWN).ravel()
    now = rest._replace(time=1.0, w=w)
    assert integrator._extrapolated(rest, now, 1.5).w == pytest.approx(1.5 * w - 0.5 * rest.w)
    assert (integrator._extrapolated(rest, now, 3.0).w == w).all()
    assert (integrator._extrapolated(now, now, 1.5).w == w).all()


def test_what_a_tool_hits_moves_with_the_tool():
    """A stage that starts off the tool makes up for what it missed by a velocity of its own."""
    speed, step = 0.03, 0.0125
    body, sphere = block(), tool(depth=speed * 0.1, corners=(0.0, 0.1))
    given = contact_problem(body, TISSUE, (sphere,), DAMPING, np.zeros_like, np.array([0.0, 0.1]))
    steps, contact, seen = Integrator(given), given.body.contact, 0
    for count, state in enumerate(steps.march(steps.start(), step)):
        u, closed = given.body.given(state.w), state.force > 0.0
        now, then = (contact.at(u, t, state.previous) for t in (state.time, state.time - 1e-6))
        pushed, nearer = now.derivative[closed] @ state.v, (now.gaps - then.gaps) / 1e-6
        assert pushed == pytest.approx(-nearer[closed], abs=0.01 * speed)
        seen += int(closed.sum())
        if count == 8:
            break
    assert seen > 2


def test_a_tool_that_is_held_ends_at_rest():
    body, sphere, seen = block(), tool(corners=(0.0, 0.1, 1.0)), observed(1.0, 41, 40)
    given, found = moved(body, sphere, seen)
    rest = Integrator(given).peak_equilibrium(1.0, np.zeros(given.body.solid.size))
    assert found.trajectory.tool_force[-1] == pytest.approx(given.tool_forces(rest), rel=1e-3)


def test_a_body_falls_freely():
    """By g t^2 / 2, with neither strain nor rotation."""
    bare, g = block(), np.array([1.0, 2.0, -9.81])
    load = np.asarray(bare.mass @ np.tile(g, bare.node_count))
    body = replace(bare, support=csc_array(bare.support.shape), load=load)
    seen = observed(0.1, 11, 10)
    given = contact_problem(body, TISSUE, (), RayleighDamping(0.0), np.ones_like, seen.times)
    found = run(body, given, seen, 1)
    exact = 0.5 * np.outer(seen.times**2, g)
    assert found.trajectory.displacement[:, 0] == pytest.approx(exact, abs=1e-6)
    assert found.trajectory.velocity[-1, 0] == pytest.approx(0.1 * g, rel=1e-4)
    assert found.largest_strain < 1e-4


def test_an_unloaded_shape_sags_into_the_given_one():
    body = block()
    weight = np.asarray(body.mass @ np.tile([3.0, 0.0, -9.81], body.node_count))
    given = contact_problem(body, TISSUE, (), DAMPING, np.zeros_like, np.array([0.0, 1.0]), weight)
    sagged = np.abs(given.body.origin).max()
    assert sagged > 1e-4
    start = Integrator(given).start()
    assert np.abs(given.body.given(start.w)).max() < 1e-5 * sagged
    # Without the weight it springs back.
    free = Integrator(replace(given, dead=np.zeros_like(weight))).start()
    assert np.abs(free.w[: len(weight)]).max() < 1e-3 * sagged


def test_a_tool_through_the_body_ends_the_motion_and_says_when():
    body, sphere = block(), tool(depth=0.2, corners=(0.0, 0.02, 0.3))
    found = moved(body, sphere, observed(0.3, 61, 10))[1].trajectory
    assert found.status == "diverged"
    assert 0.0 < found.ended_at < 0.1
    assert np.isnan(found.tool_force[-1]).all()
    with pytest.raises(NoEquilibriumError):
        at_rest(body, steady(0.2))


def wrapped(given, side, radius=0.0145):
    """Displacement that lays the surface round a sphere from its lowest (-1) or highest point."""
    offset = given.body.solid.points - TOP
    away = np.linalg.norm(offset[:, :2], axis=1)
    angle = 1.7 * away / 0.015
    across = radius * np.sin(angle) / np.maximum(away, 1e-12)
    centre = TOP + 0.015 * (DOWN * 1.2 - DOWN)
    moved = centre + np.column_stack(
        [across[:, None] * offset[:, :2], side * radius * np.cos(angle)]
    )
    top = np.isclose(offset[:, 2], 0.0)
    return np.where(top[:, None], moved - given.body.solid.points, 0.0).ravel()


def test_what_closes_round_a_sphere_has_not_been_passed_by_it():
    """It is pushed against the sphere's own axis there, as it is after a passage."""
    sphere = tool(depth=0.018, corners=(0.0, 1.0))
    given = contact_problem(
        block(), TISSUE, (sphere,), DAMPING, np.zeros_like, np.array([0.0, 1.0])
    )
    contact, patch = given.body.contact, given.body.contact.patches[0]
    u = wrapped(given, -1.0)
    distance, normal = sphere.gap(patch.points + patch.shapes @ u.reshape(-1, 3), 1.0)
    assert (normal @ DOWN).min() < -0.1
    assert distance.max() < 0.0
    assert not contact.at(u, 1.0).passed_through
    assert contact.at(wrapped(given, 1.0), 1.0).passed_through
    assert not contact.at(wrapped(given, 1.0, 0.025), 1.0).passed_through  # nothing is inside


def test_normals_turn_with_the_body():
    given = contact_problem(
        block(), TISSUE, (tool(),), DAMPING, np.zeros_like, np.array([0.0, 1.0])
    )
    patch, points = given.body.contact.patches[0], given.body.solid.points
    turn = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    stretched = points * [2.0, 1.0, 0.5]
    assert patch.outward(np.zeros_like(points)) == pytest.approx(
        np.tile(-DOWN, (len(patch.points), 1))
    )
    found = patch.outward(stretched @ turn.T - points)
    assert found == pytest.approx(np.tile(turn @ -DOWN, (len(patch.points), 1)))


@pytest.mark.parametrize(
    ("one", "damping", "nu", "key"),
    [
        (tool(), RayleighDamping(1.0, 1e-3), 0.4, r"damping\.stiffness"),
        (tool(), DAMPING, 0.0, r"tissue\.poisson_ratio"),
    ],
)
def test_what_cannot_be_followed_is_refused(one, damping, nu, key):
    tissue = Tissue(poisson_ratio=nu)
    with pytest.raises(ValueError, match=key):
        contact_problem(
            block(tissue=tissue), tissue, (one,), damping, np.zeros_like, np.arange(2.0)
        )


def test_a_bonded_punch_may_pull():
    given, state = at_rest(block(), steady(-1e-3, PUNCH, bonded=True))
    assert given.tool_forces(state)[0] @ DOWN > 0.01


SCENE = (
    'organ.size=["60 mm", "60 mm", "40 mm"]',
    "tool.shape=sphere",
    "tool.radius=20 mm",
    "tool.displacement=4 mm",
    "reference.element_size=20 mm",
    "time.samples=21",
    "time.duration=0.5 s",
    "tool.history.ramp=0.2 s",
    "tool.history.hold=0.1 s",
    "tool.history.release=0.15 s",
)


@pytest.mark.slow
def test_as_a_model_it_states_its_errors_and_agrees_with_the_linear_rest(monkeypatch):
    monkeypatch.setattr(hyperelastic, "OWN_STEPS", 20)
    scene = read_scene("block", ('models=["hyperelastic"]', *SCENE))
    problem = problem_of(scene)
    (one,) = models_of(scene, {})
    prepared = one.prepare(problem)
    prepared.refuse()
    found = prepared.run(SILENT)
    elements = found.record.elements
    force = elements.contact.forces["tool"]
    assert elements.law == "neo-hookean"
    assert 0.0 < force.by_mesh < 0.5
    assert 0.0 < force.by_steps < 0.1
    assert force.by_subspace is None
    peak = problem.observation.frames[0]
    linear = at_peak(prepared.best.body, problem.rigid_tools, problem.observation).forces[0]
    moved = found.trajectory.tool_force[peak, 0]
    assert np.linalg.norm(moved - linear) < force.by_mesh * np.linalg.norm(linear)
