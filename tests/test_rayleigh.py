"""Rayleigh damping of the lattice: modes decay as they should, rigid motion is left alone."""

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.sparse import csr_array, eye_array, kron

from msm import volume
from msm.calibration import reference_stiffness
from msm.damping import UNDAMPED, NodalDamping
from msm.explicit import symplectic_euler
from msm.integrators import INTEGRATORS
from msm.lattice import build, node_volumes
from msm.laws import Basafa, Hooke, initial_stiffness, stiffness
from msm.network import network
from msm.rayleigh import add_stiffness_damping
from msm.springs import connect, stiffness_matrix
from msm.stability import DEFAULT, longest_step
from study.organ.block import block_mesh
from study.organ.occupancy import MeshBody

E, NU, H = 4e3, 0.45, 0.01
HOOKE = Hooke(reference_stiffness(E, H, NU))
BASAFA = Basafa(HOOKE.k, 200 * HOOKE.k, 0.2)


class Block:
    """A free or held block of 3 x 2 x 2 cells with the volume term."""

    def __init__(self, damping=UNDAMPED, *, held=False, linear=True):
        size = (3 * H, 2 * H, 2 * H)
        self.lattice = build(MeshBody(block_mesh(size, H)), np.zeros(3), np.array(size), H)
        count = len(self.lattice.nodes)
        ground = 5.0 * (self.lattice.nodes[:, 0] < 1e-9) if held else np.zeros(count)
        self.foundation = csr_array((ground, (np.arange(count), np.arange(count))))
        self.mass = 1060 * node_volumes(self.lattice)
        self.springs = connect(self.lattice, 0.2)
        self.term = volume.volume_term(self.lattice, E, NU)
        still = np.zeros((count, 3))
        self.net = network(
            self.springs, self.mass, self.foundation, still, self.term, damping, linear=linear
        )

    def stiffness(self, k_ref):
        count = len(self.mass)
        springs = stiffness_matrix(self.springs, count, k_ref)
        term = volume.stiffness_matrix(self.term, count)
        return (springs + term + kron(self.foundation, eye_array(3))).toarray()

    def modes(self):
        """Frequencies [rad/s] and shapes of unit mass, one per column."""
        squared, shapes = eigh(self.stiffness(HOOKE.k), np.diag(np.repeat(self.mass, 3)))
        return np.sqrt(np.maximum(squared, 0.0)), shapes

    def resistance(self, law, u, v, b=1.0):
        force = np.zeros_like(u)
        add_stiffness_damping(law, self.net, u, b * v, force)
        return force


def measured_ratio(block, law, shape, omega, amplitude):
    """Damping ratio from the energy a mode let go has lost after five of its periods."""
    dt = 2e-3 / omega
    steps = int(10 * np.pi / 2e-3)
    u = amplitude * shape.reshape(-1, 3)
    v = np.zeros_like(u)
    before = energy(block, shape, omega, u, v)
    symplectic_euler(law, block.net, np.zeros((steps, 1)), dt, u, v)
    return np.log(before / energy(block, shape, omega, u, v)) / (2 * omega * steps * dt)


def energy(block, shape, omega, u, v):
    """Energy [J] of the mode in the motion."""
    weigh = np.repeat(block.mass, 3) * shape
    q, p = weigh @ u.ravel(), weigh @ v.ravel()
    return 0.5 * (p**2 + omega**2 * q**2)


@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize("linear", [True, False])
def test_modes_decay_with_the_ratio_of_rayleigh(held, linear):
    """zeta = (alpha / omega + beta omega) / 2 from the slowest elastic mode to the fastest.

    Measured 0.13 % off at most: the first-order error of the step, omega dt = 0.002.
    """
    omega, shapes = Block(held=held).modes()
    first = 0 if held else 6
    both = omega[first] + omega[-1]  # zeta = 0.05 at either
    damping = NodalDamping(0.1 * omega[first] * omega[-1] / both, beta=0.1 / both)
    block = Block(damping, held=held, linear=linear)
    for m in (first, first + 1, 30, len(omega) - 1):
        expected = (damping.gamma_0 / omega[m] + damping.beta * omega[m]) / 2
        amplitude = 1e-7 * H / np.abs(shapes[:, m]).max()
        found = measured_ratio(block, HOOKE, shapes[:, m], omega[m], amplitude)
        assert found == pytest.approx(expected, rel=2e-3), m


def test_without_the_volume_term_s_dashpots_a_mode_is_damped_too_little():
    """Negative control: the springs alone give the fastest mode a fifth of its damping."""
    block = Block()
    omega, shapes = block.modes()
    b = 0.1 / omega[-1]
    bare = block.net._replace(bulk=np.zeros_like(block.net.bulk))
    whole, springs = (damping_ratio(net, shapes[:, -1], omega[-1], b) for net in (block.net, bare))
    assert whole == pytest.approx(0.05, rel=1e-10)
    assert springs < 0.015


def damping_ratio(net, shape, omega, b):
    """From the power the mode loses at unit speed: 2 zeta omega, for a mode of unit mass."""
    v = shape.reshape(-1, 3)
    force = np.zeros_like(v)
    add_stiffness_damping(HOOKE, net, np.zeros_like(v), b * v, force)
    return -(force * v).sum() / (2 * omega)


