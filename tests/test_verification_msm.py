"""The spring lattice against closed forms and conservation laws."""

import numpy as np
import pytest
from scipy.sparse import csr_array

from msm import control_point
from msm.calibration import reference_stiffness
from msm.damping import NodalDamping, eq_2, eq_9
from msm.explicit import symplectic_euler
from msm.integrators import INTEGRATORS
from msm.lattice import build, interpolation, node_volumes
from msm.laws import Basafa, Hooke, initial_stiffness, largest_stiffness, tension
from msm.model import Assembly, Fixed, Material, critical_time_step, run
from msm.network import network as arrays
from msm.springs import Springs, connect, stiffness_matrix
from msm.volume import none
from study.organ.block import block_mesh
from study.organ.occupancy import ImplicitBody, MeshBody
from study.problem.trajectory import Observation

E, H = 4e3, 0.01
MIXES = [(0.0, 0.0), (0.3, 0.0), (0.0, 0.9), (0.5, 0.4), (1.0, 0.9)]
TABLE_2 = Basafa(0.05 / 5.5e-3, 10.0 / 5.5e-3, 0.2)


def block_lattice(counts=(5, 4, 3)):
    size = tuple(H * n for n in counts)
    return build(MeshBody(block_mesh(size, H)), np.zeros(3), np.array(size), H)


def ball_lattice():
    def ball(points):
        return np.linalg.norm(points, axis=-1) - 0.031

    return build(ImplicitBody(ball), np.full(3, -0.035), np.full(3, 0.035), H)


def strain_energy(lattice, springs, strain):
    displacement = (lattice.nodes @ strain.T).ravel()
    k = stiffness_matrix(springs, len(lattice.nodes), reference_stiffness(E, H))
    return 0.5 * displacement @ (k @ displacement)


def elastic_energy(volume, strain, nu=0.25):
    mu, lame = E / (2 * (1 + nu)), E * nu / ((1 + nu) * (1 - 2 * nu))
    return volume * (mu * (strain**2).sum() + 0.5 * lame * np.trace(strain) ** 2)


@pytest.mark.parametrize(("flexion", "body_diagonals"), MIXES)
@pytest.mark.parametrize("make", [block_lattice, ball_lattice])
def test_uniform_strain_stores_the_energy_of_e_and_a_quarter(make, flexion, body_diagonals, rng):
    """E and nu are exact for every family mix, on a block with a free surface and on cut cells.

    So are they where each cell has a stiffness of its own.
    """
    lattice = make()
    springs = connect(lattice, flexion, body_diagonals)
    volume = node_volumes(lattice).sum()
    for _ in range(5):
        strain = rng.standard_normal((3, 3))
        strain = strain + strain.T
        expected = elastic_energy(volume, strain)
        assert strain_energy(lattice, springs, strain) == pytest.approx(expected, rel=1e-12)
        relative = rng.uniform(0.2, 5.0, len(lattice.cells))
        uneven = connect(lattice, flexion, body_diagonals, relative)
        expected = elastic_energy(H**3 * lattice.fill @ relative, strain)
        assert strain_energy(lattice, uneven, strain) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("flexion", "body_diagonals"), MIXES)
def test_each_family_has_its_share_of_the_stiffness(flexion, body_diagonals):
    """Of the springs centred in one inner cell, which make up the whole lattice by translation."""
    lattice = block_lattice((6, 6, 6))
    springs = connect(lattice, flexion, body_diagonals)
    middle = lattice.nodes[springs.ends[:, 0]] + 0.5 * springs.rest
    inner = (np.floor(middle / H + 1e-9) == 3).all(axis=1)
    along = np.abs(springs.rest[inner] / H)
    axial = springs.weight[inner] * along[:, 0] ** 2 * (along[:, 1:] < 1e-9).all(axis=1)
    assert axial[along[:, 0] > 1.5].sum() == pytest.approx(flexion * axial.sum(), rel=1e-12)
    sheared = along[:, 0] * along[:, 1] / np.linalg.norm(along, axis=1)
    shear = springs.weight[inner] * sheared**2
    of_body = shear[along[:, 2] > 0.5].sum()
    assert of_body == pytest.approx(body_diagonals * shear.sum(), rel=1e-12)


