"""The finite-element reference against exact solutions, and against errors planted in it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.sparse import block_array, csc_array
from scipy.special import jv

from fem_reference import assembly, dynamics, elasticity, memory
from fem_reference.contact.kinematics import Configuration
from fem_reference.dynamics import Oscillator, march
from fem_reference.elasticity import discretise
from fem_reference.grid import straight
from fem_reference.model import build
from fem_reference.observation import at_points, evaluation, largest_strain
from fem_reference.solvers import solve_static
from fem_reference.stiffness import Stiffness
from study.known.case import Case
from study.known.finding import convergence, error_of
from study.known.request import tried
from study.known.suite import PROBLEMS
from study.known.verification import (
    bent_bar,
    column,
    damped_motion,
    half_space,
    iterations,
    large_contact,
    manufactured,
    patch_test,
    rigid_motion,
    thick_sphere,
    torsional_modes,
)
from study.mesh.kinds import TetrahedralMesh
from study.mesh.tetrahedra import volumes
from study.organ.block import block_mesh
from study.problem.contact import Foundation, ToolPatch
from study.problem.damping import RayleighDamping
from study.problem.tissue import Tissue
from study.system.progress import Silent

SIZE = (0.06, 0.05, 0.04)
DOWN = np.array([0.0, 0.0, -1.0])
TISSUE = Tissue(youngs_modulus=5e3, poisson_ratio=0.3, density=1060.0)


POSED = Case(family="f", name="n", function="m:f", source="a book")


def foundation(stiffness=1e6):
    return Foundation(DOWN, 0.0, 1e-3, stiffness)


def tool(radius=0.02, force=0.1):
    return ToolPatch(np.array([0.03, 0.025, 0.04]), DOWN, radius, force)


def body(nu=0.3, element_size=0.02, mesh=None, element="p2"):
    tissue = replace(TISSUE, poisson_ratio=nu)
    mesh = mesh or block_mesh(SIZE, element_size)
    return discretise(mesh, tissue, foundation(), tool(), element)


# --- the problems of `liver-study verify` ---------------------------------------------------------


@pytest.mark.parametrize(
    "problem",
    [
        pytest.param(one, id=one.name, marks=[] if one.quick else [pytest.mark.slow])
        for one in PROBLEMS
    ],
)
def test_the_reference_solves(problem):
    found = tried(problem, Silent())
    assert found.findings
    assert not [finding for finding, passed in found.judged if passed is False]


def test_a_finding_out_of_its_limit_or_not_a_number_fails():
    assert POSED.judge(error_of("x", 0.1, 0.1)) is True
    assert POSED.judge(error_of("x", 0.11, 0.1)) is False
    assert POSED.judge(error_of("x", float("nan"), 0.1)) is False
    assert POSED.judge(error_of("x", 0.5)) is None  # shown, not judged


def test_a_lower_order_fails_whatever_the_error():
    error, order = convergence("x", [4e-9, 2e-9], 2, 0.1, 1e-3)
    assert POSED.judge(error)
    assert not POSED.judge(order)
    assert order.measured == pytest.approx(1.0)


# --- errors planted in the reference --------------------------------------------------------------


def fails(problem):
    """Whether a finding is out of its limit or, as for the command, the problem is not solved."""
    try:
        return any(POSED.judge(finding) is False for finding in problem())
    except ValueError:
        return True


def softer(monkeypatch):
    """Young's modulus too low by one per cent."""
    exact = assembly.lame_parameters
    monkeypatch.setattr(assembly, "lame_parameters", lambda E, nu: exact(0.99 * E, nu))


def more_compressible(monkeypatch):
    """Poisson ratio too low by one per cent."""
    exact = assembly.lame_parameters
    monkeypatch.setattr(assembly, "lame_parameters", lambda E, nu: exact(E, 0.99 * nu))


def coarse_quadrature(monkeypatch):
    """One point per element, which leaves quadratic elements with mechanisms."""
    for name, one in assembly.ELEMENTS.items():
        monkeypatch.setitem(assembly.ELEMENTS, name, replace(one, gradient_order=1))


def coarse_mass(monkeypatch):
    for module in (assembly, elasticity):
        monkeypatch.setattr(module, "MASS_ORDER", 2)


def weak_foundation(monkeypatch):
    exact = Foundation.density
    monkeypatch.setattr(Foundation, "density", lambda *given: 0.99 * exact(*given))


