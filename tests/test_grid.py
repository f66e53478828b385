"""Cubic lattices on a regular grid: the same motion as over the list of springs, at every width."""

import numpy as np
import pytest

from msm import stability
from msm import stepper as stepping
from msm.assembly import Material, arrays, assemble
from msm.calibration import reference_stiffness
from msm.damping import NodalDamping
from msm.forces import internal_forces
from msm.grid import grids_of
from msm.grid_explicit import add_forces, follow_all, take_in
from msm.integrators import INTEGRATORS
from msm.kernel import kernel
from msm.laws import Basafa, Hooke, piecewise
from msm.simd import WIDTHS, widest
from msm.stability import critical_time_step
from msm.stepper import LatticeStepper
from msm.timestep import LOOK
from msm.volume import volume_term
from study.scene.file import read_scene
from study.scene.problem import problem_of
from tests.conftest import SMALL

E, NU = 4e3, 0.45
SAME = 1e-12
"""Relative, after STEPS steps: sums in another order, products fused, as each processor does it."""
STEPS = 100
NOTHING = np.zeros(1)
"""Drives no further load."""
DAMPED = NodalDamping(30.0)
FAMILIES = {
    "plain": (0.0, 0.0),
    "flexion": (0.5, 0.0),
    "body diagonals": (0.0, 0.4),
    "both": (1.0, 0.9),
}
OTHERS = sorted({*WIDTHS} - {widest()})
SLOW = pytest.mark.slow
"""Of what would be compiled for one test alone."""
EXPLICIT = [name for name, method in INTEGRATORS.items() if method.on_grid is not None]


@kernel()
def set_forces(law, of, u):
    take_in(of.grids[0], of.place, u, u)
    follow_all(of)
    add_forces(law, of, NOTHING, 0, of.grids[0].u)


def law_of(kind, k):
    return {
        "hooke": Hooke(k),
        "basafa": Basafa(k, 150.0 * k, 0.03),
        "piecewise": piecewise([-0.5, 0.0, 0.02, 0.5], [-0.4 * k, 0.0, 0.02 * k, 0.9 * k]),
    }[kind]


@pytest.fixture(scope="module")
def bodies():
    """Liver and block by name and families, coarse, with their critical steps [s]."""
    made = {}

    def body(name, families="plain"):
        if (name, families) not in made:
            spacing = {"liver": 0.02, "block": 0.025}[name]
            overrides = SMALL if name == "block" else ()
            problem = problem_of(read_scene(name, overrides))
            organ = problem.geometry.body, problem.surface_rule
            made[name, families] = assemble(
                *organ, 1060.0, spacing, problem.foundation, problem.tool, *FAMILIES[families]
            )
        return made[name, families]

    return body


def material(assembly, kind="hooke", damping=DAMPED, volume=True):
    h = assembly.lattice.spacing
    term = volume_term(assembly.lattice, E, NU) if volume else None
    return Material(law_of(kind, reference_stiffness(E, h, NU)), term, damping)


def moved(method, law, net, dt, advance=None, other=None):
    """Motion after STEPS steps from a start in motion, by `advance` over the net or `other`."""
    rng = np.random.default_rng(0)
    u = 0.02 * net.spacing * rng.standard_normal(net.load.shape)
    v = 0.02 * net.spacing / dt * 0.02 * rng.standard_normal(net.load.shape)
    factors = 1.0 + np.sin(np.arange(STEPS))[:, None] * np.ones(len(method.at))
    (advance or method.advance)(law, net if other is None else other, factors, dt, u, v)
    assert np.isfinite(u).all()
    return u, v


def apart(a, b):
    return max(np.linalg.norm(x - y) / np.linalg.norm(y) for x, y in zip(a, b, strict=True))