def test_springs_without_boundary_shares_are_too_stiff():
    """Negative control: full springs on the surface must be seen, as +38 % on 4 cells a side."""
    lattice = block_lattice((4, 4, 4))
    shared = connect(lattice)
    plain = Springs(shared.ends, shared.rest, np.ones_like(shared.weight))
    nodes = len(lattice.nodes)
    moduli = []
    for springs in (shared, plain):
        k = stiffness_matrix(springs, nodes, reference_stiffness(E, H)).tocsr()
        moduli.append(uniaxial_modulus(k, lattice.nodes))
    assert moduli[0] == pytest.approx(E, rel=1e-10)
    assert moduli[1] / E == pytest.approx(1.38, abs=0.02)


def uniaxial_modulus(k, nodes):
    """Pull the ends apart, the sides free: force over area over strain."""
    z, top = nodes[:, 2], nodes[:, 2].max()
    held = np.zeros(len(nodes) * 3, dtype=bool)
    held[2::3] = (z < 1e-9) | (z > top - 1e-9)
    held[0] = held[1] = held[3 * np.argmax(nodes[:, 0]) + 1] = True  # rigid motion
    u = np.zeros(len(held))
    u[2::3] = np.where(z > top - 1e-9, 1e-3 * top, 0.0)
    free = ~held
    from scipy.sparse.linalg import spsolve

    u[free] = spsolve(k[free][:, free].tocsc(), -(k[free][:, held] @ u[held]))
    force = (k @ u)[2::3][z > top - 1e-9].sum()
    return force / (np.ptp(nodes[:, 0]) * np.ptp(nodes[:, 1])) / 1e-3


@pytest.mark.parametrize(("flexion", "body_diagonals"), [(1.1, 0.0), (0.0, 1.0), (-0.1, 0.0)])
def test_families_that_make_no_solid_are_refused(flexion, body_diagonals):
    with pytest.raises(ValueError, match="give a share from 0 to"):
        connect(block_lattice(), flexion, body_diagonals)


def test_a_wrong_calibration_factor_is_seen():
    """Negative control: 0.5 E h instead of 0.4 E h misses the energy by a quarter."""
    lattice = block_lattice()
    strain = np.diag([1.0, 0.0, 0.0])
    found = strain_energy(lattice, connect(lattice), strain) * 0.5 / 0.4
    expected = elastic_energy(node_volumes(lattice).sum(), strain)
    assert abs(found / expected - 1.25) < 1e-9


def network(springs, mass, volume=None):
    count = len(mass)
    empty, still = csr_array((count, count)), np.zeros((count, 3))
    return arrays(springs, mass, empty, still, volume or none(H), NodalDamping(0.0))


def advance(law, net, factors, dt, u, v):
    symplectic_euler(law, net, factors[:, None], dt, u, v)


@pytest.mark.parametrize("law", [Hooke(reference_stiffness(E, H)), TABLE_2])
def test_a_free_body_keeps_momentum_and_angular_momentum(law, rng):
    lattice = block_lattice((3, 3, 3))
    springs = connect(lattice, 0.2)
    mass = 1054 * node_volumes(lattice)
    net = network(springs, mass)
    u = np.zeros_like(lattice.nodes)
    v = 0.1 * rng.standard_normal(u.shape)
    momentum, spin = mass @ v, (mass[:, None] * np.cross(lattice.nodes, v)).sum(axis=0)
    advance(law, net, np.zeros(2000), 2e-4, u, v)
    assert np.abs(u).max() > 0.1 * H  # it did deform and turn
    # Rounding of 2000 steps of sums over 64 nodes.
    assert mass @ v == pytest.approx(momentum, abs=1e-12 * mass.sum())
    after = (mass[:, None] * np.cross(lattice.nodes + u, v)).sum(axis=0)
    assert after == pytest.approx(spin, abs=1e-11 * mass.sum() * H)


def test_a_quarter_turn_costs_no_energy():
    lattice = block_lattice((3, 3, 3))
    net = network(connect(lattice, 0.3, 0.5), np.ones(len(lattice.nodes)))
    turned = lattice.nodes @ np.array([[0, 1.0, 0], [-1.0, 0, 0], [0, 0, 1.0]])
    u, v = turned - lattice.nodes, np.zeros_like(lattice.nodes)
    advance(Hooke(reference_stiffness(E, H)), net, np.zeros(1), 1.0, u, v)
    assert np.abs(v).max() < 1e-14  # acceleration times one second