def wrong_sign_of_the_pressure(monkeypatch):
    """A pressure whose mass adds where it should subtract."""

    def system(self, mass=None, share=1.0):
        block = share * self.matrix if mass is None else mass + share * self.matrix
        if self.pressure is None:
            return csc_array(block)
        B = share * self.pressure.divergence
        C = share / self.pressure.lame * self.pressure.mass
        return csc_array(block_array([[block, B.T], [B, C]]))

    monkeypatch.setattr(Stiffness, "system", system)


def flat_facets(monkeypatch):
    for module in (thick_sphere, torsional_modes):
        monkeypatch.setattr(module, "curved", lambda mesh, _: straight(mesh))


def turned_symmetry(monkeypatch):
    """Each plane of symmetry holds along another axis."""
    exact = thick_sphere.at_rest
    monkeypatch.setattr(
        thick_sphere, "at_rest", lambda K, f, held: exact(K, f, np.roll(held, 1, axis=1))
    )


def narrow_tool(monkeypatch):
    exact = ToolPatch.profile
    monkeypatch.setattr(
        ToolPatch,
        "profile",
        lambda tool, x, n: exact(replace(tool, radius=0.99 * tool.radius), x, n),
    )


def other_stage(monkeypatch):
    """TR-BDF2 with another first stage, whose two matrices are no longer one."""
    monkeypatch.setattr(dynamics, "GAMMA", 0.5)


def forgotten_stiffness_damping(monkeypatch):
    exact = Oscillator.internal_force
    monkeypatch.setattr(
        Oscillator,
        "internal_force",
        lambda own, u, v: exact(replace(own, damping=replace(own.damping, stiffness=0.0)), u, v),
    )


def early_end_of_iterations(monkeypatch):
    monkeypatch.setattr(iterations, "TOLERANCE", 1e-4)


def shared_out_wrongly(monkeypatch):
    """A force under a tool of which the nodes feel a little less."""
    exact = Configuration.derivative.func
    monkeypatch.setattr(Configuration, "derivative", property(lambda met: 0.999 * exact(met)))


@pytest.fixture
def coarser(monkeypatch):
    """The two dearest problems on the coarsest meshes that hold their limits."""
    monkeypatch.setattr(half_space, "CASES", (("taylor-hood", 0.4999),))
    monkeypatch.setattr(half_space, "CELLS", (3, 6))
    monkeypatch.setattr(bent_bar, "CASES", (("p2", 0.3),))
    monkeypatch.setattr(bent_bar, "CELLS", (0.01, 0.02 / 3))


@pytest.mark.usefixtures("coarser")
@pytest.mark.parametrize("problem", [half_space.findings, bent_bar.findings])
def test_nothing_is_seen_on_coarser_meshes_where_nothing_is_planted(problem):
    assert not fails(problem)


@pytest.mark.usefixtures("coarser")
@pytest.mark.parametrize(
    ("plant", "problem"),
    [
        (softer, patch_test.findings),
        (softer, column.walled),
        (softer, half_space.findings),
        (softer, bent_bar.findings),
        (softer, torsional_modes.whole),
        (softer, thick_sphere.findings),
        (more_compressible, patch_test.findings),
        (coarse_quadrature, rigid_motion.findings),
        (coarse_mass, rigid_motion.findings),
        (weak_foundation, column.walled),
        (wrong_sign_of_the_pressure, column.walled),
        (wrong_sign_of_the_pressure, damped_motion.stepped),
        (flat_facets, torsional_modes.whole),
        (flat_facets, torsional_modes.octant),
        (flat_facets, thick_sphere.findings),
        (turned_symmetry, thick_sphere.findings),
        (narrow_tool, half_space.findings),
        (other_stage, damped_motion.stepped),
        (forgotten_stiffness_damping, damped_motion.stepped),
        (early_end_of_iterations, iterations.findings),
        (shared_out_wrongly, large_contact.findings),
    ],
)
def test_a_planted_error_is_seen(plant, problem, monkeypatch):
    plant(monkeypatch)
    assert fails(problem)