@pytest.mark.parametrize("law", [HOOKE, BASAFA])
@pytest.mark.parametrize("linear", [True, False])
def test_at_rest_the_dashpots_are_beta_times_the_stiffness(law, linear, rng):
    block = Block(held=True, linear=linear)
    v = rng.standard_normal((len(block.mass), 3))
    expected = -0.3 * (block.stiffness(initial_stiffness(law)) @ v.ravel()).reshape(-1, 3)
    found = block.resistance(law, np.zeros_like(v), v, 0.3)
    assert found == pytest.approx(expected, abs=1e-13 * np.abs(expected).max())


@pytest.mark.parametrize("law", [HOOKE, BASAFA])
@pytest.mark.parametrize("linear", [True, False])
def test_dashpots_only_ever_take_energy_and_no_momentum(law, linear, rng):
    block = Block(linear=linear)
    for _ in range(20):
        u, v = 0.3 * H * rng.standard_normal((2, len(block.mass), 3))
        force = block.resistance(law, u, v)
        size = np.abs(force).max()
        assert (force * v).sum() < 0.0
        assert force.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-12 * size)
        if not linear:
            torque = np.cross(block.lattice.nodes + u, force).sum(axis=0)
            assert torque == pytest.approx(np.zeros(3), abs=1e-12 * size)


def turning(block, rng):
    """A deformed body, and the velocities of its rotation at 1 rad/s."""
    u = 0.2 * H * rng.standard_normal((len(block.mass), 3))
    return u, np.cross([0.6, 0.0, 0.8], block.lattice.nodes + u)


@pytest.mark.parametrize("law", [HOOKE, BASAFA])
def test_a_rotation_is_not_damped_by_the_stiffness_part(law, rng):
    block = Block(linear=False)
    u, v = turning(block, rng)
    stretch = block.resistance(law, u, u)  # a motion of the same size that does deform
    assert np.abs(block.resistance(law, u, v)).max() < 1e-13 * np.abs(stretch).max()


def test_the_linear_path_does_damp_the_rotation_of_a_deformed_body(rng):
    """Negative control: frozen directions cannot tell rotation from stretch."""
    block = Block(linear=True)
    u, v = turning(block, rng)
    assert (
        np.abs(block.resistance(HOOKE, u, v)).max()
        > 0.1 * np.abs(block.resistance(HOOKE, u, u)).max()
    )


def test_a_body_turns_on_under_the_stiffness_part_and_stops_under_the_mass_part():
    """Half a second at 2 rad/s: alpha = 4 / s leaves exp(-2) of the spin, any beta all of it."""
    dt, steps = 1e-4, 5000
    left = []
    for damping in (NodalDamping(0.0, beta=1e-3), NodalDamping(4.0)):
        block = Block(damping, linear=False)
        arm = block.lattice.nodes - block.lattice.nodes.mean(axis=0)
        u, v = np.zeros_like(arm), np.cross([0.0, 0.0, 2.0], arm)
        spin = (block.mass[:, None] * np.cross(arm, v)).sum(axis=0)[2]
        symplectic_euler(HOOKE, block.net, np.zeros((steps, 1)), dt, u, v)
        after = (block.mass[:, None] * np.cross(arm + u, v)).sum(axis=0)[2]
        left.append(after / spin)
    assert left[0] == pytest.approx(1.0, abs=1e-12)  # rounding of 5000 steps
    assert left[1] == pytest.approx(np.exp(-2.0), rel=1e-3)


@pytest.mark.parametrize("alpha", [0.0, 50.0])
@pytest.mark.parametrize("zeta", [0.0, 0.1, 1.0, 5.0])
def test_the_step_limit_is_safe_and_sharp_without_a_mass_part(zeta, alpha, rng):
    """Stable 1 % below, and lost 1 % above if alpha, which only lengthens the step, is zero."""
    omega = Block(held=True).modes()[0][-1]
    block = Block(NodalDamping(alpha, beta=2 * zeta / omega), held=True)
    limit = longest_step(INTEGRATORS[DEFAULT], omega, 0.0, block.net.beta)
    largest = []
    for share in (0.99, 1.01):
        u, v = 1e-3 * H * rng.standard_normal((2, len(block.mass), 3))
        symplectic_euler(HOOKE, block.net, np.zeros((4000, 1)), share * limit, u, v)
        largest.append(np.abs(u).max())
    assert largest[0] < H
    assert alpha > 0.0 or not largest[1] < 1e3 * H


def test_a_stiffening_law_is_damped_by_its_slope_at_the_strain(rng):
    """The power lost is that of one dashpot per spring, of its weight times that slope."""
    block = Block(linear=False)
    net = block.net._replace(bulk=np.zeros_like(block.net.bulk))
    u, v = 0.15 * H * rng.standard_normal((2, len(block.mass), 3))
    i, j = net.ends.T
    now = net.rest + u[j] - u[i]
    length = np.linalg.norm(now, axis=1)
    growth = ((v[j] - v[i]) * now).sum(axis=1) / length
    slope = np.array([stiffness(BASAFA, x) for x in length / net.length - 1.0])
    assert slope.max() > 1.5 * slope.min()
    force = np.zeros_like(u)
    add_stiffness_damping(BASAFA, net, u, v, force)
    expected = -(net.scale / net.length * slope * growth**2).sum()
    assert (force * v).sum() == pytest.approx(expected, rel=1e-12)