def test_a_body_at_rest_stays_at_rest():
    lattice = block_lattice()
    net = network(connect(lattice, 0.2), np.ones(len(lattice.nodes)))
    u, v = np.zeros((2, *lattice.nodes.shape))
    advance(Hooke(1.0), net, np.zeros(100), 1e-3, u, v)
    assert not u.any()


def oscillator(integrator, zeta, steps, duration=1.0):
    """End position of one mass on a foundation, from rest under a unit step; omega = 2 pi."""
    omega = 2 * np.pi
    nothing = Springs(np.zeros((0, 2), int), np.zeros((0, 3)), np.zeros(0))
    ground, load = csr_array(omega**2 * np.eye(1)), np.array([[omega**2, 0, 0]])
    net = arrays(nothing, np.ones(1), ground, load, none(H), NodalDamping(2 * zeta * omega))
    u, v = np.zeros((2, 1, 3))
    method = INTEGRATORS[integrator]
    factors = np.ones((steps, len(method.at)))
    method.advance(Hooke(1.0), net, factors, duration / steps, u, v)
    return u[0, 0]


def exact_oscillator(zeta, t=1.0):
    omega = 2 * np.pi
    if zeta < 1:
        damped = omega * np.sqrt(1 - zeta**2)
        return 1 - np.exp(-zeta * omega * t) * (
            np.cos(damped * t) + zeta * omega / damped * np.sin(damped * t)
        )
    root = omega * np.sqrt(zeta**2 - 1)
    return 1 - np.exp(-zeta * omega * t) * (
        np.cosh(root * t) + zeta * omega / root * np.sinh(root * t)
    )


@pytest.mark.parametrize("zeta", [0.3, 0.9, 5.0])
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_the_integrator_has_the_order_it_declares(integrator, zeta):
    order = INTEGRATORS[integrator].order
    counts = (400, 800, 1600) if order < 4 else (50, 100, 200)
    errors = [abs(oscillator(integrator, zeta, n) - exact_oscillator(zeta)) for n in counts]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx(order, abs=0.2)


def test_the_paper_s_oscillator_meets_its_closed_form():
    k, zeta, mass = 9.1, 0.9, 0.136
    times = np.linspace(0, 3, 61)
    found = control_point.run(
        Hooke(k), 5.5e-3, mass, eq_2(zeta, k, mass), lambda _: 2e-3, times
    ).displacement[:, 0, 0]
    omega = np.sqrt(k / mass)
    damped = omega * np.sqrt(1 - zeta**2)
    shape = np.cos(damped * times) + zeta * omega / damped * np.sin(damped * times)
    exact = 2e-3 / k * (1 - np.exp(-zeta * omega * times) * shape)
    assert np.abs(found - exact).max() < 1e-7 * exact.max()


def test_eq_2_meets_the_benchmark_s_damping_at_the_paper_s_mass():
    k = initial_stiffness(TABLE_2)
    mass = control_point.mass_that_meets(2.0, 0.9, k)
    assert k * mass == pytest.approx(1.235, abs=5e-4)
    assert eq_2(0.9, k, mass).gamma_0 == pytest.approx(eq_9(2.0, 1000.0, mass).gamma_0)


def test_benchmark_law_is_continuous_with_its_slope_at_x_c():
    law = Basafa(0.05, 10.0, 0.2)
    assert tension(law, 0.2) == pytest.approx(0.09)  # A of eq. (7)
    step = 1e-7
    inner = (tension(law, 0.2) - tension(law, 0.2 - step)) / step
    outer = (tension(law, 0.2 + step) - tension(law, 0.2)) / step
    assert inner == pytest.approx(1.25, rel=1e-4)  # B of eq. (7)
    assert outer == pytest.approx(1.25, rel=1e-4)
    assert largest_stiffness(law) == pytest.approx(1.25)
    assert tension(law, -0.5) == -tension(law, 0.5)


def test_eq_7_read_literally_would_flip_the_force_in_compression():
    """Why A and B are taken at x_c: with the current X the force jumps from -0.09 N to +0.09 N."""
    law = Basafa(0.05, 10.0, 0.2)
    x = -0.2000001
    literal = (law.k1 * x + law.k2 * x**3) * x / abs(x)
    assert literal > 0 > tension(law, x)