def test_the_manufactured_force_is_that_of_its_displacement():
    """By differences of the exact displacement; a wrong force would lower the order only."""
    h, x = 1e-4, np.array([0.3, 0.45, 0.7])
    tissue, step = replace(TISSUE, poisson_ratio=0.4), np.eye(3) * 1e-4
    mu, lame = 5e3 / 2.8, 5e3 * 0.4 / (1.4 * 0.2)

    def u(p):
        return manufactured.displacement(p, tissue)

    def divergence(p):
        return sum((u(p + e)[i] - u(p - e)[i]) / (2 * h) for i, e in enumerate(step))

    laplacian = sum(u(x + e) + u(x - e) - 2 * u(x) for e in step) / h**2
    gradient = [(divergence(x + e) - divergence(x - e)) / (2 * h) for e in step]
    force = -(mu * laplacian + (lame + mu) * np.array(gradient))
    # Second differences lose rounding / h^2 and h^2: some 1e-6.
    assert manufactured.force(x, tissue) == pytest.approx(force, rel=1e-5)


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.4999])
def test_the_bent_bar_is_in_balance_and_free_at_its_sides(nu):
    tissue = replace(TISSUE, poisson_ratio=nu)
    mu, lame = 5e3 / (2 * (1 + nu)), 5e3 * nu / ((1 + nu) * (1 - 2 * nu))

    def stress(p):
        tiny = 1e-30  # complex steps differentiate without rounding
        slope = [bent_bar.displacement(p + e, tissue).imag / tiny for e in tiny * 1j * np.eye(3)]
        slope = np.array(slope)
        return mu * (slope + slope.T) + lame * np.trace(slope) * np.eye(3)

    inside = np.array([0.4 * bent_bar.A, 0.3 * bent_bar.B, 0.6 * bent_bar.L])
    found = stress(inside)
    step = 1e-3 * bent_bar.A
    balance = sum(
        (stress(inside + e)[i] - stress(inside - e)[i]) / (2 * step)
        for i, e in enumerate(step * np.eye(3))
    )
    scale, rounding = np.abs(found).max(), 1e-14 / (1 - 2 * nu)
    # Central differences leave the square of the step, times the rounding of the stress.
    assert np.abs(balance).max() * bent_bar.A < (1e-5 + 1e3 * rounding) * scale
    for side, at in ((0, bent_bar.A), (1, bent_bar.B)):
        there = stress(np.where(np.arange(3) == side, at, inside))
        # On the side x = a the series ends with 1 / n^2 of 60 terms.
        assert np.abs(there[side]).max() < (1e-4 + rounding) * scale
    assert bent_bar.shear(inside, tissue)[:2] == pytest.approx(found[2, :2], rel=1e-6)


def test_the_half_space_sinks_as_the_hankel_transform_of_the_pressure_says():
    """Of the pressure 8 p a^2 J_3(k a) / (k a)^3; depths over 2 (1 - nu^2) p a / E."""

    def transform(x):
        return 8 * jv(3, x) / x**3

    def integral(function):
        return quad(function, 0, 200, limit=1000)[0]  # beyond, less than 1e-7 of it

    force = np.pi / 3  # over p a^2
    mean = integral(lambda x: transform(x) ** 2) * 2 * np.pi / force
    assert 2 * mean == pytest.approx(half_space.MEAN, rel=1e-6)
    assert 2 * integral(transform) == pytest.approx(half_space.CENTRE, rel=1e-6)
    aside = integral(lambda x: transform(x) * jv(0, 2 * x))
    at = np.array([[2 * half_space.RADIUS, 0.0, 0.0]])
    scale = 2 * (1 - 0.3**2) * half_space.PRESSURE * half_space.RADIUS / 5e3
    found = -half_space.displacement(at, TISSUE)[0, 2]
    assert found == pytest.approx(scale * aside, rel=1e-6)


# --- what holds on any mesh -----------------------------------------------------------------------


def node_values(found, function):
    """Unknowns of a displacement field given at the nodes."""
    return function(found.points).ravel()


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.45, 0.49])
def test_uniform_strain_is_found_where_it_is_largest(nu, rng):
    strain = rng.standard_normal((3, 3))
    strain = strain + strain.T
    found = body(nu, mesh=patch_test.distorted())
    u = node_values(found, lambda x: x @ strain)
    assert largest_strain(found, u) == pytest.approx(np.abs(np.linalg.eigvalsh(strain)).max())


