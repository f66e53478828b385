"""The volume term: exact moduli, forces that derive from an energy, conservation, stability."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_array

from msm.assembly import Assembly, Material
from msm.calibration import lame, reference_stiffness
from msm.damping import UNDAMPED
from msm.explicit import symplectic_euler, velocity_verlet
from msm.forces import internal_forces
from msm.lattice import CORNERS, build, node_volumes
from msm.laws import Hooke
from msm.network import network
from msm.springs import Springs, connect
from msm.springs import stiffness_matrix as spring_stiffness
from msm.stability import critical_time_step
from msm.volume import none, volume_term
from msm.volume import stiffness_matrix as volume_stiffness
from study.organ.block import block_mesh
from study.organ.occupancy import ImplicitBody, MeshBody

E, H, RHO = 4e3, 0.01, 1060.0
RATIOS = [0.25, 0.3, 0.45, 0.49, 0.4999, 0.49999]
MIXES = [(0.0, 0.0), (0.3, 0.0), (0.0, 0.9), (0.5, 0.4)]
QUARTER_TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def block_lattice(counts=(4, 3, 3)):
    size = tuple(H * n for n in counts)
    return build(MeshBody(block_mesh(size, H)), np.zeros(3), np.array(size), H)


def ball_lattice():
    def ball(points):
        return np.linalg.norm(points, axis=-1) - 0.031

    return build(ImplicitBody(ball), np.full(3, -0.035), np.full(3, 0.035), H)


def spring_law(nu):
    return Hooke(reference_stiffness(E, H, nu))


def stiffness(lattice, nu, mix=(0.0, 0.0), volume=True):
    """Stiffness [N/m] of springs and, if wanted, volume term at rest."""
    count = len(lattice.nodes)
    k = csr_array(spring_stiffness(connect(lattice, *mix), count, reference_stiffness(E, H, nu)))
    term = volume_term(lattice, E, nu) if volume else none(H)
    return csr_array(k + volume_stiffness(term, count))


def free_network(lattice, nu, *, linear, mix=(0.0, 0.0)):
    """A free, undamped, unloaded network."""
    mass = RHO * node_volumes(lattice)
    nothing = csr_array((len(mass), len(mass)))
    term = volume_term(lattice, E, nu)
    springs = connect(lattice, *mix)
    return network(
        springs, mass, nothing, np.zeros_like(lattice.nodes), term, UNDAMPED, linear=linear
    )


def forces(net, nu, u):
    found = np.empty_like(u)
    internal_forces(spring_law(nu), net, u, found)
    return found


def energy(lattice, nu, u, mix=(0.0, 0.0)):
    springs, term = connect(lattice, *mix), volume_term(lattice, E, nu)
    return finite_energy(springs, reference_stiffness(E, H, nu), term, u)


def finite_energy(springs, k_ref, term, u):
    """Stored energy [J] at finite displacement, written from its definition.

    Plain polynomials and a square root of u, so that complex displacements go through.
    """
    d = springs.rest + u[springs.ends[:, 1]] - u[springs.ends[:, 0]]
    stretch = np.sqrt((d**2).sum(axis=1)) - springs.rest_length
    stored = 0.5 * k_ref * (springs.weight * stretch**2).sum()
    slopes = (2 * CORNERS - 1) / (4 * H)
    gradient = np.eye(3) + np.einsum("cad,ae->cde", u[term.cells], slopes)
    jacobian = (gradient[:, 0] * np.cross(gradient[:, 1], gradient[:, 2])).sum(axis=1)
    return stored + 0.5 * (term.bulk * (jacobian - 1) ** 2).sum()


def elastic_energy(volume, strain, nu):
    first, mu = lame(E, nu)
    return volume * (mu * (strain**2).sum() + 0.5 * first * np.trace(strain) ** 2)


@pytest.mark.parametrize("nu", RATIOS)
@pytest.mark.parametrize("mix", MIXES)
@pytest.mark.parametrize("make", [block_lattice, ball_lattice])
def test_uniform_strain_stores_the_energy_of_e_and_nu(make, mix, nu, rng):
    """Exact for any mix of families, at free surfaces and in cut cells."""
    lattice = make()
    k = stiffness(lattice, nu, mix)
    volume = node_volumes(lattice).sum()
    for _ in range(3):
        strain = rng.standard_normal((3, 3))
        strain = strain + strain.T
        u = (lattice.nodes @ strain.T).ravel()
        expected = elastic_energy(volume, strain, nu)
        assert 0.5 * u @ (k @ u) == pytest.approx(expected, rel=1e-12)


def test_one_per_cent_of_kappa_is_seen():
    """Negative control: the energy of a pure dilation moves by the share of kappa in K."""
    nu, lattice = 0.45, block_lattice()
    first, mu = lame(E, nu)
    u = lattice.nodes.ravel()
    springs, both = (u @ (stiffness(lattice, nu, volume=v) @ u) for v in (False, True))
    expected = elastic_energy(node_volumes(lattice).sum(), np.eye(3), nu)
    wrong = 0.5 * (springs + 1.01 * (both - springs)) / expected - 1.0
    assert wrong == pytest.approx(0.01 * 4.5 * (first - mu) / (3 * mu + 4.5 * first), rel=1e-9)


def test_without_the_term_the_energy_is_that_of_a_quarter():
    """Negative control: springs of modulus mu alone store what lambda = mu stores."""
    nu, lattice = 0.45, block_lattice()
    mu = lame(E, nu)[1]
    u = lattice.nodes.ravel()
    found = 0.5 * u @ (stiffness(lattice, nu, volume=False) @ u)
    volume = node_volumes(lattice).sum()
    assert found == pytest.approx(elastic_energy(volume, np.eye(3), 0.25) * mu / (0.4 * E))
    assert found < 0.2 * elastic_energy(volume, np.eye(3), nu)


def test_a_quarter_leaves_springs_alone():
    lattice = ball_lattice()
    assert not volume_term(lattice, E, 0.25).bulk.any()
    assert reference_stiffness(E, H, 0.25) == pytest.approx(0.4 * E * H, rel=1e-15)
    difference = stiffness(lattice, 0.25) - stiffness(lattice, 0.25, volume=False)
    assert abs(difference).max() == 0.0


@pytest.mark.parametrize("nu", [-0.1, 0.0, 0.2499, 0.499991, 0.5, float("nan")])
def test_ratios_that_the_term_cannot_carry_are_refused(nu):
    with pytest.raises(ValueError, match=r"from 0\.25 to 0\.4999.*change tissue\.poisson_ratio"):
        volume_term(block_lattice((1, 1, 1)), E, nu)


def test_below_a_quarter_a_blown_up_body_would_gain_energy():
    """Why it is refused: small strains are stable, but the energy has no lower bound."""
    lattice, nu = block_lattice((2, 2, 2)), 0.0
    first, mu = lame(E, nu)
    term = volume_term(lattice, E, 0.25)
    negative = replace(term, bulk=(first - mu) * lattice.fill * H**3)
    small = spring_stiffness(connect(lattice), len(lattice.nodes), mu * H)
    small = small + volume_stiffness(negative, len(lattice.nodes))
    assert np.linalg.eigvalsh(small.toarray())[0] > -1e-12 * mu * H
    # Grown by e along each axis: 7.5 mu e^2 in the springs, -mu ((1 + e)^3 - 1)^2 / 2 in the cells.
    assert finite_energy(connect(lattice), mu * H, negative, 0.2 * lattice.nodes) > 0.0
    assert finite_energy(connect(lattice), mu * H, negative, 0.4 * lattice.nodes) < 0.0


@pytest.mark.parametrize("nu", [0.25, 0.45, 0.49])
@pytest.mark.parametrize("make", [block_lattice, ball_lattice])
def test_finite_forces_are_minus_the_gradient_of_the_energy(make, nu, rng):
    """The complex step has no cancellation, so the gradient is exact to rounding."""
    lattice = make()
    net = free_network(lattice, nu, linear=False, mix=(0.3, 0.2))
    u = 0.1 * H * rng.standard_normal(lattice.nodes.shape)
    found = forces(net, nu, u)
    step = 1e-30
    for _ in range(20):
        node, axis = rng.integers(len(u)), rng.integers(3)
        moved = u.astype(complex)
        moved[node, axis] += 1j * step
        slope = energy(lattice, nu, moved, (0.3, 0.2)).imag / step
        assert found[node, axis] == pytest.approx(-slope, abs=1e-12 * np.abs(found).max())


@pytest.mark.parametrize("nu", [0.25, 0.45, 0.4999, 0.49999])
@pytest.mark.parametrize("make", [block_lattice, ball_lattice])
def test_linear_forces_are_minus_stiffness_times_displacement(make, nu, rng):
    """The stiffness comes from the assembled operators, whose energy the uniform strains check."""
    lattice = make()
    net = free_network(lattice, nu, linear=True, mix=(0.3, 0.2))
    u = 0.1 * H * rng.standard_normal(lattice.nodes.shape)
    expected = -(stiffness(lattice, nu, (0.3, 0.2)) @ u.ravel()).reshape(-1, 3)
    found = forces(net, nu, u)
    assert np.abs(found - expected).max() < 1e-13 * np.abs(expected).max()


@pytest.mark.parametrize("nu", [0.25, 0.45, 0.49])
def test_finite_forces_approach_the_linear_ones_at_second_order(nu, rng):
    lattice = ball_lattice()
    finite, small = (free_network(lattice, nu, linear=linear) for linear in (False, True))
    u = H * rng.standard_normal(lattice.nodes.shape)
    departure = [
        np.linalg.norm(forces(finite, nu, s * u) - forces(small, nu, s * u))
        for s in (1e-2, 1e-3, 1e-4)
    ]
    orders = np.log10(np.array(departure[:-1]) / departure[1:])
    # The cubic part is 1e-2 of the quadratic one at most.
    assert orders == pytest.approx(2.0, abs=0.03)


@pytest.mark.parametrize("nu", [0.45, 0.49])
def test_a_quarter_turn_costs_nothing(nu):
    lattice = ball_lattice()
    u = lattice.nodes @ QUARTER_TURN.T - lattice.nodes
    found = forces(free_network(lattice, nu, linear=False), nu, u)
    scale = E * H**2  # force of a strain of one on a cell face
    assert np.abs(found).max() < 1e-12 * scale
    assert energy(lattice, nu, u) < 1e-24 * E * H**3


def test_a_quarter_turn_of_the_linear_forces_costs_energy():
    """Negative control: small-displacement forces take the turn for a strain of -1 in its plane."""
    nu, lattice = 0.45, block_lattice()
    u = lattice.nodes @ QUARTER_TURN.T - lattice.nodes
    found = forces(free_network(lattice, nu, linear=True), nu, u)
    stored = -0.5 * (found * u).sum()
    volume = node_volumes(lattice).sum()
    assert stored == pytest.approx(elastic_energy(volume, np.diag([-1.0, -1.0, 0.0]), nu))


@pytest.mark.parametrize("advance", [symplectic_euler, velocity_verlet])
@pytest.mark.parametrize("nu", [0.45, 0.49])
def test_a_free_body_keeps_momentum_and_angular_momentum(nu, advance, rng):
    lattice = block_lattice((3, 3, 3))
    net = free_network(lattice, nu, linear=False)
    mass = net.mass
    u, v = np.zeros_like(lattice.nodes), 0.1 * rng.standard_normal(lattice.nodes.shape)
    momentum, spin = mass @ v, (mass[:, None] * np.cross(lattice.nodes, v)).sum(axis=0)
    columns = 1 if advance is symplectic_euler else 2
    # Near half the critical step of 2.3 and 1.1 ms.
    advance(spring_law(nu), net, np.zeros((2000, columns)), 5e-4, u, v)
    assert np.abs(u).max() > 0.1 * H  # it did deform and turn
    # Rounding of 2000 steps of sums over 64 nodes.
    assert mass @ v == pytest.approx(momentum, abs=1e-12 * mass.sum())
    after = (mass[:, None] * np.cross(lattice.nodes + u, v)).sum(axis=0)
    assert after == pytest.approx(spin, abs=1e-11 * mass.sum() * H)


def test_linear_forces_lose_angular_momentum(rng):
    """Negative control: they act along the springs at rest, beside those that have turned."""
    lattice = block_lattice((3, 3, 3))
    net = free_network(lattice, 0.45, linear=True)
    u, v = np.zeros_like(lattice.nodes), 0.1 * rng.standard_normal(lattice.nodes.shape)
    spin = (net.mass[:, None] * np.cross(lattice.nodes, v)).sum(axis=0)
    symplectic_euler(spring_law(0.45), net, np.zeros((2000, 1)), 5e-4, u, v)
    after = (net.mass[:, None] * np.cross(lattice.nodes + u, v)).sum(axis=0)
    assert np.abs(after - spin).max() > 1e-3 * net.mass.sum() * H * 0.1


def free_assembly(lattice):
    mass = RHO * node_volumes(lattice)
    nothing = csr_array((len(mass), len(mass)))
    return Assembly(lattice, connect(lattice), mass, nothing, np.zeros_like(lattice.nodes))


@pytest.mark.parametrize("linear", [False, True])
@pytest.mark.parametrize("nu", [0.45, 0.49])
@pytest.mark.parametrize(("fraction", "stable"), [(0.98, True), (1.02, False)])
def test_the_critical_step_with_the_term_is_sharp(fraction, stable, nu, linear, rng):
    """Two per cent beyond it the fastest mode grows 1.2-fold a step; within, nothing grows."""
    lattice = block_lattice()
    material = Material(spring_law(nu), volume_term(lattice, E, nu))
    dt = fraction * critical_time_step(free_assembly(lattice), material)
    net = free_network(lattice, nu, linear=linear)
    u, v = np.zeros_like(lattice.nodes), 1e-6 * rng.standard_normal(lattice.nodes.shape)
    v -= net.mass @ v / net.mass.sum()
    symplectic_euler(spring_law(nu), net, np.zeros((2000, 1)), dt, u, v)
    grown = np.abs(u).max() / H
    # The body also turns, at 1e-6 m/s and for up to five seconds.
    assert grown < 1e-2 if stable else not grown < 1.0


@pytest.mark.parametrize("nu", [0.45, 0.49])
def test_the_critical_step_without_the_term_is_too_long_with_it(nu):
    """Negative control: springs alone promise a step that the term does not stand."""
    lattice = block_lattice()
    assembly = free_assembly(lattice)
    with_term = Material(spring_law(nu), volume_term(lattice, E, nu))
    springs = critical_time_step(assembly, Material(spring_law(nu)))
    assert springs > 1.5 * critical_time_step(assembly, with_term)


@pytest.mark.parametrize("volume", [False, True])
@pytest.mark.parametrize("body_diagonals", [0.0, 0.4, 0.9])
def test_a_cell_resists_all_but_rigid_motion(body_diagonals, volume):
    """Rank 18 of 24: no hourglass mode to stabilise."""
    lattice = block_lattice((1, 1, 1))
    values = np.linalg.eigvalsh(stiffness(lattice, 0.45, (0.0, body_diagonals), volume).toarray())
    assert np.abs(values[:6]).max() < 1e-12 * E * H
    assert values[6] > 0.1 * (1.0 - body_diagonals) * E * H


@pytest.mark.parametrize("flexion", [0.0, 1.0])
def test_face_diagonals_are_what_holds_the_faces(flexion):
    """Why a lattice without them is refused: u_x = (-1)^(j + k) would pass at no cost."""
    lattice = block_lattice((4, 4, 4))
    springs = connect(lattice, flexion)
    changes = (np.abs(springs.rest) > 1e-9 * H).sum(axis=1)
    without = Springs(
        *(part[changes != 2] for part in (springs.ends, springs.rest, springs.weight))
    )
    k = spring_stiffness(without, len(lattice.nodes), reference_stiffness(E, H, 0.45))
    chequered = np.zeros((5, 5, 5, 3))
    chequered[..., 0] = (-1.0) ** np.add.outer(np.arange(5), np.arange(5))
    assert np.abs(k @ chequered.ravel()).max() < 1e-12 * E * H
    held = stiffness(lattice, 0.45, (flexion, 0.9)) @ chequered.ravel()
    assert np.abs(held).max() > 0.01 * E * H


def test_the_term_alone_leaves_hourglass_modes():
    """Negative control: one mean strain per cell sees a single motion of the 24."""
    lattice = block_lattice((1, 1, 1))
    k = volume_stiffness(volume_term(lattice, E, 0.45), len(lattice.nodes))
    assert np.linalg.matrix_rank(k.toarray()) == 1
