"""Supports: clamped and sliding surfaces, several at once, and what does not hold a body."""

from dataclasses import replace

import numpy as np
import pytest

from fem_reference import model as fem
from fem_reference.elasticity import discretise
from fem_reference.newton import solve
from fem_reference.observation import at_points, evaluation
from fem_reference.solvers import solve_static
from fem_reference.subspace import modal_subspace
from msm import model as msm
from msm.integrators import INTEGRATORS
from msm.statics import static_displacement
from study.models.lattice_assembly import assembled
from study.models.tissue import of_modulus
from study.organ.block import block_mesh
from study.problem.contact import Foundation, ToolPatch
from study.problem.damping import RayleighDamping
from study.problem.supports import FixedSurface, Supports, free_motion
from study.problem.tissue import Tissue
from study.scene.error import SceneError
from study.scene.file import read_scene, resolved, validate, write_scene
from study.scene.problem import problem_of

DOWN = np.array([0.0, 0.0, -1.0])
ALL = np.ones(3, dtype=bool)
TISSUE = Tissue()
BLOCK = (
    'organ.size=["60 mm", "40 mm", "30 mm"]',
    "tool.radius=15 mm",
    "tool.force=0.05 N",
    "reference.element_size=12 mm",
    "lattice.spacing=10 mm",
    "time.samples=101",
)


def base(stiffness):
    return Foundation(DOWN, 0.0, 1e-3, stiffness)


def cube(support, tissue=TISSUE, element="p2"):
    tool = ToolPatch(np.array([0.02, 0.02, 0.04]), DOWN, 0.02, 0.05)
    return discretise(block_mesh((0.04, 0.04, 0.04), 0.01), tissue, support, tool, element)


def posed(*overrides):
    return problem_of(read_scene("block", (*BLOCK, *overrides)))


def lattice_at_rest(support):
    scene = read_scene("block", BLOCK)
    problem = replace(problem_of(scene), foundation=support)
    body = assembled(problem, scene.lattice)
    springs = of_modulus(scene, body.lattice, modulus=9.5e3)
    return body, springs.material, static_displacement(body, springs.material)


def test_a_fixed_surface_is_what_faces_its_side_within_its_depth():
    """Not the walls above it, which reach as far down, nor what faces the side further up."""
    below = FixedSurface(Foundation(DOWN, 0.0, 0.01, 1.0), ALL)
    points = np.array([[0.0, 0.0, z] for z in (0.0, 0.009, 0.011, 0.005, 0.005, 0.005)])
    lean = np.array([0.8, 0.0, -0.6])
    normals = np.array([DOWN, DOWN, DOWN, lean, [1.0, 0.0, 0.0], -DOWN])
    held = below.fixed(points, normals)
    assert held.all(axis=1).tolist() == [True, True, False, True, False, False]
    assert not held[[2, 4, 5]].any()


# The limit of a stiff foundation ---------------------------------------------------------------


@pytest.mark.parametrize(("element", "nu"), [("p1", 0.3), ("p2", 0.45), ("taylor-hood", 0.49)])
def test_a_clamped_base_is_the_limit_of_a_stiff_foundation(element, nu):
    tissue = Tissue(poisson_ratio=nu)
    clamped = solve_static(cube(FixedSurface(base(1.0), ALL), tissue, element))
    gaps = [
        np.abs(solve_static(cube(base(k), tissue, element)) - clamped).max() for k in (1e9, 1e10)
    ]
    assert gaps[1] == pytest.approx(gaps[0] / 10.0, rel=0.1)
    assert gaps[1] < 1e-4 * np.abs(clamped).max()
    assert np.abs(solve_static(cube(base(1e7), tissue, element)) - clamped).max() > 10 * gaps[0]


def test_so_it_is_in_a_lattice():
    body, _, clamped = lattice_at_rest(FixedSurface(base(1.0), ALL))
    assert not clamped[body.lattice.nodes[:, 2] < 1e-9].any()
    gaps = [np.abs(lattice_at_rest(base(k))[2] - clamped).max() for k in (1e9, 1e10)]
    assert gaps[1] == pytest.approx(gaps[0] / 10.0, rel=0.1)
    assert gaps[1] < 1e-4 * np.abs(clamped).max()


