"""Rigid tools against the finite elements: the law of contact, closed forms, press and lift."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from scipy.spatial import cKDTree

from fem_reference import model as fem
from fem_reference.contact import large_motion, law
from fem_reference.contact.law import ComplementarityProblem, frictional_forces, frictionless_forces
from fem_reference.contact.motion import ContactProblem, at_peak, run
from fem_reference.contact.patch import patch
from fem_reference.contact.reduction import contact_response, krylov, reduced
from fem_reference.elasticity import discretise
from fem_reference.external_loads import ExternalLoads, with_external_loads
from study.known import pressed
from study.known.pressed import DOWN
from study.known.verification import indentation
from study.organ.block import block_mesh
from study.problem.contact import Foundation, ToolPatch, Weight
from study.problem.damping import RayleighDamping
from study.problem.rigid import PLATE, PUNCH, SPHERE, RigidTool
from study.problem.tissue import Tissue
from study.problem.trajectory import Observation
from study.scene.file import read_scene

SIZE = (0.06, 0.06, 0.03)
TOP = np.array([0.03, 0.03, 0.03])
TISSUE = Tissue(poisson_ratio=0.4)
DAMPING = RayleighDamping(30.0)
NOTHING = np.zeros((0, 3))
ASIDE = np.array([1.0, 0.0, 0.0])


def observed(duration, samples, peak):
    return Observation(
        np.linspace(0.0, duration, samples), TOP[None], (peak, samples - 1), NOTHING, NOTHING
    )


def block(cell=0.015, nu=0.4):
    mesh = block_mesh(SIZE, cell)
    blunt = ToolPatch(TOP, DOWN, 0.02, 0.0)
    tissue = Tissue(poisson_ratio=nu)
    return discretise(mesh, tissue, Foundation(DOWN, 0.0, 1e-3, 1e7), blunt, "p2")


def tool(shape=SPHERE, depth=3e-3, corners=(0.0, 0.1, 0.2, 0.3), **settings):
    """Pressed in, held and lifted again by as much again as it went in."""
    heights = np.array([0.0, depth, depth, -depth])[: len(corners)]

    def travel(times):
        return np.outer(np.interp(times, corners, heights), DOWN)

    return RigidTool("tool", shape, 0.015, TOP, DOWN, travel, **settings)


@pytest.fixture(scope="module")
def cycle():
    body, sphere = block(), tool()
    return body, run(body, (sphere,), DAMPING, np.zeros_like, observed(0.4, 81, 40), fem.Method())


def test_a_body_is_pushed_and_never_pulled(cycle):
    force = cycle[1].trajectory.tool_force[:, 0] @ DOWN
    assert force.min() < -0.01
    assert force.max() <= 1e-12


def test_a_lifted_tool_is_left_and_the_body_comes_to_rest(cycle):
    found = cycle[1].trajectory
    assert (found.tool_force[-10:] == 0.0).all()
    assert np.abs(found.displacement[-1]).max() < 0.05 * np.abs(found.displacement).max()


def test_the_tools_work_is_what_damping_takes():
    """Of a punch that goes in and out smoothly, at every sample beside the largest work."""
    body, times = block(), np.linspace(0.0, 0.4, 161)
    nothing = np.zeros(len(body.load))

    def travel(at):
        return np.outer(1.5e-3 * (1.0 - np.cos(2.0 * np.pi * np.minimum(at / 0.3, 1.0))), DOWN)

    punch = RigidTool("tool", PUNCH, 0.015, TOP, DOWN, travel)
    given = contact_response(body, (punch,), times, nothing, 0.15)
    pressing = ContactProblem(given, DAMPING, np.zeros_like, nothing, times, 2)
    among = reduced(given, krylov(given, 3), pressing.highest)
    states = pressing.sampled(among, lambda _: None).states
    force = np.array([-given.contact.tool_forces(one.solution.force)[0] for one in states])
    steps = 0.5 * (force[1:] + force[:-1]) * np.diff(travel(times), axis=0)
    work = np.append(0.0, np.cumsum(steps.sum(axis=1)))
    power = [DAMPING.mass * float(one.v @ one.v) for one in states]
    taken = cumulative_trapezoid(power, times, initial=0.0)
    count = len(among.contact_modes)  # beside them stand the loads, which are nought
    dents = given.contact.nodal_forces.T @ among.residual[:, :count]
    stored = [one.r[:count] @ dents @ one.r[:count] for one in states]
    held = [
        0.5 * float(one.v @ one.v + among.squares @ one.q**2 + part)
        for one, part in zip(states, stored, strict=True)
    ]
    assert work.max() > 2.0 * work[-1] > 0.0  # most of it comes back
    assert taken + held == pytest.approx(work, abs=0.02 * work.max())


def test_a_tool_that_is_held_ends_at_rest():
    body, sphere = block(), tool(corners=(0.0, 0.1, 1.0))
    seen = observed(1.0, 41, 40)
    moved = run(body, (sphere,), DAMPING, np.zeros_like, seen, fem.Method())
    rest = at_peak(body, (sphere,), seen)
    assert moved.trajectory.tool_force[-1] == pytest.approx(rest.forces, rel=1e-3, abs=1e-6)


def test_halving_the_steps_changes_the_force_little(cycle):
    body, found = cycle
    half = run(
        body, (tool(),), DAMPING, np.zeros_like, observed(0.4, 81, 40), fem.Method(times=2)
    ).trajectory.tool_force
    change = np.linalg.norm(found.trajectory.tool_force - half) / np.linalg.norm(half)
    assert 0.0 < change < 0.1


@pytest.mark.parametrize("shape", [SPHERE, PUNCH, PLATE])
def test_the_support_takes_what_a_tool_gives(shape):
    body = block()
    rest = at_peak(body, (tool(shape, depth=1e-3),), observed(0.4, 41, 15))
    taken = (body.support @ rest.displacement).reshape(-1, 3).sum(axis=0)
    assert rest.forces[0] == pytest.approx(-rest.nodal_forces[0].reshape(-1, 3).sum(axis=0))
    assert taken @ DOWN == pytest.approx(-(rest.forces[0] @ DOWN), rel=1e-6)


class Clamped:
    """A support that fixes the base, and what else a condition on its points tells."""

    def __init__(self, also):
        self.also = also

    def density(self, points, normals):
        return np.zeros(np.broadcast_shapes(points.shape, normals.shape)[:-1])

    def fixed(self, points, normals):
        held = (normals @ DOWN > 0.9) | self.also(points)
        return np.repeat(held[..., None], 3, axis=-1)


@pytest.mark.parametrize("tops", [0.0, 0.016], ids=["a side", "a side and part of the top"])
def test_what_is_clamped_stays_under_a_tool_and_bears_what_reaches_it(tops):
    """A plate presses on a block up to its clamped side, and beyond on what is clamped itself."""
    clamped = Clamped(lambda x: (x[..., 0] < 1e-9) | ((x[..., 2] > 0.029) & (x[..., 0] < tops)))
    blunt = ToolPatch(TOP, DOWN, 0.02, 0.0)
    body = discretise(block_mesh(SIZE, 0.015), TISSUE, clamped, blunt, "p2")
    rest = at_peak(body, (tool(PLATE, depth=1e-3),), observed(0.4, 41, 15))
    assert not rest.displacement[body.fixed].any()
    pushed = np.where(body.fixed, 0.0, rest.nodal_forces[0])
    assert body.stiffness @ rest.displacement == pytest.approx(pushed, abs=1e-9)
    assert -(rest.forces[0] @ DOWN) > 0.5


def test_beside_what_is_clamped_large_strain_has_the_force_of_small_as_its_limit(monkeypatch):
    """Two solvers that share the patch alone, the one with free unknowns, the other with all."""
    monkeypatch.setattr(large_motion, "POINTWISE", 0.0)  # the elements of small strain
    clamped = Clamped(lambda x: (x[..., 0] < 1e-9) | ((x[..., 2] > 0.029) & (x[..., 0] < 0.016)))
    blunt = ToolPatch(TOP, DOWN, 0.02, 0.0)
    body = discretise(block_mesh(SIZE, 0.015), TISSUE, clamped, blunt, "taylor-hood")
    plate = tool(PLATE, depth=1e-5)
    linear = at_peak(body, (plate,), observed(0.4, 41, 15)).forces[0] @ DOWN
    given = large_motion.contact_problem(
        body, TISSUE, (plate,), DAMPING, np.zeros_like, np.linspace(0.0, 0.2, 5)
    )
    state = large_motion.Integrator(given).peak_equilibrium(0.15, np.zeros(given.body.solid.size))
    assert given.tool_forces(state)[0] @ DOWN == pytest.approx(linear, rel=2e-3)


def test_a_tool_on_nothing_but_what_is_clamped_is_refused():
    clamped = Clamped(lambda x: x[..., 2] > 0.029)
    body = discretise(
        block_mesh(SIZE, 0.015), TISSUE, clamped, ToolPatch(TOP, DOWN, 0.02, 0.0), "p2"
    )
    with pytest.raises(ValueError, match=r"tool: touches only what the support fixes; move tool"):
        at_peak(body, (tool(),), observed(0.4, 41, 15))


def test_a_plate_on_a_column_is_uniaxial_compression():
    """Force E A d / L of a column of nu 0 that is shortened by d in all, its base held stiffly."""
    tissue = Tissue(poisson_ratio=0.0)
    stiff = 1e9
    mesh = block_mesh((0.04, 0.04, 0.06), 0.02)
    blunt = ToolPatch(np.array([0.02, 0.02, 0.06]), DOWN, 0.03, 0.0)
    body = discretise(mesh, tissue, Foundation(DOWN, 0.0, 1e-3, stiff), blunt, "p2")

    def travel(times):
        return np.outer(times, 1e-3 * DOWN)

    plate = RigidTool("tool", PLATE, 1.0, np.array([0.02, 0.02, 0.06]), DOWN, travel)
    found = at_peak(body, (plate,), observed(1.0, 3, 2)).forces[0] @ DOWN
    exact = -(0.04**2) * 1e-3 / (0.06 / tissue.youngs_modulus + 1.0 / stiff)
    assert found == pytest.approx(exact, rel=1e-6)


def test_a_column_damped_by_its_stiffness_resists_as_kelvin_and_voigt_have_it():
    """Pressed evenly, by E A / L (d + beta v) with its support, once what was set off is over."""
    beta, speed, stiff = 0.05, 1e-3, 1e9
    tissue, top = Tissue(poisson_ratio=0.0), np.array([0.02, 0.02, 0.06])
    mesh, blunt = block_mesh((0.04, 0.04, 0.06), 0.02), ToolPatch(top, DOWN, 0.03, 0.0)
    body = discretise(mesh, tissue, Foundation(DOWN, 0.0, 1e-3, stiff), blunt, "p2")
    plate = RigidTool("tool", PLATE, 1.0, top, DOWN, lambda t: np.outer(speed * t, DOWN))
    seen = observed(1.0, 41, 40)
    moved = run(body, (plate,), RayleighDamping(0.0, beta), np.zeros_like, seen, fem.Method())
    found = moved.trajectory.tool_force[20:, 0] @ DOWN
    stiffness = 0.04**2 / (0.06 / tissue.youngs_modulus + 1.0 / stiff)
    assert found == pytest.approx(-stiffness * speed * (seen.times[20:] + beta), rel=5e-3)


def test_a_bonded_tool_pulls_as_it_pushes():
    body, seen = block(), observed(0.1, 3, 2)
    push, pull = (
        at_peak(body, (tool(PUNCH, depth=d, corners=(0.0, 0.1), bonded=True),), seen).forces[0]
        for d in (1e-3, -1e-3)
    )
    assert push == pytest.approx(-pull, rel=1e-9)
    free = at_peak(body, (tool(PUNCH, depth=-1e-3, corners=(0.0, 0.1)),), seen).forces
    assert (free == 0.0).all()


@pytest.mark.parametrize("friction", [0.3, 2.0])
def test_friction_stays_inside_its_cone(friction):
    """A sphere that is pressed in and dragged aside."""
    aside = np.array([1.0, 0.0, 0.0])

    def travel(times):
        down = np.interp(times, [0.0, 0.5], [0.0, 2e-3])
        along = np.interp(times, [0.5, 1.0], [0.0, 1e-3])
        return np.outer(down, DOWN) + np.outer(along, aside)

    sphere = RigidTool("tool", SPHERE, 0.015, TOP, DOWN, travel, friction=friction)
    body, seen = block(), observed(1.0, 9, 8)
    found = at_peak(body, (sphere,), seen).forces[0]
    smooth = at_peak(body, (RigidTool("tool", SPHERE, 0.015, TOP, DOWN, travel),), seen).forces[0]
    assert found[0] < smooth[0] - 1e-3  # dragged back by what it rubs on
    assert abs(found[0]) < 1.5 * (friction + 0.2) * abs(found[2])


def turned(one, Q):
    """A tool and its way in axes that are turned."""
    return replace(one, tip=Q @ one.tip, axis=Q @ one.axis, travel=lambda t: one.travel(t) @ Q.T)


def rubbing(shape, friction, along=(0.0, 1e-3), **settings):
    """Pressed in by 2 mm until a half, then dragged from one place to the next."""
    corners = np.linspace(0.5, 1.0, len(along))

    def travel(times):
        down = np.interp(times, [0.0, 0.5], [0.0, 2e-3])
        return np.outer(down, DOWN) + np.outer(np.interp(times, corners, along), ASIDE)

    return replace(tool(shape, friction=friction, **settings), travel=travel)


@pytest.mark.parametrize(("shape", "friction"), [(SPHERE, 0.3), (PUNCH, 0.3), (PUNCH, 0.0)])
def test_a_problem_in_turned_axes_has_turned_forces(shape, friction):
    """The tool's axis, its normals and the way that it slips are its own."""
    one = rubbing(shape, friction)
    Q, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    Q *= np.linalg.det(Q)
    mesh = block_mesh(SIZE, 0.015)
    blunt, base = ToolPatch(Q @ TOP, Q @ DOWN, 0.02, 0.0), Foundation(Q @ DOWN, 0.0, 1e-3, 1e7)
    body = discretise(replace(mesh, points=mesh.points @ Q.T), TISSUE, base, blunt, "p2")
    seen = observed(1.0, 9, 8)
    found = at_peak(body, (turned(one, Q),), seen).forces[0]
    exact = at_peak(block(), (one,), seen).forces[0]
    assert (abs(exact[0]) > 0.05 * abs(exact[2])) == (friction > 0.0)
    assert found == pytest.approx(Q @ exact, abs=1e-4 * np.linalg.norm(exact))


