"""Bodies and lattices under displacement control: closed forms, derivatives, stated failures."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.sparse import csr_array

from fem_reference import natural_frequency
from fem_reference.displacement_control import Loading, solve_linear
from fem_reference.displacement_control import equilibrium_path as solid_path
from fem_reference.grid import curved, straight
from fem_reference.laws import NeoHookean
from fem_reference.mixed_strain import mixed_solid
from msm import displacement_control, volume
from msm import lattice as cells
from msm.calibration import lame, reference_stiffness
from msm.damping import UNDAMPED
from msm.displacement_control import equilibrium_path as lattice_path
from msm.laws import Hooke
from msm.network import network
from msm.springs import connect
from study.known.verification.patch_test import distorted
from study.known.verification.solid import at_rest, solid
from study.numerics.continuation import NO_EQUILIBRIUM, UNSTABLE
from study.organ.block import block_mesh
from study.organ.cylinder import onto_side, quarter_cylinder
from study.organ.occupancy import ImplicitBody
from study.problem.tissue import Tissue

E, EDGE = 5e3, 0.04
NUS = (0.25, 0.45, 0.499, 0.4999)
EYE = np.eye(3)


def tissue(nu):
    return Tissue(youngs_modulus=E, poisson_ratio=nu)


def body(nu=0.499, size=0.02, mesh=None):
    return mixed_solid(straight(mesh or block_mesh((EDGE,) * 3, size)), tissue(nu))


def plates(points, squeeze, bonded=False):
    """Prescribed displacements between plates; sliding ones on planes of symmetry."""
    found = np.full_like(points, np.nan)
    low, high = points[:, 2] < 1e-9, points[:, 2] > EDGE - 1e-9
    if bonded:
        found[low | high] = 0.0
    for axis in range(3):
        found[points[:, axis] < 1e-9, axis] = 0.0
    found[high, 2] = -squeeze * EDGE
    return found, high


def uniaxial(nu, stretch):
    """Lateral stretch and nominal stress of the neo-Hookean law: its own two equations."""
    first, mu = lame(E, nu)
    a = brentq(lambda a: mu * (a * a - 1) + first * np.log(a * a * stretch), 0.5, 2.0, xtol=1e-15)
    return a, mu * (stretch - 1.0 / stretch) + first * np.log(a * a * stretch) / stretch


@pytest.mark.parametrize("nu", NUS)
def test_sliding_plates_take_the_closed_form(nu):
    solid = body(nu)
    prescribed, high = plates(solid.points, 0.3)
    path = solid_path(solid, Loading(prescribed, np.zeros(solid.size)))
    (state,) = path.states
    lateral, stress = uniaxial(nu, 0.7)
    exact = solid.points * (np.array([lateral, lateral, 0.7]) - 1.0)
    assert np.abs(state.displacement - exact).max() < 1e-10 * EDGE
    assert state.reaction[high, 2].sum() == pytest.approx(stress * EDGE**2, rel=1e-8)
    assert state.largest_strain == pytest.approx(abs(np.log(0.7)), rel=1e-8)
    # The linear law is far from it.
    assert solve_linear(solid, Loading(prescribed, np.zeros(solid.size))).reaction[
        high, 2
    ].sum() == pytest.approx(-0.3 * E * EDGE**2, rel=1e-8)


def test_gradient_and_tangent_are_derivatives(rng):
    solid = body(0.499, mesh=distorted())
    w, dw = rng.standard_normal((2, solid.size + solid.pressures))
    scale = np.where(np.arange(len(w)) < solid.size, 5e-4, 50.0)
    w, dw = scale * w, scale * dw
    g, K = solid.gradient(w), solid.tangent(w)
    assert abs(K - K.T).max() < 1e-13 * abs(K).max()
    steps = 0.5 / 2.0 ** np.arange(1, 6)
    left = [np.linalg.norm(solid.gradient(w + h * dw) - g - h * (K @ dw)) for h in steps]
    assert np.polyfit(np.log(steps), np.log(left), 1)[0] == pytest.approx(2.0, abs=0.1)
    wrong = K.copy()
    wrong.data *= 1.01
    left = [np.linalg.norm(solid.gradient(w + h * dw) - g - h * (wrong @ dw)) for h in steps]
    assert np.polyfit(np.log(steps), np.log(left), 1)[0] < 1.7


def test_patch_at_finite_strain(rng):
    solid = body(0.499, mesh=distorted())
    F = EYE + 0.1 * rng.standard_normal((3, 3))
    x = solid.points
    inner = np.all((x > 1e-9) & (x < x.max(axis=0) - 1e-9), axis=1)
    prescribed = np.where(inner[:, None], np.nan, x @ (F - EYE).T)
    (state,) = solid_path(solid, Loading(prescribed, np.zeros(solid.size))).states
    assert np.abs(state.displacement - x @ (F - EYE).T).max() < 1e-9 * EDGE
    first, mu = lame(E, 0.499)
    assert state.pressure == pytest.approx(first * np.log(np.linalg.det(F)), rel=1e-6)
    energy = NeoHookean(first, mu).energy(F) * solid.weights.sum()
    assert state.energy == pytest.approx(energy, rel=1e-8)


@pytest.mark.parametrize("nu", NUS)
def test_linear_answer_is_that_of_the_linear_reference(nu):
    mixed = body(nu, mesh=distorted())
    own = solid(straight(distorted()), "taylor-hood", tissue(nu))
    x, load = mixed.points, mixed.weight(np.array([1.0, 0.0, -9.81]), 1000.0)
    prescribed = np.where(x[:, 2:] < 1e-9, 0.0, np.full_like(x, np.nan))
    state = solve_linear(mixed, Loading(prescribed, load))
    expected = at_rest(own.stiffness, load, prescribed).reshape(-1, 3)
    assert np.abs(state.displacement - expected).max() < 1e-9 * np.abs(expected).max()
    # What holds it carries its weight.
    mass = 1000.0 * mixed.weights.sum()
    assert state.reaction.sum(axis=0) == pytest.approx(mass * np.array([-1.0, 0.0, 9.81]), rel=1e-9)


def test_small_strain_is_the_limit_of_large():
    solid = body(0.499)
    prescribed, high = plates(solid.points, 1e-5, bonded=True)
    loading = Loading(prescribed, np.zeros(solid.size))
    (large,), small = solid_path(solid, loading).states, solve_linear(solid, loading)
    assert large.reaction[high, 2].sum() == pytest.approx(small.reaction[high, 2].sum(), rel=1e-4)


def test_a_body_that_is_not_held_or_turned_inside_out_ends_declared():
    solid = body(0.499)
    prescribed, _ = plates(solid.points, 0.99, bonded=True)
    path = solid_path(solid, Loading(prescribed, np.zeros(solid.size)), (0.1, 1.0))
    assert not path.converged
    assert len(path.states) == 1
    assert 0.1 <= path.reached < 1.0
    assert "times the prescribed loading" in path.failure
    with pytest.raises(ValueError, match="do not fit"):
        solid_path(solid, Loading(prescribed[1:], np.zeros(solid.size)))
    with pytest.raises(ValueError, match="not zero"):
        solid_path(solid, Loading(prescribed, np.zeros(solid.size)), (0.0,))
    for nu in (0.0, -0.2):
        with pytest.raises(ValueError, match=r"tissue\.poisson_ratio"):
            mixed_solid(straight(block_mesh((EDGE,) * 3, EDGE)), Tissue(poisson_ratio=nu))


def test_a_slender_column_buckles_under_its_own_weight():
    """Greenhill (1881): a clamped column stands up to a weight per length of 7.837 E I / L^3."""
    side, length = 0.01, 0.2
    solid = body(0.45, mesh=block_mesh((side, side, length), side))
    x = solid.points
    prescribed = np.where(x[:, 2:] < 1e-9, 0.0, np.full_like(x, np.nan))
    greatest = 7.837 * E * side**4 / 12.0 / length**3
    weight = solid.weight(np.array([0.0, 0.0, -greatest / (1000.0 * side**2)]), 1000.0)
    path = solid_path(solid, Loading(prescribed, weight), (0.8, 1.2))
    assert np.abs(path.states[0].displacement[:, :2]).max() < 0.02 * length
    # Two cells of the elements more in width would come nearer; bent, it is followed no further.
    assert 0.95 < path.reached < 1.15
    assert path.failure.startswith((UNSTABLE, NO_EQUILIBRIUM))


def test_a_rod_between_walls_vibrates_at_its_closed_form():
    """Sides that slide leave waves along, of speed sqrt((lambda + 2 mu) / rho)."""
    nu, rho, length = 0.3, 1000.0, 0.04
    first, mu = lame(E, nu)
    exact = np.sqrt((first + 2.0 * mu) / rho) / (4.0 * length)
    solid = body(nu, size=0.01)
    prescribed = np.zeros_like(solid.points)
    prescribed[solid.points[:, 2] > 1e-9, 2] = np.nan
    loading = Loading(prescribed, np.zeros(solid.size))
    assert natural_frequency.lowest_frequency(solid, loading, rho) == pytest.approx(exact, rel=1e-3)
    # Stretched, it is stiffer or softer by the slope of its law there: lambda (1 - ln s) + mu
    # (s^2 + 1) over s^2, with the mass of the unloaded body.
    stretch = 1.2
    pulled = prescribed.copy()
    pulled[solid.points[:, 2] > length - 1e-9, 2] = (stretch - 1.0) * length
    (state,) = solid_path(solid, Loading(pulled, np.zeros(solid.size))).states
    slope = (first * (1.0 - np.log(stretch)) + mu * (stretch**2 + 1.0)) / stretch**2
    found = natural_frequency.lowest_frequency(solid, loading, rho, state)
    assert found == pytest.approx(np.sqrt(slope / rho) / (4.0 * length), rel=1e-3)
    nodes, law, net = lattice(nu, 0.005)
    volumes = np.prod(np.where((nodes < 1e-9) | (nodes > EDGE - 1e-9), 0.5, 1.0) * 0.005, axis=1)
    net = net._replace(mass=rho * volumes)
    prescribed = np.zeros_like(nodes)
    prescribed[nodes[:, 2] > 1e-9, 2] = np.nan
    assert displacement_control.lowest_frequency(law, net, prescribed) == pytest.approx(
        exact, rel=5e-3
    )


def test_the_cylinder_has_its_volume_and_converges():
    radius, height, forces = 0.025, 0.015, []
    for n in (2, 3, 4):
        mesh = quarter_cylinder(radius, height, n, n)
        solid = mixed_solid(curved(mesh, onto_side(radius, n)), tissue(0.499))
        volume = np.pi * radius**2 * height / 4.0
        assert solid.weights.sum() == pytest.approx(volume, rel=1e-3 / n**3)
        x = solid.points
        prescribed = np.full_like(x, np.nan)
        for axis in range(3):
            prescribed[x[:, axis] < 1e-9, axis] = 0.0
        top = x[:, 2] > height - 1e-9
        prescribed[top] = [0.0, 0.0, -0.01 * height]
        state = solve_linear(solid, Loading(prescribed, np.zeros(solid.size)))
        forces.append(state.reaction[top, 2].sum())
    # An upper bound of the stiffness comes down as the mesh is refined.
    assert abs(forces[0]) > abs(forces[1]) > abs(forces[2])
    assert forces[2] == pytest.approx(forces[1], rel=5e-3)


def lattice(nu, spacing=0.01):
    full = ImplicitBody(lambda x: np.full(x.shape[:-1], -1.0))
    found = cells.build(full, np.zeros(3), np.full(3, EDGE), spacing)
    term = volume.volume_term(found, E, nu) if nu > 0.25 else volume.none(spacing)
    count = len(found.nodes)
    net = network(
        connect(found),
        np.ones(count),
        csr_array((count, count)),
        np.zeros((count, 3)),
        term,
        UNDAMPED,
    )
    return found.nodes, Hooke(reference_stiffness(E, spacing, nu)), net


@pytest.mark.parametrize("nu", NUS)
def test_the_lattice_between_sliding_plates_has_its_modulus(nu):
    nodes, law, net = lattice(nu)
    prescribed, high = plates(nodes, 1e-6)
    (rest,) = lattice_path(law, net, prescribed).states
    assert rest.reaction[high, 2].sum() == pytest.approx(-1e-6 * E * EDGE**2, rel=1e-4)
    across = rest.displacement[:, 0].max() / EDGE
    assert across == pytest.approx(nu * 1e-6, rel=1e-4)


def test_forces_that_hold_the_lattice_are_the_slope_of_its_energy():
    """Work of the plates over a path is the energy stored: reactions add up to its derivative."""
    nodes, law, net = lattice(0.499)
    prescribed, high = plates(nodes, 0.2, bonded=True)
    factors = tuple(np.linspace(0.0, 1.0, 21)[1:])
    found = lattice_path(law, net, prescribed, factors)
    assert not found.failure
    force = np.array([0.0, *(rest.reaction[high, 2].sum() for rest in found.states)])
    work = np.trapezoid(force, -0.2 * EDGE * np.array([0.0, *factors]))
    last = found.states[-1].displacement
    stretch = np.linalg.norm(net.rest + last[net.ends[:, 1]] - last[net.ends[:, 0]], axis=1)
    energy = 0.5 * law.k * (net.scale / net.length) @ (stretch - net.length) ** 2
    F = np.einsum("cai,aj->cij", last[net.cells], (2 * cells.CORNERS - 1) / (4 * net.spacing)) + EYE
    energy += 0.5 * net.bulk @ (np.linalg.det(F) - 1.0) ** 2
    assert work == pytest.approx(energy, rel=2e-3)


def test_newtons_method_converges_quadratically_near_incompressibility():
    nodes, law, net = lattice(0.4999)
    prescribed, _ = plates(nodes, 0.1, bonded=True)
    (rest,) = lattice_path(law, net, prescribed).states
    assert len(rest.residuals) <= 7
    assert rest.residuals[-1] < 0.1 * rest.residuals[-2] ** 1.5 or rest.residuals[-1] < 1e-12


def test_a_lattice_that_gives_way_says_so():
    nodes, law, net = lattice(0.25)
    free = np.full_like(nodes, np.nan)
    loaded = net._replace(load=np.tile([0.0, 0.0, -1e-3], (len(nodes), 1)))
    found = lattice_path(law, loaded, free)
    assert found.failure
    assert found.reached == 0.0
    prescribed, _ = plates(nodes, 0.999, bonded=True)
    found = lattice_path(law, net, prescribed, (0.1, 1.0))
    assert found.failure
    assert len(found.states) == 1
    with pytest.raises(ValueError, match="does not fit"):
        lattice_path(law, net, prescribed[1:])
    with pytest.raises(ValueError, match="not zero"):
        lattice_path(law, net, prescribed, (0.0,))


def test_a_wrong_volume_term_is_seen():
    """The closed form of the modulus fails if the pressures carry another bulk modulus."""
    nodes, law, net = lattice(0.45)
    wrong = replace_bulk(net)
    prescribed, high = plates(nodes, 1e-6)
    (rest,) = lattice_path(law, wrong, prescribed).states
    assert rest.reaction[high, 2].sum() != pytest.approx(-1e-6 * E * EDGE**2, rel=1e-3)


def replace_bulk(net):
    return net._replace(bulk=0.5 * net.bulk)