def compare(assembly, made, width, integrator="symplectic-euler", *, linear=False, change=None):
    """Relative difference of the motion on the grid from that over the list of springs."""
    net = arrays(assembly, made, linear=linear)
    net = net._replace(load=net.load * 20.0)
    method = INTEGRATORS[integrator]
    dt = 0.3 * critical_time_step(assembly, made)
    grids = grids_of(assembly.lattice, net, width)
    assert {len(grid.lanes) for grid in grids.grids} == {width}
    if change is not None:
        change(grids)
    found = moved(method, made.law, net, dt, method.on_grid, grids)
    return apart(found, moved(method, made.law, net, dt))


@pytest.mark.parametrize("families", FAMILIES)
@pytest.mark.parametrize("body", ["liver", "block"])
def test_every_mix_of_families_moves_alike(bodies, body, families):
    assembly = bodies(body, families)
    assert compare(assembly, material(assembly), widest()) < SAME


@pytest.mark.parametrize(
    "width", [1, *(pytest.param(width, marks=SLOW) for width in OTHERS if width > 1)]
)
@pytest.mark.parametrize("body", ["liver", "block"])
def test_other_widths_move_alike(bodies, width, body):
    """Plain numbers always: processors have one of the others, `test_simd` all of them."""
    assembly = bodies(body, "both")
    assert compare(assembly, material(assembly), width) < SAME


@pytest.mark.parametrize(
    ("kind", "linear"),
    [
        ("hooke", False),
        ("hooke", True),
        ("basafa", False),
        ("piecewise", False),
        pytest.param("basafa", True, marks=SLOW),
        pytest.param("piecewise", True, marks=SLOW),
    ],
)
def test_every_law_moves_alike(bodies, kind, linear):
    check_law(bodies, widest(), kind, linear=linear)


@SLOW
@pytest.mark.parametrize("linear", [False, True])
@pytest.mark.parametrize("kind", ["hooke", "basafa", "piecewise"])
@pytest.mark.parametrize("width", OTHERS)
def test_every_law_moves_alike_at_other_widths(bodies, width, kind, linear):
    check_law(bodies, width, kind, linear=linear)


def check_law(bodies, width, kind, *, linear):
    assembly = bodies("liver", "both")
    made = material(assembly, kind, NodalDamping(20.0, 2e3))
    assert compare(assembly, made, width, linear=linear) < SAME


@pytest.mark.parametrize(
    ("kind", "linear"),
    [
        ("hooke", False),
        pytest.param("hooke", True, marks=SLOW),
        pytest.param("basafa", False, marks=SLOW),
        pytest.param("basafa", True, marks=SLOW),
        pytest.param("piecewise", False, marks=SLOW),
    ],
)
def test_rayleigh_damping_moves_alike(bodies, kind, linear):
    assembly = bodies("liver")
    made = material(assembly, kind, NodalDamping(5.0, beta=2e-3))
    assert compare(assembly, made, widest(), linear=linear) < SAME


@pytest.mark.parametrize("damping", [NodalDamping(30.0), NodalDamping(20.0, 2e3)])
@pytest.mark.parametrize("integrator", EXPLICIT)
def test_every_explicit_integrator_moves_alike(bodies, integrator, damping):
    assembly = bodies("liver")
    made = material(assembly, damping=damping)
    assert compare(assembly, made, widest(), integrator) < SAME


def test_springs_alone_move_alike(bodies):
    assembly = bodies("block")
    assert compare(assembly, material(assembly, volume=False), widest()) < SAME


def nudge(field, place, change):
    def planted(grids):
        part = grids if field in grids._fields else grids.grids[0]
        getattr(part, field)[place] += change

    return planted


@pytest.mark.parametrize(
    "planted",
    [
        nudge("offset", 3, 1),
        nudge("rest", (2, 1), 1e-6),
        nudge("weight", (50, 0), 1e-3),
        nudge("corner", 5, 1),
        nudge("corner", 6, 1),
        nudge("bulk", (5, 0), 1e-6),
        nudge("held_offset", 4, 1),
        nudge("load", (7, 0), 1e-4),
        nudge("mass", (3, 0), 1e-5),
        nudge("gamma_0", (3, 0), 1e-5),
        nudge("place", 9, 1),
    ],
    ids=lambda planted: planted.__closure__[1].cell_contents,
)
def test_a_wrong_entry_is_seen(bodies, planted):
    """Negative control."""
    assembly = bodies("liver")
    assert compare(assembly, material(assembly), widest(), change=planted) > 1e3 * SAME