@pytest.mark.parametrize("shape", [SPHERE, PUNCH])
def test_hardly_any_friction_is_as_none(shape):
    """Two laws, of normals alone and with tangents, agree where both hold."""
    seen = observed(1.0, 9, 8)
    none, little = (at_peak(block(), (rubbing(shape, mu),), seen).forces[0] for mu in (0.0, 1e-7))
    assert little == pytest.approx(none, abs=1e-4 * np.linalg.norm(none))


def test_friction_remembers_the_way():
    """Of a tool that went aside and came back, it holds against the way back."""
    seen = observed(1.0, 9, 8)
    found = at_peak(block(), (rubbing(PUNCH, 0.3, (0.0, 4e-3, 0.0)),), seen).forces[0]
    assert found[0] > 0.1 * abs(found[2])


def test_the_edge_of_a_punch_stays_where_it_was_on_a_linear_body():
    """What moves aside takes neither more nor less of the surface under it."""
    given = patch(block(), tool(PUNCH), np.zeros(1), 0.015)
    nodes = given.shapes.shape[1]
    lifted, aside = np.zeros((2, nodes, 3))
    lifted[:, 2] = aside[:, 2] = 1e-3
    aside[:, 0] = 0.01
    still, moved = given.gaps(lifted, 0.0), given.gaps(aside, 0.0)
    assert still.distance == pytest.approx(np.full(given.count, -1e-3))
    assert (moved.distance == still.distance).all()