def test_newton_holds_what_is_clamped():
    body = cube(FixedSurface(base(1.0), ALL))
    small = replace(body, load=1e-4 * body.load)
    found = solve(small, Tissue(), "neo-hookean").states[-1].displacement
    assert not found[body.fixed].any()
    linear = solve_static(small)
    assert found == pytest.approx(linear, abs=1e-3 * np.abs(linear).max())


def test_the_lowest_modes_are_those_of_what_moves():
    body = cube(FixedSurface(base(1.0), ALL))
    found = modal_subspace(body, 6)
    assert np.abs(found.vectors[body.fixed]).max() < 1e-12 * np.abs(found.vectors).max()
    stiff = modal_subspace(cube(base(1e11)), 6)
    lowest = [np.sort(np.linalg.eigvalsh(one.stiffness))[:5] for one in (found, stiff)]
    assert lowest[0] == pytest.approx(lowest[1], rel=1e-3)


# Closed forms ----------------------------------------------------------------------------------


def test_a_cantilever_bends_as_timoshenkos_beam():
    """End load on a clamped bar of length L: F L^3 / (3 E I) and F L / (k G A) of shear."""
    length, depth, force, E = 0.2, 0.02, 1e-3, 9.5e3
    tissue = Tissue(youngs_modulus=E, poisson_ratio=0.3)
    right = np.array([1.0, 0.0, 0.0])
    wall = FixedSurface(Foundation(-right, 0.0, 1e-3, 1.0), ALL)
    tip = ToolPatch(np.array([length - 0.006, depth / 2, depth]), DOWN, 0.006, force)
    body = discretise(block_mesh((length, depth, depth), 0.01), tissue, wall, tip, "p2")
    u = solve_static(body)
    arm = float(body.load.reshape(-1, 3)[:, 2] @ body.points[:, 0]) / -force
    end = np.array([[length, depth / 2, depth / 2]])
    sunk = -float(at_points(evaluation(body, end), u)[0, 2])
    stiffness = E * depth**4 / 12.0
    shear = force * arm / (0.85 * E / 2.6 * depth**2)
    exact = force * arm**2 * (3.0 * length - arm) / (6.0 * stiffness) + shear
    assert sunk == pytest.approx(exact, rel=0.02)


def test_three_sliding_sides_leave_a_block_in_uniform_stress():
    """Symmetric on three planes and pressed evenly: strain p / E along, -nu p / E across."""
    from study.known.pressed import PRESSURE

    class Even(ToolPatch):
        def profile(self, points, normals):
            del points
            return np.where(normals @ self.direction < -0.9, 1.0, 0.0)

    size, tissue = 0.04, Tissue(poisson_ratio=0.3)
    sides = tuple(FixedSurface(Foundation(-axis, 0.0, 1e-3, 1.0), axis > 0.5) for axis in np.eye(3))
    tool = Even(np.zeros(3), DOWN, 1.0, PRESSURE * size**2)
    body = discretise(block_mesh((size,) * 3, 0.02), tissue, Supports(sides), tool, "p2")
    strain = PRESSURE / tissue.youngs_modulus * np.array([0.3, 0.3, -1.0])
    exact = body.points * strain
    assert solve_static(body).reshape(-1, 3) == pytest.approx(exact, abs=1e-8 * exact.max())


# What moves in time ----------------------------------------------------------------------------


def test_inertia_is_the_mass_where_each_axis_slides_on_its_own_side():
    """By symmetry the components of a cube have as many entries each, at other nodes."""
    sides = [
        FixedSurface(Foundation(-axis, 0.0, 1e-3, 1.0), axis.astype(bool)) for axis in np.eye(3)
    ]
    body = cube(Supports(tuple(sides)))
    motion = np.random.default_rng(1).standard_normal(len(body.load))
    assert body.inertia(motion) == pytest.approx(body.mass @ motion, rel=1e-12, abs=1e-15)


