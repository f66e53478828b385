"""Rigid tools on a lattice: what is touched is stopped, nothing is pulled, and forces balance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from msm.damping import NodalDamping
from msm.stepper import LatticeStepper
from study.models.lattice import requested_step
from study.models.table import model
from study.scene.file import read_scene
from study.scene.problem import problem_of

SMALL = (
    'organ.size=["60 mm", "60 mm", "40 mm"]',
    'models=["tissue"]',
    "damping.ratio=0.3",
    "tool.shape=sphere",
    "tool.radius=20 mm",
    "tool.displacement=4 mm",
    "tool.history.ramp=0.2 s",
    "tool.history.hold=0.1 s",
    "tool.history.release=0.2 s",
    "time.duration=0.8 s",
    "time.samples=81",
)


def posed(*overrides, loads=()):
    scene = read_scene("block", (*SMALL, *overrides))
    problem = replace(problem_of(scene), loads=tuple(loads))
    return problem, model(scene, "tissue").prepare(problem)


def run(*overrides):
    problem, prepared = posed(*overrides)
    return problem, prepared, prepared._integrate(requested_step(prepared.model.lattice))


@pytest.fixture(scope="module")
def pressed():
    return run()


def along(problem, found):
    """Force [N] (samples,) of the first tool on the body along its axis."""
    return -found.trajectory.tool_force[:, 0] @ problem.rigid_tools[0].axis


def test_a_tool_pushes_and_lets_go_and_never_pulls(pressed):
    problem, _, found = pressed
    force, times = along(problem, found), problem.observation.times
    assert found.trajectory.status == "finished"
    assert force[0] == 0.0
    assert (force >= 0.0).all()
    assert force[(times > 0.19) & (times < 0.31)].min() > 0.5 * force.max() > 0.1
    assert (force[times > 0.6] == 0.0).all()


def test_what_is_touched_stays_outside_of_the_tool(pressed):
    _, _, found = pressed
    assert found.overlap < 1e-3 * 4e-3


@pytest.mark.parametrize("shape", ["sphere", "punch", "plate"])
def test_at_rest_the_support_bears_what_the_tool_does(shape):
    problem, prepared = posed(f"tool.shape={shape}", "tool.history.hold=5 s")
    stepper = stepper_of(prepared)
    stepper.t = 0.0
    dt = 0.8 * stepper.limit_at_rest
    while stepper.t < 2.0:
        stepper.advance(50, dt)
    reaction = (prepared.assembly.foundation @ stepper.u).sum(axis=0)
    force = -stepper.tool_force[0]
    assert force @ problem.rigid_tools[0].axis > 0.1
    assert np.linalg.norm(reaction - force) < 1e-3 * np.linalg.norm(force)


def stepper_of(prepared, **changed):
    assembly = replace(prepared.assembly, **changed)
    material = prepared.springs.material
    return LatticeStepper(assembly, material, prepared.problem.factor)


def test_the_force_is_the_change_of_momentum_and_the_reaction():
    """In every step m dv = dt (support + tool), without damping, whatever the springs do."""
    _, prepared = posed("damping.ratio=0")
    stepper, dt = stepper_of(prepared), 2e-4
    mass, support = prepared.assembly.mass, prepared.assembly.foundation
    stepper.advance(400, dt)
    for _ in range(20):
        before, borne = mass @ stepper.v, -(support @ stepper.u).sum(axis=0)
        stepper.advance(1, dt)
        gained = (mass @ stepper.v - before) / dt
        pushed = -stepper.tool_force[0]
        assert np.linalg.norm(pushed) > 1e-3
        assert gained == pytest.approx(borne + pushed, abs=1e-9 * np.linalg.norm(pushed) + 1e-12)


def energy(prepared, stepper):
    """Kinetic and elastic [J] of linear springs and the foundation."""
    u, v, springs = stepper.u, stepper.v, prepared.assembly.springs
    i, j = springs.ends.T
    stretched = np.linalg.norm(springs.rest + u[j] - u[i], axis=1) - springs.rest_length
    k = prepared.springs.material.law.k
    elastic = 0.5 * k * springs.weight @ stretched**2
    held = 0.5 * (u * (prepared.assembly.foundation @ u)).sum()
    return 0.5 * prepared.assembly.mass @ (v**2).sum(axis=1) + elastic + held


@pytest.mark.parametrize("friction", [0.0, 0.7])
def test_a_cycle_of_pressing_and_lifting_makes_no_energy(friction):
    """What the tool's work puts in is stored, or lost where what it meets is stopped."""
    _, prepared = posed("damping.ratio=0", f"tool.friction={friction}")
    tool, stepper = prepared.problem.rigid_tools[0], stepper_of(prepared)
    dt, work, worst, most = 2e-4, 0.0, 0.0, 0.0
    for step in range(3000):
        moved = np.diff(tool.travel(np.array([step * dt, (step + 1) * dt])), axis=0)[0]
        stepper.advance(1, dt)
        work -= stepper.tool_force[0] @ moved
        stored = energy(prepared, stepper)
        most, worst = max(most, stored), max(worst, stored - work)
    # Symplectic steps keep a nearby energy, not this one: it swings by a share of dt omega.
    assert worst < 0.01 * most
    assert 0.0 < energy(prepared, stepper) < work + 0.01 * most