def test_a_bonded_tool_is_the_same_beside_one_that_could_rub():
    """The law with tangents holds it as that of normals alone does."""
    held = rubbing(PUNCH, 0.0, bonded=True, depth=1e-3)
    lifted = replace(rubbing(SPHERE, 0.5), radius=0.01, tip=TOP + 0.02 * ASIDE)
    lifted = replace(lifted, name="lifted", travel=lambda t: np.outer(-1e-3 * t, DOWN))
    held = replace(held, radius=0.01, tip=TOP - 0.015 * ASIDE)
    seen = observed(1.0, 9, 8)
    both, alone = (at_peak(block(), tools, seen).forces for tools in ((held, lifted), (held,)))
    assert abs(alone[0, 0]) > 0.05 * abs(alone[0, 2])
    assert both[0] == pytest.approx(alone[0], rel=1e-4)
    assert (both[1] == 0.0).all()


def test_each_tool_has_its_own_friction():
    """Whichever comes first."""
    rough, smooth = (
        replace(rubbing(SPHERE, mu, (0.0, 2e-3)), name=name, radius=0.012, tip=TOP + side * ASIDE)
        for mu, name, side in ((0.5, "rough", -0.015), (0.0, "smooth", 0.015))
    )
    seen = observed(1.0, 9, 8)
    found = at_peak(block(), (rough, smooth), seen).forces
    other = at_peak(block(), (smooth, rough), seen).forces
    assert found == pytest.approx(other[::-1], abs=1e-4 * np.abs(found).max())
    assert found[0, 0] - found[1, 0] < -0.05 * found[0, 2]