@pytest.mark.parametrize("integrator", [name for name in INTEGRATORS if name != "xpbd"])
def test_integrators_leave_clamped_and_sliding_nodes_alone(integrator):
    settings = (f"lattice.integrator={integrator}", "lattice.volume_term=true")
    scene = read_scene("block", (*BLOCK, *settings))
    along = np.array([True, False, False])
    held = Supports(
        (
            FixedSurface(base(1.0), ALL),
            FixedSurface(Foundation(np.array([1.0, 0, 0]), 0.06, 1e-3, 1.0), along),
        )
    )
    problem = replace(problem_of(scene), foundation=held)
    body = assembled(problem, scene.lattice)
    material = of_modulus(scene, body.lattice, modulus=9.5e3).material
    last = []
    msm.run(
        body,
        material,
        problem.factor,
        problem.observation,
        integrator=integrator,
        on_sample=lambda _, u, __: last.append((np.abs(u[body.fixed]).max(), np.abs(u).max())),
    )
    assert max(fixed for fixed, _ in last) == 0.0
    assert max(free for _, free in last) > 1e-5
    assert body.fixed[:, 0].sum() > body.fixed[:, 1].sum() > 0


def test_the_reference_leaves_clamped_nodes_alone_in_time():
    body = cube(FixedSurface(base(1.0), ALL))
    problem = posed()
    seen = replace(problem.observation, probes=np.array([[0.02, 0.02, 0.0], [0.02, 0.02, 0.04]]))
    seen = replace(seen, volume_points=seen.probes, surface_points=seen.probes)
    for method in ("ritz-vectors", "tr-bdf2"):
        found = fem.run(body, RayleighDamping(50.0), problem.factor, seen, fem.Method(method))
        moved = np.abs(found.trajectory.displacement).max(axis=(0, 2))
        assert moved[0] < 1e-15
        assert moved[1] > 1e-6


# What holds, and what does not -----------------------------------------------------------------


def motion(*supports):
    rule = posed().surface_rule
    return free_motion(Supports(supports), rule.points, rule.normals, rule.weights)


def sliding(axis, level=0.0):
    return FixedSurface(Foundation(axis, level, 1e-3, 1.0), np.abs(axis) > 0.5)


def test_sliding_on_three_sides_holds_and_on_two_does_not():
    x, y, z = -np.eye(3)
    assert motion(sliding(x), sliding(y), sliding(z)) is None
    shift, turn = motion(sliding(x), sliding(y))
    assert np.abs(shift) == pytest.approx([0.0, 0.0, 1.0], abs=1e-6)
    assert not np.abs(turn).max() > 1e-6
    assert motion(base(1e3)) is None
    assert motion(FixedSurface(base(1.0), ALL)) is None


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (("support.kind=sliding",), r"support: nothing resists when the organ is to be"),
        (("support.kind=glued",), "support.kind: should be 'foundation', 'clamped' or 'sliding'"),
        (("support.radius=5 mm",), r"support\.radius: goes with support\.place"),
        (("support.place={point=[0, 0, 0]}",), r"support\.radius: give how far"),
        (("support.kind=clamped", "lattice.integrator=xpbd"), "lattice.integrator: xpbd"),
        (("support.2.side=left",), r"--set support\.2: there is no such support"),
    ],
)
def test_what_cannot_hold_is_refused(overrides, message):
    with pytest.raises(ValueError, match=message):
        posed(*overrides)


def test_several_supports_are_read_written_and_named_by_their_numbers():
    table = resolved(read_scene("block", BLOCK))
    table["support"] = [
        {"kind": "clamped", "side": "inferior", "depth": "1 mm"},
        {"side": "left", "depth": "5 mm", "stiffness": "1 MPa/m"},
        {"kind": "sliding", "side": "right", "place": {"point": [0.0, 0.02, 0.02]}, "radius": 0.01},
    ]
    scene = validate(table, "made")
    assert [one.kind for one in scene.supports] == ["clamped", "foundation", "sliding"]
    text = write_scene(scene)
    assert text.count("[[support]]") == 3
    import tomllib

    assert validate(tomllib.loads(text), "again") == scene
    table["support"] = [{"side": "left"}, {"side": "lefty"}]
    table.pop("further_supports", None)
    with pytest.raises(SceneError, match=r"support\.2\.side"):
        validate(table, "made")


def test_a_support_at_a_place_is_round():
    place = 'support.place={point=["30 mm", "20 mm", "0 mm"]}'
    problem = posed("support.kind=clamped", place, "support.radius=12 mm")
    rule = problem.surface_rule
    held = problem.foundation.fixed(rule.points, rule.normals)
    away = np.linalg.norm(rule.points - [0.03, 0.02, 0.0], axis=1)
    assert (held.any(axis=1) == (away < 0.012)).all()
    assert held.any()
