"""The finite-element reference against closed forms."""

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.sparse import csc_array

from fem_reference.dynamics import ORDER, Oscillator, march, solve_static
from fem_reference.elasticity import discretise, evaluation, largest_strain
from fem_reference.model import build
from study.contact import Foundation, ToolPatch
from study.mesh.kinds import TetrahedralMesh
from study.mesh.tetrahedra import volumes
from study.organ.block import block_mesh
from study.scene import Tissue

SIZE = (0.06, 0.05, 0.04)
DOWN = np.array([0.0, 0.0, -1.0])


def foundation(stiffness=1e6):
    return Foundation(DOWN, 0.0, 1e-3, stiffness)


def tool(radius=0.02, force=0.1):
    return ToolPatch(np.array([0.03, 0.025, 0.04]), DOWN, radius, force)


def body(nu=0.3, element_size=0.02, stiffness=1e6, mesh=None):
    tissue = Tissue(youngs_modulus=5e3, poisson_ratio=nu, density=1060.0)
    return discretise(mesh or block_mesh(SIZE, element_size), tissue, foundation(stiffness), tool())


def node_values(body, function):
    """Unknowns of a displacement field given at the nodes."""
    x = body.basis.doflocs
    field = function(x.T)
    return field[np.arange(x.shape[1]), np.arange(x.shape[1]) % 3]


def jittered(rng):
    mesh = block_mesh(SIZE, 0.02)
    inner = ((mesh.points > 1e-9) & (mesh.points < np.array(SIZE) - 1e-9)).all(axis=1)
    points = mesh.points + inner[:, None] * rng.uniform(-3e-3, 3e-3, mesh.points.shape)
    return TetrahedralMesh(points, mesh.tetrahedra)


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.45, 0.49])
def test_patch_test_uniform_strain_is_exact_on_a_distorted_mesh(nu, rng):
    found = body(nu, mesh=jittered(rng))
    strain = rng.standard_normal((3, 3))
    strain = strain + strain.T
    u = node_values(found, lambda x: x @ strain)
    elastic = found.stiffness - found.support
    mu, lame = 5e3 / (2 * (1 + nu)), 5e3 * nu / ((1 + nu) * (1 - 2 * nu))
    density = mu * (strain**2).sum() + 0.5 * lame * np.trace(strain) ** 2
    assert 0.5 * u @ (elastic @ u) == pytest.approx(density * np.prod(SIZE), rel=1e-12)
    inner = ((found.basis.doflocs.T > 1e-9) & (np.array(SIZE) - 1e-9 > found.basis.doflocs.T)).all(
        1
    )
    assert np.abs((elastic @ u)[inner]).max() < 1e-12 * np.abs(elastic @ u).max()
    assert largest_strain(found, u) == pytest.approx(np.abs(np.linalg.eigvalsh(strain)).max())


def test_a_body_without_support_has_six_rigid_modes_and_its_mass():
    found = body()
    elastic = (found.stiffness - found.support).toarray()
    values = eigh(elastic, found.mass.toarray(), eigvals_only=True, subset_by_index=[0, 6])
    assert np.abs(values[:6]).max() < 1e-10 * values[6]
    ones = node_values(found, lambda x: np.ones_like(x) * [1.0, 0.0, 0.0])
    assert ones @ (found.mass @ ones) == pytest.approx(1060 * np.prod(SIZE), rel=1e-13)


def test_load_and_support_integrals_do_not_depend_on_the_mesh():
    for size in (0.02, 0.012, 0.009):
        found = body(element_size=size)
        assert found.load.reshape(-1, 3).sum(axis=0) == pytest.approx([0, 0, -0.1], abs=1e-13)
        ones = node_values(found, lambda x: np.ones_like(x) * [0.0, 1.0, 0.0])
        held = ones @ (found.support @ ones)
        assert held == pytest.approx(1e6 * SIZE[0] * SIZE[1], rel=1e-12)


def test_the_foundation_carries_the_tool():
    found = body(0.45)
    u = solve_static(found.stiffness, found.load)
    reaction = (found.support @ u).reshape(-1, 3).sum(axis=0)
    assert reaction == pytest.approx([0, 0, -0.1], abs=1e-9)


def test_compliance_converges_from_below():
    """Nested meshes only soften a Galerkin solution, and fast enough for Richardson's estimate.

    The corner between support and free sides keeps the order of P2 below its 4 in energy.
    """
    cube, centre = (0.04, 0.04, 0.04), np.array([0.02, 0.02, 0.04])
    tissue = Tissue(youngs_modulus=5e3, poisson_ratio=0.45)
    pressed = ToolPatch(centre, DOWN, 0.02, 0.1)
    compliance = []
    for size in (0.02, 0.01, 0.005):
        found = build(block_mesh(cube, size), tissue, foundation(), pressed)
        compliance.append(found.load @ solve_static(found.stiffness, found.load))
    first, second = np.diff(compliance)
    assert first > second > 0
    assert np.log2(first / second) > 1.5