def lopsided(cell, one):
    """Difference of the vertices' displacement from its mirror image, over it, and of the force."""
    body = block(cell)
    rest, count = at_peak(body, (one,), observed(0.4, 41, 15)), len(body.mesh.points)
    x, u = body.points[:count], rest.displacement.reshape(-1, 3)[:count]
    _, image = cKDTree(x).query(np.array([SIZE[0], 0.0, 0.0]) + [-1.0, 1.0, 1.0] * x)
    off = np.linalg.norm(u - [-1.0, 1.0, 1.0] * u[image]) / np.linalg.norm(u)
    return off, abs(rest.forces[0, 0] / rest.forces[0, 2])


def test_a_symmetric_contact_is_as_lopsided_as_its_mesh_and_less_so_on_a_finer_one():
    """All diagonals of the mesh lean one way. The contact is as wide as one facet, then as two."""
    wide = replace(tool(SPHERE), radius=0.05)
    coarse, fine = (lopsided(cell, wide) for cell in (0.015, 0.0075))
    assert fine[0] < 0.5 * coarse[0]
    assert fine[1] < 1e-4
    assert fine[1] < 0.5 * coarse[1]


def test_active_sets_find_the_forces_by_themselves(monkeypatch, rng):
    """Without the least squares that follow where they cycle, and would hide their errors."""
    monkeypatch.setattr(law, "_by_least_squares", None)
    for _ in range(20):
        root, offset = rng.standard_normal((12, 12)), rng.standard_normal(12)
        compliance = np.diag(rng.uniform(1.0, 2.0, 12)) + 0.01 * root @ root.T
        bonded = np.arange(12) < 2
        problem = ComplementarityProblem(compliance, offset, bonded)
        force = frictionless_forces(problem, np.zeros(12))
        gap = compliance @ force + offset
        assert gap[bonded | (force > 0.0)] == pytest.approx(0.0, abs=1e-12)
        assert gap.min() > -1e-12
        assert force[~bonded].min() >= 0.0


