"""Spring laws: tensions, their slopes, laws given by points, plain and compiled."""

import numba
import numpy as np
import pytest
from scipy.sparse import csr_array

from msm.calibration import reference_stiffness
from msm.damping import UNDAMPED
from msm.explicit import symplectic_euler
from msm.lattice import build, node_volumes
from msm.laws import (
    Basafa,
    Hooke,
    Piecewise,
    initial_stiffness,
    largest_stiffness,
    piecewise,
    stiffness,
    tension,
)
from msm.network import network
from msm.springs import connect
from msm.volume import none
from study.organ.block import block_mesh
from study.organ.occupancy import MeshBody

HOOKE = Hooke(16.0)
BASAFA = Basafa(9.0, 1800.0, 0.2)
TOE_AND_HEEL = piecewise([-0.3, -0.1, 0.0, 0.1, 0.25], [-9.0, -1.5, 0.0, 0.8, 6.0])
LAWS = [HOOKE, BASAFA, TOE_AND_HEEL]


@numba.njit(error_model="numpy")
def compiled(law, strain):
    return tension(law, strain), stiffness(law, strain)


@pytest.mark.parametrize("law", LAWS)
def test_compiled_and_plain_laws_agree(law):
    """At points, at corners and beyond; rounding differs only where a product is fused."""
    for strain in np.concatenate([np.linspace(-0.6, 0.6, 49), [-0.1, 0.0, 0.1, 0.2, 0.25]]):
        expected = tension(law, strain), stiffness(law, strain)
        assert compiled(law, strain) == pytest.approx(expected, rel=1e-14, abs=1e-15)


@pytest.mark.parametrize("law", LAWS)
def test_the_stiffness_is_the_slope_of_the_tension(law):
    """Central differences, between corners; the cubic leaves h^2 k2, 2e-9 of k1."""
    h = 1e-6
    for strain in np.linspace(-0.57, 0.57, 38):
        slope = (tension(law, strain + h) - tension(law, strain - h)) / (2 * h)
        assert stiffness(law, strain) == pytest.approx(slope, rel=1e-7)


@pytest.mark.parametrize("law", LAWS)
def test_the_largest_stiffness_is_reached_and_not_passed(law):
    slopes = [stiffness(law, x) for x in np.linspace(-1, 1, 2001)]
    assert largest_stiffness(law) == pytest.approx(max(slopes), rel=1e-12)
    assert initial_stiffness(law) == stiffness(law, 0.0)


def test_at_a_corner_the_slope_is_that_of_the_larger_strain():
    assert stiffness(TOE_AND_HEEL, 0.0) == pytest.approx(8.0)
    assert stiffness(TOE_AND_HEEL, -1e-9) == pytest.approx(15.0)


def test_two_points_are_hookes_law():
    line = piecewise([-0.1, 0.3], [-1.6, 4.8])
    for strain in np.linspace(-2, 2, 21):
        assert tension(line, strain) == pytest.approx(tension(HOOKE, strain), rel=1e-13, abs=1e-14)
        assert stiffness(line, strain) == pytest.approx(16.0, rel=1e-13)


def sampled(law, count, reach=0.3):
    strains = np.linspace(-reach, reach, count)
    return piecewise(strains, [tension(law, x) for x in strains])


def test_a_finely_sampled_law_approaches_the_law_with_the_square_of_the_spacing():
    """A chord of spacing d is off by T'' d^2 / 8 at most, and T'' by 6 k2 x_c."""
    inside = np.linspace(-0.29, 0.29, 1001)
    errors = []
    for count in (61, 121):
        table = sampled(BASAFA, count)
        errors.append(max(abs(tension(table, x) - tension(BASAFA, x)) for x in inside))
    spacing = 0.6 / 60
    assert errors[0] < 6 * BASAFA.k2 * BASAFA.x_c * spacing**2 / 8
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


def small_lattice():
    size = (0.03, 0.02, 0.02)
    return build(MeshBody(block_mesh(size, 0.01)), np.zeros(3), np.array(size), 0.01)


def swing(law, *, linear=False):
    """A small free lattice let go from a stretch of a quarter, after 200 steps."""
    lattice = small_lattice()
    count = len(lattice.nodes)
    empty, still = csr_array((count, count)), np.zeros((count, 3))
    mass = 1060 * node_volumes(lattice)
    net = network(connect(lattice), mass, empty, still, none(0.01), UNDAMPED, linear=linear)
    u = lattice.nodes * np.array([0.25, -0.05, 0.0])
    v = np.zeros_like(u)
    symplectic_euler(law, net, np.zeros((200, 1)), 2e-4, u, v)
    return u


@pytest.mark.parametrize("linear", [False, True])
def test_the_kernel_moves_a_sampled_law_as_the_law(linear):
    """301 points leave 3e-4 of the largest displacement, half as many four times that.

    Negative control: Hooke of the same first slope is off by 0.15 or more.
    """
    exact = swing(BASAFA, linear=linear)
    size = np.abs(exact).max()
    tables = [sampled(BASAFA, count) for count in (151, 301)]
    coarse, fine = (np.abs(swing(law, linear=linear) - exact).max() / size for law in tables)
    assert fine < 4e-4
    assert coarse > 3 * fine
    assert np.abs(swing(Hooke(BASAFA.k1), linear=linear) - exact).max() > 0.1 * size


def test_the_kernel_moves_two_points_as_hookes_law():
    hooke = Hooke(reference_stiffness(4e3, 0.01))
    line = piecewise([0.0, 1.0], [0.0, hooke.k])
    # Summation order is the same, so only the rounding of the slope differs, over 200 steps.
    assert swing(line) == pytest.approx(swing(hooke), abs=1e-13)


@pytest.mark.parametrize(
    ("strains", "tensions", "message"),
    [
        ([0.0], [0.0], "two or more"),
        ([0.0, 0.1, 0.2], [0.0, 1.0], r"shapes \(3,\) and \(2,\)"),
        ([0.0, np.nan], [0.0, 1.0], "finite"),
        ([0.0, 0.2, 0.1], [0.0, 1.0, 2.0], "strain .* from 0.2 at point 1 to 0.1 at point 2"),
        ([0.0, 0.1, 0.2], [0.0, 1.0, 0.9], "tension .* from 1 at point 1 to 0.9 at point 2: a spr"),
        ([-0.1, 0.0, 0.1], [-1.0, -1.0, 1.0], "at point 0 to -1 at point 1"),
        ([-0.1, 0.1], [-1.0, 1.5], "0.25 N/m at strain 0: add the point"),
        ([0.1, 0.2], [1.0, 3.0], "-1 N/m at strain 0"),
    ],
)
def test_points_that_make_no_stable_law_are_refused(strains, tensions, message):
    with pytest.raises(ValueError, match=message):
        piecewise(strains, tensions)


def test_a_falling_law_would_have_been_unstable():
    """Negative control: past the check, the softening piece tears the lattice apart."""
    falling = Piecewise(np.array([-0.1, 0.0, 0.1, 0.2]), np.array([-1.6, 0.0, 1.6, -8.0]))
    rising = piecewise([-0.1, 0.0, 0.1, 0.2], [-1.6, 0.0, 1.6, 1.7])
    assert np.abs(swing(rising)).max() < 0.02
    assert not np.abs(swing(falling)).max() < 0.2