def compiled_tension(law, strain):
    return tension(law, strain)


@pytest.mark.parametrize("law", [Hooke(16.0), TABLE_2])
def test_compiled_law_equals_the_plain_one(law):
    import numba

    import msm.forces  # noqa: F401 - it registers the compiled form

    compiled = numba.njit(compiled_tension)
    for strain in np.linspace(-0.9, 2.0, 59):
        assert compiled(law, strain) == pytest.approx(tension(law, strain), rel=1e-15)


def test_benchmark_scaling_keeps_the_modulus_at_every_spacing():
    """K (h / h_0)^2 per length h: k_ref / h, and so E = 2.5 k_ref / h, does not change."""
    from study.models import table
    from study.scene.file import read_scene

    for spacing in ("5 mm", "10 mm", "20 mm"):
        scene = read_scene("liver", [f"lattice.spacing={spacing}"])
        h = scene.lattice.spacing
        size = (2 * h, 2 * h, 2 * h)
        mesh = build(MeshBody(block_mesh(size, h)), np.zeros(3), np.array(size), h)
        found = table.model(scene, "basafa").make(scene, mesh)
        material = found.material
        assert 2.5 * material.law.k1 / h == pytest.approx(found.modulus)
        assert found.modulus == pytest.approx(4132, abs=1)
        assert material.damping.gamma_0 == pytest.approx(2 / (1054 * 0.0055**3))


def free_assembly(lattice, kick):
    """A free lattice with a load that excites all its modes."""
    mass = 1054 * node_volumes(lattice)
    empty = csr_array((len(mass), len(mass)))
    return Assembly(lattice, connect(lattice), mass, empty, kick)


@pytest.mark.parametrize(("fraction", "status"), [(0.98, "finished"), (1.02, "diverged")])
def test_the_predicted_critical_step_is_sharp(fraction, status, rng):
    lattice = block_lattice((4, 3, 3))
    kick = rng.standard_normal(lattice.nodes.shape)
    kick -= kick.mean(axis=0)
    assembly = free_assembly(lattice, 1e-6 * kick)
    law = Hooke(reference_stiffness(E, H))
    critical = critical_time_step(assembly, Material(law))
    # Samples of whole numbers of steps of the wanted fraction of the critical one.
    samples = np.arange(21) * 100 * fraction * critical
    none = np.zeros((0, 3))
    watch = Observation(samples, lattice.nodes[:1], (20,), none, none)
    found = run(assembly, Material(law), np.ones_like, watch, Fixed(fraction * critical))
    assert found.largest_step == found.smallest_step == pytest.approx(fraction * critical)
    assert found.trajectory.status == status
    if status == "diverged":
        assert 0 < found.trajectory.ended_at <= samples[-1]
        assert found.trajectory.ended_near.shape == (3,)


def test_interpolation_reproduces_linear_fields_also_just_outside(rng):
    lattice = block_lattice()
    points = rng.uniform([-0.003] * 3, [0.053, 0.043, 0.033], (500, 3))
    weights, outside = interpolation(lattice, points)
    assert np.abs(weights @ lattice.nodes - points).max() < 1e-15
    inside = ((points >= 0) & (points <= [0.05, 0.04, 0.03])).all(axis=1)
    assert outside == (~inside).sum()


def test_only_cells_joined_by_faces_are_kept():
    def two_cubes(points):
        """Cubes that touch along an edge: one would hinge on the other."""
        a = np.abs(points - 0.01).max(axis=-1) - 0.01
        b = np.abs(points - [0.03, 0.03, 0.01]).max(axis=-1) - 0.01
        return np.minimum(a, b)

    lattice = build(ImplicitBody(two_cubes), np.zeros(3), np.array([0.04, 0.04, 0.02]), 0.01)
    assert len(lattice.cells) == 8
    assert lattice.dropped == pytest.approx(0.5)


def test_a_lattice_too_coarse_for_the_organ_is_refused():
    def speck(points):
        return np.linalg.norm(points - 0.05, axis=-1) - 1e-3

    with pytest.raises(ValueError, match=r"reduce lattice\.spacing"):
        build(ImplicitBody(speck), np.zeros(3), np.full(3, 0.1), 0.1)