def test_friction_of_nothing_is_none():
    rng = np.random.default_rng(1)
    A = rng.normal(size=(12, 12))
    A = A @ A.T + np.eye(12)
    offset = rng.normal(size=(4, 3))
    found = frictional_forces(A, offset, np.zeros(4), np.zeros((4, 3)))
    normal = np.arange(0, 12, 3)
    held = np.zeros(4, dtype=bool)
    exact = frictionless_forces(
        ComplementarityProblem(A[np.ix_(normal, normal)], offset[:, 0], held), np.zeros(4)
    )
    assert found[:, 0] == pytest.approx(exact, abs=1e-7)
    assert np.abs(found[:, 1:]).max() == 0.0


@pytest.mark.parametrize("changes", [law.MOST_ACTIVE_SETS, 0], ids=["active-set", "least-squares"])
def test_the_law_of_contact_holds_at_every_area(changes, monkeypatch):
    """By either method; the last area is beside a punch and bears nothing."""
    monkeypatch.setattr(law, "MOST_ACTIVE_SETS", changes)
    rng = np.random.default_rng(0)
    for _ in range(50):
        A = rng.normal(size=(9, 9))
        A = A @ A.T + 0.1 * np.eye(9)
        offset, held = rng.normal(size=9), np.arange(9) < 2
        offset[8] = np.inf
        found = frictionless_forces(ComplementarityProblem(A, offset, held), np.zeros(9))
        gap = A @ found + offset
        assert np.abs(gap[held]).max() < 1e-9
        assert found[~held].min() >= 0.0
        assert gap[~held].min() > -1e-9
        assert abs(found[2:8] @ gap[2:8]) < 1e-9
        assert found[8] == 0.0


