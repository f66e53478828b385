"""Spring laws: tensions, their slopes, laws given by points, plain and compiled."""

import importlib
import os
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from scipy.sparse import csr_array

from msm.calibration import reference_stiffness
from msm.damping import UNDAMPED
from msm.explicit import symplectic_euler
from msm.lattice import build, node_volumes
from msm.laws import (
    LAWS,
    Basafa,
    Hooke,
    Piecewise,
    initial_stiffness,
    largest_stiffness,
    piecewise,
    stiffness,
    stiffness_at_rest,
    tension,
)
from msm.network import network
from msm.springs import connect
from msm.volume import none
from study.models.tissue import spring_law
from study.organ.block import block_mesh
from study.organ.occupancy import MeshBody
from study.run.assumptions import assumptions
from study.scene.file import SceneError, read_scene, write_scene

HOOKE = Hooke(16.0)
BASAFA = Basafa(9.0, 1800.0, 0.2)
TOE_AND_HEEL = piecewise([-0.3, -0.1, 0.0, 0.1, 0.25], [-9.0, -1.5, 0.0, 0.8, 6.0])
EACH = [HOOKE, BASAFA, TOE_AND_HEEL]


@numba.njit(error_model="numpy")
def compiled(law, strain):
    return tension(law, strain), stiffness(law, strain)


@pytest.mark.parametrize("law", EACH)
def test_compiled_and_plain_laws_agree(law):
    """At points, at corners and beyond; rounding differs only where a product is fused."""
    for strain in np.concatenate([np.linspace(-0.6, 0.6, 49), [-0.1, 0.0, 0.1, 0.2, 0.25]]):
        expected = tension(law, strain), stiffness(law, strain)
        assert compiled(law, strain) == pytest.approx(expected, rel=1e-14, abs=1e-15)


@pytest.mark.parametrize("law", EACH)
def test_the_stiffness_is_the_slope_of_the_tension(law):
    """Central differences, between corners; the cubic leaves h^2 k2, 2e-9 of k1."""
    h = 1e-6
    for strain in np.linspace(-0.57, 0.57, 38):
        slope = (tension(law, strain + h) - tension(law, strain - h)) / (2 * h)
        assert stiffness(law, strain) == pytest.approx(slope, rel=1e-7)


@pytest.mark.parametrize("law", EACH)
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


def small_network(*, linear=False):
    """A small free lattice."""
    lattice = small_lattice()
    count = len(lattice.nodes)
    empty, still = csr_array((count, count)), np.zeros((count, 3))
    mass = 1060 * node_volumes(lattice)
    return network(connect(lattice), mass, empty, still, none(0.01), UNDAMPED, linear=linear)


def small_lattice():
    size = (0.03, 0.02, 0.02)
    return build(MeshBody(block_mesh(size, 0.01)), np.zeros(3), np.array(size), 0.01)


def swing(law, *, linear=False):
    """The lattice let go from a stretch of a quarter, after 200 steps."""
    net = small_network(linear=linear)
    u = small_lattice().nodes * np.array([0.25, -0.05, 0.0])
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


# A law from elsewhere

TOY = """
import math
from typing import NamedTuple
from msm.laws import LAWS, ForceLaw

class Toy(NamedTuple):
    k: float
    a: float

def tension(toy: Toy, x: float) -> float:  # the names are its own
    return toy.k * math.sinh(toy.a * x) / toy.a

def stiffness(law, strain):
    return law.k * math.cosh(law.a * strain)

def make(k, a: float, scale: float = 1.0):
    if not a > 0.0:
        raise ValueError(f"a = {a:g} is no stiffening; give one above 0")
    return Toy(scale * k, a)

LAWS["toy"] = ForceLaw(Toy, tension, stiffness, lambda law: math.inf, make)
"""


@pytest.fixture
def toy(tmp_path, monkeypatch):
    """A law in a file that no part of the program knows of, added to the table at run time."""
    (tmp_path / "toy_law.py").write_text(TOY)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr("msm.laws.LAWS", dict(LAWS))
    yield importlib.import_module("toy_law")
    del sys.modules["toy_law"]


def test_a_law_of_no_record_is_refused_with_the_remedy():
    class Unknown(Hooke):
        pass

    with pytest.raises(ValueError, match=r"Unknown is the type of no spring law; add .*LAWS"):
        tension(Unknown(1.0), 0.1)