def test_load_and_support_integrals_do_not_depend_on_the_mesh():
    for size in (0.02, 0.012, 0.009):
        found = body(element_size=size)
        assert found.load.reshape(-1, 3).sum(axis=0) == pytest.approx([0, 0, -0.1], abs=1e-13)
        ones = node_values(found, lambda x: np.ones_like(x) * [0.0, 1.0, 0.0])
        held = ones @ (found.support @ ones)
        assert held == pytest.approx(1e6 * SIZE[0] * SIZE[1], rel=1e-12)


@pytest.mark.parametrize(("nu", "element"), [(0.45, "p2"), (0.4999, "taylor-hood")])
def test_the_foundation_carries_the_tool_which_pushes(nu, element):
    found = body(nu, element=element)
    u = solve_static(found)
    reaction = (found.support @ u).reshape(-1, 3).sum(axis=0)
    assert reaction == pytest.approx([0, 0, -0.1], abs=1e-9)
    depth = at_points(evaluation(found, tool().centre[None]), u)[0] @ DOWN
    assert depth > 0.0


def test_compliance_converges_from_below():
    """Nested meshes only soften a Galerkin solution, and fast enough for Richardson's estimate.

    The corner between support and free sides keeps the order of P2 below its 4 in energy.
    """
    cube, centre = (0.04, 0.04, 0.04), np.array([0.02, 0.02, 0.04])
    tissue = Tissue(youngs_modulus=5e3, poisson_ratio=0.45)
    pressed = ToolPatch(centre, DOWN, 0.02, 0.1)
    compliance = []
    for size in (0.02, 0.01, 0.005):
        found = discretise(block_mesh(cube, size), tissue, foundation(), pressed)
        compliance.append(found.load @ solve_static(found))
    first, second = np.diff(compliance)
    assert first > second > 0
    assert np.log2(first / second) > 1.5


def test_an_overdamped_velocity_settles_within_a_few_long_steps():
    """Damping 50 times faster than the step; the trapezoidal rule would ring for 30 steps."""
    one = csc_array(np.eye(1))
    system = Oscillator(one, Stiffness(one), np.ones(1), RayleighDamping(5e3))
    velocity = np.array([v[0] for _, v in march(system, np.ones_like, 0.01, 50)])[1:]
    assert velocity[0] == pytest.approx(1 / 5e3, rel=0.1)
    assert velocity[2:] == pytest.approx(1 / 5e3, rel=1e-3)


def test_evaluation_reproduces_quadratic_fields(rng):
    found = body(mesh=patch_test.distorted())
    points = rng.uniform(0, 1, (300, 3)) * SIZE

    def field(x):
        return np.stack([x[:, 0] ** 2, x[:, 1] * x[:, 2], x[:, 2]], axis=1)

    values = at_points(evaluation(found, points), node_values(found, field))
    assert np.abs(values - field(points)).max() < 1e-15


# --- refusals -------------------------------------------------------------------------------------


def test_a_body_that_nothing_holds_is_refused():
    loose = Foundation(DOWN, level=10.0, depth=1e-3, stiffness=1e6)
    with pytest.raises(ValueError, match=r"enlarge support\.depth"):
        discretise(block_mesh(SIZE, 0.02), Tissue(), loose, tool())


def test_a_tool_in_the_air_is_refused():
    away = ToolPatch(np.array([5.0, 5.0, 5.0]), DOWN, 0.01, 1.0)
    with pytest.raises(ValueError, match=r"move tool\.place"):
        discretise(block_mesh(SIZE, 0.02), Tissue(), foundation(), away)


def test_a_mesh_too_large_for_the_memory_is_refused_before_assembly(monkeypatch):
    monkeypatch.setattr(memory, "available", lambda: 2.0**20)
    with pytest.raises(ValueError, match=r"reference\.element_size .* times as large"):
        build(block_mesh(SIZE, 0.02), Tissue(), foundation(), tool())


def test_a_flat_tetrahedron_never_gives_a_matrix():
    mesh = block_mesh(SIZE, 0.02)
    points = mesh.points.copy()
    corner = points[mesh.tetrahedra[0]]
    points[mesh.tetrahedra[0, 3]] = corner[:3].mean(axis=0)
    assert volumes(TetrahedralMesh(points, mesh.tetrahedra))[0] == pytest.approx(0, abs=1e-20)
    points[mesh.tetrahedra[0, 3]] = corner[0]
    with pytest.raises((ValueError, np.linalg.LinAlgError)), np.errstate(all="ignore"):
        discretise(TetrahedralMesh(points, mesh.tetrahedra), Tissue(), foundation(), tool())