@pytest.mark.parametrize(
    ("friction", "slides"), [(0.2, True), (5.0, False)], ids=["slides", "sticks"]
)
def test_an_area_slides_at_the_limit_or_sticks(friction, slides):
    offset = np.array([[-1.0, 0.5, 0.0]])
    found = frictional_forces(np.eye(3), offset, np.array([friction]), np.zeros((1, 3)))[0]
    assert found[0] == pytest.approx(1.0)
    assert found[1] == pytest.approx(-0.2 if slides else -0.5, rel=1e-6)


def test_a_tool_that_meets_nothing_is_refused():
    far = RigidTool("tool", SPHERE, 0.015, TOP + 1.0, DOWN, lambda t: np.zeros((len(t), 3)))
    with pytest.raises(ValueError, match=r"tool\.place"):
        at_peak(block(), (far,), observed(1.0, 3, 2))


def test_a_column_hangs_as_in_closed_form():
    """Base on a foundation, gravity away from it: the strain at z is rho g (L - z) / E."""
    tissue = Tissue(poisson_ratio=0.0)
    g, k, length = 9.81, 1e6, 0.06
    body = pressed.column(block_mesh((0.04, 0.04, length), 0.02), tissue, "p2", k, 0.0)
    hung = with_external_loads(body, ExternalLoads(gravity=np.array([0.0, 0.0, g])))
    found = fem.start_of(hung).reshape(-1, 3)
    z, weight = body.points[:, 2], tissue.density * g
    exact = weight * length / k + weight * (length * z - 0.5 * z**2) / tissue.youngs_modulus
    assert found[:, 2] == pytest.approx(exact, rel=1e-9)


def test_a_given_shape_under_gravity_stays_where_it_is():
    g = np.array([0.0, 0.0, -9.81])
    assert with_external_loads(block(), ExternalLoads(gravity=g, given_loaded=True)).dead is None


def test_weights_add_their_mass_and_hang_on_the_body():
    patch = ToolPatch(TOP, DOWN, 0.02, 1.0)
    bare, g = block(), np.array([0.0, 0.0, -9.81])
    held = with_external_loads(bare, ExternalLoads(weights=(Weight(patch, 0.05),), gravity=g))
    assert (held.mass.sum() - bare.mass.sum()) / 3.0 == pytest.approx(0.05)
    whole = bare.mass.sum() / 3.0 + 0.05
    assert held.dead.reshape(-1, 3).sum(axis=0) == pytest.approx(whole * g)


@pytest.mark.parametrize("method", ["ritz-vectors", "tr-bdf2"])
def test_several_loads_move_a_body_as_each_of_them_does(method):
    seen = observed(0.3, 31, 10)
    other = ToolPatch(TOP - [0.02, 0.0, 0.0], DOWN, 0.015, 0.1)
    bare = discretise(
        block_mesh(SIZE, 0.015),
        TISSUE,
        Foundation(DOWN, 0.0, 1e-3, 1e7),
        ToolPatch(TOP, DOWN, 0.02, 0.1),
        "p2",
    )
    both = with_external_loads(bare, ExternalLoads(loads=(other,)))

    def histories(times):
        return np.column_stack([np.minimum(times / 0.1, 1.0), np.sin(10.0 * times)])

    def moved(factors):
        return fem.run(both, DAMPING, factors, seen, fem.Method(method)).trajectory.displacement

    whole = moved(histories)
    parts = [moved(lambda t, k=k: histories(t) * (np.arange(2) == k)) for k in range(2)]
    assert np.abs(whole - sum(parts)).max() < 2e-3 * np.abs(whole).max()
    assert np.abs(parts[1]).max() > 0.05 * np.abs(whole).max()