def small_system():
    found = body(element_size=0.03)
    return Oscillator(found.mass, found.stiffness, found.load, damping_rate=20.0)


def exact_step_response(system, t):
    """Modal superposition with all modes: exact in time for a step load."""
    values, modes = eigh(system.stiffness.toarray(), system.mass.toarray())
    alpha, force = system.damping_rate, modes.T @ system.load
    root = np.sqrt(values - 0.25 * alpha**2 + 0j)
    decay = np.exp(-0.5 * alpha * t)
    shape = decay * (np.cos(root * t) + 0.5 * alpha / root * np.sin(root * t))
    slope = decay * values / root * np.sin(root * t)
    return modes @ (force / values * (1 - shape.real)), modes @ (force / values * slope.real)


def test_time_stepping_is_of_second_order_against_exact_superposition():
    system, t = small_system(), 0.05
    exact_u, exact_v = exact_step_response(system, t)
    errors = []
    for count in (200, 400, 800):
        *_, (u, v) = march(system, np.ones_like, t / count, count)
        errors.append(
            [
                np.linalg.norm(u - exact_u) / np.linalg.norm(exact_u),
                np.linalg.norm(v - exact_v) / np.linalg.norm(exact_v),
            ]
        )
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert orders == pytest.approx(ORDER, abs=0.1)  # displacement and velocity
    assert errors[-1][0] < 2e-4


def test_an_overdamped_velocity_settles_within_a_few_long_steps():
    """Damping 50 times faster than the step; the trapezoidal rule would ring for 30 steps."""
    one = csc_array(np.eye(1))
    system = Oscillator(one, one, np.ones(1), damping_rate=5e3)
    velocity = np.array([v[0] for _, v in march(system, np.ones_like, 0.01, 50)])[1:]
    assert velocity[0] == pytest.approx(1 / 5e3, rel=0.1)
    assert velocity[2:] == pytest.approx(1 / 5e3, rel=1e-3)


def test_a_swapped_sign_in_the_load_is_seen():
    """Negative control: the tool must push the organ along its direction, not pull it."""
    found = body()
    u = solve_static(found.stiffness, found.load)
    at_tool = (evaluation(found, tool().centre[None]) @ u) @ DOWN
    assert at_tool > 0 > (evaluation(found, tool().centre[None]) @ -u) @ DOWN


def test_evaluation_reproduces_quadratic_fields(rng):
    found = body(mesh=jittered(rng))
    points = rng.uniform(0, 1, (300, 3)) * SIZE
    u = node_values(found, lambda x: np.stack([x[:, 0] ** 2, x[:, 1] * x[:, 2], x[:, 2]], axis=1))
    expected = np.stack([points[:, 0] ** 2, points[:, 1] * points[:, 2], points[:, 2]], axis=1)
    found_values = (evaluation(found, points) @ u).reshape(-1, 3)
    assert np.abs(found_values - expected).max() < 1e-15


def test_a_body_that_nothing_holds_is_refused():
    loose = Foundation(DOWN, level=10.0, depth=1e-3, stiffness=1e6)
    with pytest.raises(ValueError, match=r"enlarge support\.depth"):
        discretise(block_mesh(SIZE, 0.02), Tissue(), loose, tool())


def test_a_tool_in_the_air_is_refused():
    away = ToolPatch(np.array([5.0, 5.0, 5.0]), DOWN, 0.01, 1.0)
    with pytest.raises(ValueError, match=r"move tool\.place"):
        discretise(block_mesh(SIZE, 0.02), Tissue(), foundation(), away)


def test_a_flat_tetrahedron_never_gives_a_matrix():
    mesh = block_mesh(SIZE, 0.02)
    points = mesh.points.copy()
    corner = points[mesh.tetrahedra[0]]
    points[mesh.tetrahedra[0, 3]] = corner[:3].mean(axis=0)
    assert volumes(TetrahedralMesh(points, mesh.tetrahedra))[0] == pytest.approx(0, abs=1e-20)
    points[mesh.tetrahedra[0, 3]] = corner[0]
    with pytest.raises((ValueError, np.linalg.LinAlgError)), np.errstate(all="ignore"):
        discretise(TetrahedralMesh(points, mesh.tetrahedra), Tissue(), foundation(), tool())


def test_a_mesh_too_fine_for_the_direct_solver_is_refused_before_assembly():
    with pytest.raises(ValueError, match=r"enlarge reference\.element_size"):
        build(block_mesh(SIZE, 0.0015), Tissue(), foundation(), tool())