def test_a_law_from_a_file_of_its_own_moves_the_lattice(toy):
    """Its cubic part a^2/6 is that of the benchmark's law as long as strains are small."""
    law = toy.make(16.0, 2.0)
    for strain in np.linspace(-0.6, 0.6, 9):
        expected = 8.0 * np.sinh(2.0 * strain), 16.0 * np.cosh(2.0 * strain)
        assert (tension(law, strain), stiffness(law, strain)) == pytest.approx(expected)
        assert compiled(law, strain) == pytest.approx(expected)
    assert stiffness_at_rest(law) == pytest.approx((16.0, 16.0))
    assert largest_stiffness(law) == np.inf
    moved = swing(law)
    near = np.abs(moved - swing(Basafa(16.0, 16.0 * 4.0 / 6.0, 1.0))).max()
    assert near < 0.02 * np.abs(moved).max()
    assert np.abs(moved - swing(HOOKE)).max() > 3 * near  # negative control


def test_a_scene_chooses_a_law_from_a_file_of_its_own(toy, tmp_path):
    overrides = ("lattice.law={kind='toy', a=2}", "lattice.volume_term=true")
    scene = read_scene("block", overrides)
    assert spring_law(scene, 3.0) == toy.Toy(3.0, 2.0)
    (tmp_path / "scene.toml").write_text(write_scene(scene), encoding="utf-8")
    assert read_scene(str(tmp_path / "scene.toml")) == scene
    told = " ".join(assumptions(scene, None))
    assert "springs follow the law toy of the scene with a = 2, from the stiffness" in told


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("{kind='toi', a=2}", r"lattice\.law\.kind: should be .*'toy'"),
        ("{kind='toy'}", r"lattice\.law\.a: missing, the law toy takes a and scale"),
        ("{kind='toy', a=2, scal=2}", r"lattice\.law\.scal: unknown key, .*did you mean 'scale'"),
        ("{kind='toy', a=2, b=2}", r"lattice\.law\.b: unknown key, the law toy takes a and scale"),
        ("{kind='toy', a='2'}", r"lattice\.law\.a: should be one number \(got '2'\)"),
        ("{kind='toy', a=[2]}", r"lattice\.law\.a: should be one number"),
        ("{kind='toy', a=nan}", r"lattice\.law\.a: must be finite"),
        ("{kind='toy', a=-2}", r"lattice\.law: a = -2 is no stiffening"),
        ("{kind='toy', a=2, scale=2}", r"lattice\.law: with lattice\.volume_term"),
        ("{kind='toy', a=2}", r"lattice\.law: xpbd takes linear springs only"),
    ],
)
@pytest.mark.usefixtures("toy")
def test_errors_in_a_law_of_any_kind_are_named(table, message):
    xpbd = ("lattice.integrator=xpbd", 'models=["fem", "msm"]') if "xpbd" in message else ()
    with pytest.raises(SceneError, match=message):
        read_scene("block", (f"lattice.law={table}", "lattice.volume_term=true", *xpbd))


PULL = """
import sys
import numpy as np
from msm import kernel
from msm.laws import LAWS, Hooke
from msm.forces import add_spring_forces
from tests.test_laws import small_network
{0}
net = small_network()
force = np.zeros_like(net.load)
add_spring_forces({1}, net, net.load, force)
print(add_spring_forces.stats.cache_hits)
"""
FOREIGN = ("import toy_law", "toy_law.Toy(16.0, 2.0)")


def pull(folder, *, law=("", "Hooke(16.0)"), found=True):
    """What a process says that computes the forces of a law, with kernels kept in a folder."""
    root = str(Path(__file__).parents[1])
    paths = os.pathsep.join([root, str(folder)] if found else [root])
    return subprocess.run(
        [sys.executable, "-c", PULL.format(*law)],
        capture_output=True,
        check=False,
        text=True,
        env=os.environ | {"PYTHONPATH": paths, "NUMBA_CACHE_DIR": str(folder / "kept")},
    )


def test_a_law_from_elsewhere_leaves_the_kernels_on_disk_to_other_processes(tmp_path):
    """Its class in their index would stop each process that cannot import it."""
    (tmp_path / "toy_law.py").write_text(TOY)
    for law in (FOREIGN, FOREIGN):
        assert pull(tmp_path, law=law).stdout == "Counter()\n"  # compiled each time
    assert pull(tmp_path, found=False).stdout == "Counter()\n"
    assert "1" in pull(tmp_path, found=False).stdout  # kept, and found again
    # Negative control: kept as numba would keep it.
    keeping = ("import toy_law; kernel._is_ours = lambda _: True", FOREIGN[1])
    assert pull(tmp_path, law=keeping).returncode == 0
    assert "No module named 'toy_law'" in pull(tmp_path, found=False).stderr