def test_a_load_moves_a_body_beside_a_moved_tool_as_without_it_though_samples_are_few():
    """Modes that ten samples cannot show follow the load at once; all of it is in these here."""
    bare = discretise(
        block_mesh(SIZE, 0.015),
        TISSUE,
        Foundation(DOWN, 0.0, 1e-3, 1e7),
        ToolPatch(TOP, DOWN, 0.01, 0.1),
        "p2",
    )
    place = TOP + np.array([0.025, 0.0, 0.0])
    aside = RigidTool("aside", SPHERE, 0.005, place, DOWN, lambda t: np.outer(1e-5 * t, DOWN))
    seen, given = observed(1.0, 11, 10), (DAMPING, lambda t: np.minimum(t / 0.4, 1.0))
    beside = run(bare, (aside,), *given, seen, fem.Method()).trajectory.displacement
    alone = fem.run(bare, *given, seen, fem.Method()).trajectory.displacement
    assert np.abs(alone).max() > 1e-4
    assert np.abs(beside - alone)[1:].max() < 0.01 * np.abs(alone).max()


def test_gravity_moves_the_start_and_leaves_the_motion():
    seen = observed(0.3, 31, 10)
    bare = discretise(
        block_mesh(SIZE, 0.015),
        TISSUE,
        Foundation(DOWN, 0.0, 1e-3, 1e7),
        ToolPatch(TOP, DOWN, 0.02, 0.1),
        "p2",
    )
    hung = with_external_loads(bare, ExternalLoads(gravity=np.array([2.0, 0.0, -9.81])))
    a, b = (fem.run(one, DAMPING, np.ones_like, seen).trajectory for one in (bare, hung))
    sag = b.displacement[0, 0]
    assert np.linalg.norm(sag) > 1e-4
    assert b.displacement == pytest.approx(a.displacement + sag, abs=1e-9)
    assert b.velocity == pytest.approx(a.velocity, abs=1e-9)


def test_steps_in_time_are_refused_under_a_moved_tool(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(
        'title = "t"\nmodels = ["fem"]\n[tool]\nshape = "sphere"\ndisplacement = "5 mm"\n'
        '[reference]\nmethod = "tr-bdf2"\n'
    )
    with pytest.raises(ValueError, match=r"reference\.method: tr-bdf2 cannot follow"):
        read_scene(str(path))


@pytest.mark.slow
def test_forces_of_spheres_and_punches_are_those_of_closed_form():
    for finding in indentation.findings():
        assert finding.difference < finding.limit, finding.quantity


@pytest.mark.parametrize("radius", [1e-3, 0.1])
def test_a_bonded_plate_holds_what_is_flush_with_it_whatever_its_radius(radius):
    """Of a top that is flat for x > 30 mm and slopes down from there."""
    mesh = block_mesh(SIZE, 0.015)
    points = mesh.points * np.ones(3)
    points[:, 2] *= 1.0 + 0.2 * np.clip(points[:, 0] / 0.03, 0.0, 1.0)
    blunt, support = ToolPatch(points[-1], DOWN, 0.02, 0.0), Foundation(DOWN, 0.0, 1e-3, 1e7)
    body = discretise(replace(mesh, points=points), TISSUE, support, blunt, "p2")
    plate = RigidTool("tool", PLATE, radius, points[-1], DOWN, tool().travel, bonded=True)
    held = patch(body, plate, np.linspace(0.0, 0.1, 5), 1e-3).points
    assert held[:, 0].min() > 0.0298
    assert np.ptp(held[:, 1]) > 0.05
    assert np.abs(held[:, 2] - 0.036).max() < 0.061e-3