def test_a_planted_loss_of_the_tools_impulse_is_seen():
    """The balance above notices a force that is told too small by a hundredth."""
    _, prepared = posed("damping.ratio=0")
    stepper, dt = stepper_of(prepared), 2e-4
    stepper.advance(400, dt)
    mass, support = prepared.assembly.mass, prepared.assembly.foundation
    before, borne = mass @ stepper.v, -(support @ stepper.u).sum(axis=0)
    stepper.advance(1, dt)
    gained = (mass @ stepper.v - before) / dt
    pushed = -0.99 * stepper.tool_force[0]
    assert gained != pytest.approx(borne + pushed, abs=1e-9 * np.linalg.norm(pushed) + 1e-12)


@pytest.mark.parametrize("damping", [NodalDamping(200.0), NodalDamping(0.0, 5e4)])
def test_what_damping_takes_of_the_momentum_is_not_told_as_the_tools(damping):
    """In every step m dv = dt (support + tool - c v), by eq. (2) and by eq. (9)."""
    _, prepared = posed()
    material = replace(prepared.springs.material, damping=damping)
    stepper, dt = LatticeStepper(prepared.assembly, material, prepared.problem.factor), 2e-4
    mass, support = prepared.assembly.mass, prepared.assembly.foundation
    stepper.advance(400, dt)
    for _ in range(20):
        before, borne = mass @ stepper.v, -(support @ stepper.u).sum(axis=0)
        stepper.advance(1, dt)
        away = np.linalg.norm(stepper.u, axis=1)
        drag = (mass * (damping.gamma_0 + damping.gamma_1 * away)) @ stepper.v
        gained, pushed = (mass @ stepper.v - before) / dt, -stepper.tool_force[0]
        assert gained == pytest.approx(borne + pushed - drag, abs=1e-3 * np.linalg.norm(pushed))


def gaps(prepared, tool, stepper):
    """Of all points of the surface [m], whether or not the kernels look at them."""
    loads = prepared.assembly.external_loads
    weights, _ = prepared.assembly.lattice.interpolation(loads.surface.points)
    return tool.gap(loads.surface.points + weights @ stepper.u, stepper.t)[0]


@pytest.mark.parametrize("shape", ["sphere", "plate"])
def test_no_point_of_the_surface_is_missed(shape):
    """By a tool that comes from afar: kernels look at points when it can have reached them."""
    fast = "tool.clearance=4 mm", "tool.displacement=8 mm", "tool.history.ramp=0.04 s"
    problem, prepared = posed(f"tool.shape={shape}", "damping.ratio=0", *fast)
    stepper = stepper_of(prepared)
    for _ in range(30):
        stepper.advance(10, 2e-4)
        assert -gaps(prepared, problem.rigid_tools[0], stepper).min() <= stepper.overlap + 1e-9
    assert -stepper.tool_force[0] @ problem.rigid_tools[0].axis > 0.1
    assert stepper.overlap < 1e-3 * 8e-3