def test_a_spring_pressed_to_a_point_is_not_a_number(bodies):
    """And what is no spring, such as one from the organ to what lies beyond it, is no matter."""
    assembly = bodies("block")
    made = material(assembly)
    net = arrays(assembly, made)
    for width in {1, widest()}:
        grids = grids_of(assembly.lattice, net, width)
        u = np.zeros_like(net.load)
        i, j = net.ends[0].astype(int)
        u[j] = u[i] - net.rest[0]
        set_forces(made.law, grids, u)
        assert np.isnan(grids.grids[0].force[:, grids.place[[i, j]]]).any()


def test_the_kernels_of_a_motion_are_compiled_before_it(bodies, monkeypatch):
    """Each is called once, so that no compilation counts as time of the steps."""
    called = []

    def watched(module, name):
        kernel = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *given: called.append(name) or kernel(*given))

    for module in (stepping, stability):
        for name in ("farthest", "largest_vector_change", "nodal_bounds"):
            if hasattr(module, name):
                watched(module, name)
    assembly = bodies("block")
    stepper = LatticeStepper(assembly, material(assembly), np.ones_like)
    before = set(called)
    called.clear()
    stepper.take_steps(3 * LOOK, 0.1 * stepper.limit_at_rest)
    assert set(called) == before == {"farthest", "largest_vector_change", "nodal_bounds"}


def test_after_a_divergence_the_grid_is_as_new(bodies):
    """What lies beyond the organ comes to rest again too."""
    assembly = bodies("liver")
    made = material(assembly)
    stepper = LatticeStepper(assembly, made, np.ones_like)
    first = stepper_motion(stepper)
    stepper.u[:] = np.nan
    stepper.advance(3, 1e-3)
    assert np.isnan(stepper.u).all()
    stepper.restart()
    assert (stepper_motion(stepper) == first).all()


def stepper_motion(stepper):
    stepper.advance(20, 0.5 * stepper.limit_at_rest)
    return stepper.u.copy()


def test_the_steps_of_a_stretch_are_those_of_its_parts(bodies):
    """To the bit: a run that is continued is cut otherwise."""
    assembly = bodies("liver")
    whole, parts = (LatticeStepper(assembly, material(assembly), np.ones_like) for _ in range(2))
    dt = 0.5 * whole.limit_at_rest
    whole.advance(30, dt)
    for count in (1, 9, 20):
        parts.advance(count, dt)
    assert (whole.u == parts.u).all()
    assert (whole.v == parts.v).all()


def test_steppers_of_cubic_lattices_are_on_a_grid_and_others_are_not(bodies):
    assembly = bodies("block")
    made = material(assembly)
    on = {name: LatticeStepper(assembly, made, np.ones_like, name).grids for name in EXPLICIT}
    assert all(len(grids.grids[0].lanes) == widest() for grids in on.values())
    assert LatticeStepper(assembly, made, np.ones_like, "split-volume").grids is None


def test_the_forces_are_those_of_the_list_of_springs(bodies):
    assembly = bodies("liver", "both")
    made = material(assembly)
    net = arrays(assembly, made)
    u = 0.05 * net.spacing * np.random.default_rng(1).standard_normal(net.load.shape)
    wanted = np.empty_like(u)
    internal_forces(made.law, net, u, wanted)
    grids = grids_of(assembly.lattice, net)
    set_forces(made.law, grids, u)
    (grid,) = grids.grids
    found = grid.force[:, grids.place].T
    assert np.abs(found - wanted).max() < 1e-14 * len(grid.offset) * np.abs(wanted).max()