def test_the_deepest_overlap_is_told_and_a_fifth_of_it_goes_in_a_step():
    """Of a sphere that starts a tenth of a millimetre inside."""
    problem, prepared = posed()
    loads, tool = prepared.assembly.external_loads, problem.rigid_tools[0]
    inside = replace(tool, tip=tool.tip + 1e-4 * tool.axis)
    stepper = stepper_of(prepared, external_loads=replace(loads, tools=(inside,)))
    started = -tool.gap(loads.surface.points - 1e-4 * tool.axis, 0.0)[0].min()
    stepper.advance(1, 1e-4)
    assert stepper.overlap == pytest.approx(0.8 * started, rel=1e-3)
    stepper.advance(20, 1e-4)
    assert stepper.overlap == pytest.approx(0.8 * started, rel=1e-3)
    assert -gaps(prepared, inside, stepper).min() < 0.8**20 * started + 1e-9


def test_both_paths_of_the_kernels_move_alike():
    """On the grid, and over the list of springs."""
    _, prepared = posed()
    on_grid, on_list = stepper_of(prepared), stepper_of(prepared)
    on_list.grids = None
    for stepper in (on_grid, on_list):
        stepper.advance(800, 2.5e-4)
    assert on_grid.grids is not None
    assert np.abs(on_grid.u - on_list.u).max() < 1e-7 * np.abs(on_list.u).max()
    assert on_grid.tool_force == pytest.approx(on_list.tool_force, rel=1e-3)


def test_halved_steps_halve_the_error():
    problem, prepared = posed()
    times = 0.2
    forces = []
    for dt in (4e-4, 2e-4, 1e-4, 2.5e-5):
        stepper = stepper_of(prepared)
        stepper.advance(round(times / dt), dt)
        forces.append(-stepper.tool_force[0] @ problem.rigid_tools[0].axis)
    errors = np.abs(np.array(forces[:3]) - forces[3])
    assert errors[0] < 0.05 * forces[3]
    assert errors[2] < 0.5 * errors[0]


@pytest.mark.parametrize("friction", [0.0, 0.3, 2.0])
def test_friction_is_coulombs_where_it_slides_and_less_where_it_sticks(friction):
    """A plate, whose normals are one, pressed on and then dragged along."""
    path = (
        'tool.path=[{time="0 s", travel="0 mm"}, {time="0.2 s", travel="2 mm"}, '
        '{time="0.8 s", offset=["6 mm", "0 mm", "-2 mm"]}]'
    )
    place = 'tool.place={side="superior", at=[0.5, 0.5]}'
    kept = [text for text in SMALL if "displacement" not in text and "history" not in text]
    scene = read_scene("block", (*kept, path, place, f"tool.friction={friction}"))
    problem = problem_of(replace(scene, tool=replace(scene.tool, shape="plate")))
    prepared = model(scene, "tissue").prepare(problem)
    found = prepared._integrate(requested_step(prepared.model.lattice))
    tool = problem.rigid_tools[0]
    force = -found.trajectory.tool_force[:, 0]
    pressing = force @ tool.axis
    across = np.linalg.norm(force - np.outer(pressing, tool.axis), axis=1)
    assert found.trajectory.status == "finished"
    assert pressing.max() > 0.5
    assert (across <= (friction + 1e-9) * pressing).all()
    late = problem.observation.times > 0.7
    if friction == 0.3:
        assert across[late] == pytest.approx(friction * pressing[late], rel=1e-3)
    if friction == 2.0:
        assert (across[late] < 0.9 * friction * pressing[late]).all()


def test_a_bonded_tool_holds_and_pulls():
    problem, _, found = run("tool.shape=punch", "tool.contact=bonded", "tool.displacement=-2 mm")
    force = along(problem, found)
    held = (problem.observation.times > 0.2) & (problem.observation.times < 0.3)
    assert (force[held] < -0.1).all()
    assert found.overlap < 1e-3 * 2e-3
    probe = found.trajectory.displacement[:, 0] @ problem.rigid_tools[0].axis
    assert probe[held] == pytest.approx(-2e-3, rel=1e-2)


def test_what_is_bonded_is_met_at_no_more_points_than_a_flat_tool():
    def points(*overrides):
        return len(posed(*overrides)[1].assembly.external_loads.surface.points)

    flat, bonded = points("tool.shape=punch"), points("tool.contact=bonded")
    assert points() > 2 * bonded == 2 * flat


def test_a_bonded_sphere_is_moved_to_the_end_by_any_step():
    """Many of its points hang on a node: what a solution leaves does not grow from step to step."""
    small = "tool.contact=bonded", "tool.radius=12 mm", "lattice.spacing=12 mm"
    brief = "tool.history.ramp=0.05 s", "time.duration=0.08 s", "time.samples=17"
    forces = []
    for fraction in (0.4, 0.2):
        problem, _, found = run(*small, *brief, f"lattice.step_fraction={fraction}")
        assert found.trajectory.status == "finished"
        assert found.overlap < 1e-2 * 4e-3
        forces.append(along(problem, found))
    assert forces[1].max() > 0.5
    assert np.abs(forces[0] - forces[1]).max() < 0.05 * forces[1].max()


def test_a_clearance_delays_the_touch(pressed):
    problem, _, found = run("tool.clearance=2 mm", "tool.displacement=6 mm")
    force, gap = along(problem, found), problem.rigid_tools[0].travel(problem.observation.times)
    depth = gap @ problem.rigid_tools[0].axis
    assert (force[depth < 1.9e-3] == 0.0).all()
    assert force.max() == pytest.approx(along(pressed[0], pressed[2]).max(), rel=0.05)


def test_a_tool_over_a_surface_that_is_not_square_to_it_starts_outside():
    problem, _ = posed("tool.direction=[0, 0.3, -0.9]", "tool.shape=punch")
    rule, tool = problem.surface_rule, problem.rigid_tools[0]
    gap, _ = tool.gap(rule.points, 0.0)
    assert gap.min() == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("integrator", ["velocity-verlet", "runge-kutta-4", "implicit-euler"])
def test_an_integrator_that_cannot_stop_at_tools_says_so(integrator):
    _, prepared = posed(f"lattice.integrator={integrator}")
    with pytest.raises(ValueError, match=r"lattice\.integrator to symplectic-euler"):
        prepared._integrate(requested_step(prepared.model.lattice))


def test_a_tool_through_the_body_ends_as_divergence():
    _, _, found = run("tool.displacement=60 mm", "tool.history.ramp=0.4 s")
    assert found.trajectory.status == "diverged"
    lost = found.trajectory.tool_force[-1, 0]
    assert np.isnan(lost).all()


def test_a_run_goes_on_to_the_same_bits(tmp_path):
    from msm.checkpoint import Checkpoint
    from msm.model import run as run_lattice

    _, prepared = posed()
    given = (prepared.assembly, prepared.springs.material, prepared.problem.factor)
    given += (prepared.problem.observation, requested_step(prepared.model.lattice))
    whole = run_lattice(*given)

    class Stopped(Exception):  # noqa: N818 - no error
        pass

    def stop(sample, *_):
        if sample == 30:
            raise Stopped

    kept = Checkpoint(tmp_path / "state.npz", seconds=0.0)
    with pytest.raises(Stopped):
        run_lattice(*given, on_sample=stop, checkpoint=kept)
    again = run_lattice(*given, checkpoint=replace(kept, resume=True))
    assert (again.trajectory.tool_force == whole.trajectory.tool_force).all()
    assert (again.trajectory.displacement == whole.trajectory.displacement).all()
    assert again.overlap == whole.overlap


@pytest.mark.parametrize(("shape", "times"), [("sphere", 1.64), ("punch", 1.50)])
def test_the_distance_from_the_half_space_is_the_one_that_is_told(shape, times):
    """Hertz's force, 4/3 E* sqrt(R) d^1.5, and that of a flat punch, 2 E* R d; docs/tools.md."""
    wide = ('organ.size=["120 mm", "120 mm", "80 mm"]', "support.stiffness=1 GPa/m")
    slow = ("tool.displacement=2 mm", "tool.history.ramp=0.1 s", "tool.history.hold=100 s")
    one = ("tissue.poisson_ratio=0.25", "reference.element_size=15 mm", "damping.ratio=0.5")
    problem, prepared = posed(*wide, *slow, *one, f"tool.shape={shape}")
    stepper = stepper_of(prepared)
    while stepper.t < 0.8:
        stepper.advance(50, 0.8 * stepper.limit_at_rest)
    modulus, radius, depth = 9.5e3 / (1.0 - 0.25**2), 0.02, 2e-3
    hertz = 4.0 / 3.0 * modulus * np.sqrt(radius) * depth**1.5
    exact = {"sphere": hertz, "punch": 2.0 * modulus * radius * depth}[shape]
    force = -stepper.tool_force[0] @ problem.rigid_tools[0].axis
    assert force / exact == pytest.approx(times, rel=0.01)
