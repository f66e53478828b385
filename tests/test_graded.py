"""A lattice of cells of several sizes: its cells, what hangs, its rest, its motion, its step."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh

from msm import octree
from msm.assembly import Material, arrays, assemble, assemble_graded
from msm.calibration import reference_stiffness
from msm.damping import UNDAMPED, NodalDamping
from msm.forces import internal_forces
from msm.graded import build
from msm.grid import grids_of
from msm.hanging import interpolate
from msm.integrators import INTEGRATORS
from msm.laws import Basafa, Hooke
from msm.octree import Grading
from msm.relaxation import relax
from msm.springs import Springs, connect
from msm.stability import critical_time_step, largest_frequency
from msm.statics import static_displacement, stiffness_at_rest
from msm.ties import hanging_nodes
from msm.unloading import from_shape
from msm.volume import volume_term
from study.organ.occupancy import ImplicitBody
from study.scene.file import read_scene
from study.scene.problem import problem_of

E, NU, DENSITY = 9.5e3, 0.45, 1000.0
BLOCK = ('organ.size=["60 mm", "40 mm", "30 mm"]', "tool.radius=10 mm", "support.depth=10 mm")
FINE = 2.5e-3


@pytest.fixture(scope="module")
def problem():
    return problem_of(read_scene("block", BLOCK))


def on(problem, grading, flexion=0.2):
    parts = problem.geometry.body, problem.surface_rule, DENSITY
    return assemble_graded(*parts, grading, problem.foundation, problem.tool, flexion)


@pytest.fixture(scope="module")
def assembly(problem):
    """Cells of three sizes."""
    return on(problem, Grading(FINE, problem.tool.centre[None], (0.004, 0.014)))


def material(assembly, law=None):
    k = reference_stiffness(E, assembly.lattice.spacing, NU)
    return Material(law or Hooke(k), volume_term(assembly.lattice, E, NU), UNDAMPED)


def inner(lattice):
    """Which nodes lie inside the body's box."""
    low, high = lattice.nodes.min(axis=0), lattice.nodes.max(axis=0)
    return ((lattice.nodes > low + 1e-9) & (lattice.nodes < high - 1e-9)).all(axis=1)


def free(net):
    """A network without its support."""
    return net._replace(value=np.zeros_like(net.value))


def force(material, net, u):
    found = np.empty_like(u)
    internal_forces(material.law, net, u, found)
    return found


def uniform(lattice, gradient):
    return lattice.nodes @ gradient.T


# --- cells ----------------------------------------------------------------------------------------


def neighbouring_levels(lattice):
    """Largest difference of level of two cells that touch, at a corner too."""
    box = np.rint(np.ptp(lattice.nodes, axis=0) / lattice.spacing).astype(int)
    level = np.full(box + 2, -1)
    for n, one in enumerate(lattice.levels):
        for cell in one.index * 2**n + 1:
            level[tuple(slice(start, start + 2**n) for start in cell)] = n
    worst = 0
    for shift in np.ndindex(3, 3, 3):
        moved = np.roll(level, np.array(shift) - 1, axis=(0, 1, 2))
        both = (moved >= 0) & (level >= 0)
        worst = max(worst, int(np.abs(moved - level)[both].max()))
    return worst


def test_cells_that_touch_differ_by_one_size(problem, assembly, monkeypatch):
    assert len([one for one in assembly.lattice.levels if len(one.cells)]) == 3
    assert neighbouring_levels(assembly.lattice) == 1
    near = Grading(FINE, problem.tool.centre[None], (0.004, 0.004, 0.004))
    assert neighbouring_levels(on(problem, near).lattice) == 1

    def alone(split):
        return [split[0], *(split[k] | octree._coarsened(split[k - 1]) for k in (1, 2))]

    monkeypatch.setattr(octree, "_balanced", alone)
    assert neighbouring_levels(on(problem, near).lattice) > 1


def test_cells_fill_the_body(problem, assembly):
    lattice = assembly.lattice
    assert (lattice.fill * lattice.edges**3).sum() == pytest.approx(problem.geometry.volume)
    assert assembly.mass.sum() == pytest.approx(DENSITY * problem.geometry.volume)
    assert lattice.dropped == pytest.approx(0.0, abs=1e-12)
    assert not assembly.mass[hanging_nodes(lattice.masters)].any()


def test_one_size_is_the_plain_lattice(problem):
    found = on(problem, Grading(0.005, problem.tool.centre[None], ()))
    parts = problem.geometry.body, problem.surface_rule, DENSITY
    plain = assemble(*parts, 0.005, problem.foundation, problem.tool, 0.2)
    assert found.masters is None
    np.testing.assert_array_equal(found.lattice.nodes, plain.lattice.nodes)
    np.testing.assert_array_equal(found.springs.ends, plain.springs.ends)
    for a, b in ((found.springs.weight, plain.springs.weight), (found.mass, plain.mass)):
        np.testing.assert_allclose(a, b, rtol=1e-12)
    np.testing.assert_allclose(found.load, plain.load, rtol=1e-12, atol=1e-18)
    u = 1e-3 * np.random.default_rng(0).standard_normal(plain.load.shape)
    forces = [force(material(one), arrays(one, material(one)), u) for one in (found, plain)]
    np.testing.assert_allclose(forces[0], forces[1], rtol=1e-12, atol=1e-15)


def test_too_many_cells_are_refused(problem):
    with pytest.raises(ValueError, match=r"region\.spacing: 0\.1 mm.*enlarge it"):
        on(problem, Grading(1e-4, problem.tool.centre[None], (0.01,)))


def ball(centre, radius):
    """Inside where negative."""
    return lambda points: np.linalg.norm(points - centre, axis=-1) - radius


def test_cells_move_with_the_body():
    found, aside = [], np.array([-0.07, 0.013, 0.31])
    for centre in (np.zeros(3), aside):
        place = centre + np.array([0.0, 0.0, 0.02])
        grading = Grading(FINE, place[None], (0.004, 0.012))
        box = centre - 0.0208, centre + np.array([0.0208, 0.0208, 0.0308])
        found.append(build(ImplicitBody(ball(centre, 0.0207)), *box, grading))
    here, there = found
    assert all(len(one.cells) for one in here.levels)
    np.testing.assert_array_equal(there.cells, here.cells)
    np.testing.assert_allclose(there.fill, here.fill, atol=0.01)
    np.testing.assert_allclose(there.nodes, here.nodes + aside, atol=1e-12)
    assert abs(there.masters - here.masters).max() < 1e-12
    corner = here.nodes[here.cells[:, 0]]
    np.testing.assert_allclose(here.origin + here.index * here.edges[:, None], corner, atol=1e-12)


def test_the_piece_of_the_largest_volume_is_kept_and_not_that_of_most_cells():
    far, small, large = np.array([0.0, 0.0, 0.06]), 0.008, 0.014
    both = ImplicitBody(lambda p: np.minimum(ball(0.0, large)(p), ball(far, small)(p)))
    box = np.full(3, -0.016), np.array([0.016, 0.016, 0.072])
    kept = build(both, *box, Grading(FINE / 2, far[None], (0.012, 0.025)))
    assert (kept.nodes[:, 2] < 0.03).all()
    alone = build(
        ImplicitBody(ball(far, small)), *box, Grading(FINE / 2, far[None], (0.012, 0.025))
    )
    assert len(alone.cells) > len(kept.cells)
    share = small**3 / (small**3 + large**3)
    assert kept.dropped == pytest.approx(share, abs=0.02)


# --- hanging nodes --------------------------------------------------------------------------------


def test_hanging_nodes_follow_linear_fields(assembly):
    lattice = assembly.lattice
    assert lattice.hanging > 100
    gradient = np.random.default_rng(1).standard_normal((3, 3))
    u = uniform(lattice, gradient)
    np.testing.assert_allclose(lattice.masters @ u, u, atol=1e-12)
    np.testing.assert_allclose(lattice.masters.sum(axis=1), 1.0, rtol=1e-12)
    points = lattice.nodes.min(axis=0) + np.random.default_rng(2).random((200, 3)) * 0.029
    weights, outside = lattice.interpolation(points)
    assert outside == 0
    np.testing.assert_allclose(weights @ u, points @ gradient.T, atol=1e-12)
    assert abs(weights[:, hanging_nodes(lattice.masters)]).max() == 0.0


def test_interpolation_is_continuous_across_sizes(assembly):
    lattice = assembly.lattice
    u = lattice.masters @ np.random.default_rng(3).standard_normal(lattice.nodes.shape)
    faces = lattice.nodes[inner(lattice)]
    aside = 1e-9 * np.random.default_rng(4).standard_normal(faces.shape)
    both = [lattice.interpolation(faces + sign * aside)[0] @ u for sign in (1.0, -1.0)]
    np.testing.assert_allclose(both[0], both[1], atol=1e-4)
    np.testing.assert_allclose(both[0], u[inner(lattice)], atol=1e-4)


def test_uniform_strain_is_at_rest(assembly):
    """However large, and where sizes meet too."""
    m, lattice = material(assembly), assembly.lattice
    net = free(arrays(assembly, m))
    for size in (1e-3, 0.15):
        u = uniform(lattice, size * np.random.default_rng(5).standard_normal((3, 3)))
        found = force(m, net, u)
        assert np.abs(found[inner(lattice)]).max() < 1e-12 * np.abs(found).max()


def test_without_sharing_out_uniform_strain_is_not_at_rest(assembly):
    m, lattice = material(assembly), assembly.lattice
    net = free(arrays(assembly, m))
    u = uniform(lattice, 1e-3 * np.random.default_rng(5).standard_normal((3, 3)))
    found = force(m, net._replace(hanging=net.hanging[:0]), u)
    assert np.abs(found[inner(lattice)]).max() > 1e-2 * np.abs(found).max()


def test_body_diagonals_push_where_sizes_meet(assembly):
    """Why a graded lattice refuses them: only under shear, at corners of the finer region."""
    lattice = assembly.lattice
    parts = [connect(one, 0.0, 0.5) for one in lattice.levels]
    ends, rest = (np.concatenate([getattr(one, k) for one in parts]) for k in ("ends", "rest"))
    pairs = zip(parts, lattice.levels, strict=True)
    weight = np.concatenate([one.weight * at.spacing / lattice.spacing for one, at in pairs])
    m = material(assembly)
    net = arrays(replace(assembly, springs=Springs(ends, rest, weight)), m)
    stretch, shear = np.diag([1e-3, 0.0, 0.0]), np.zeros((3, 3))
    shear[0, 1] = 1e-3
    for gradient, bound in ((stretch, 1e-12), (shear, None)):
        found = force(m, free(net), uniform(lattice, gradient))
        left = np.abs(found[inner(lattice)]).max() / np.abs(found).max()
        assert left < bound if bound else left > 1e-3


def test_momentum_is_conserved(assembly):
    m, lattice = material(assembly), assembly.lattice
    net = free(arrays(assembly, m))
    u = lattice.masters @ (5e-4 * np.random.default_rng(6).standard_normal(lattice.nodes.shape))
    found = force(m, net, u)
    size = np.abs(found).sum()
    assert np.abs(found.sum(axis=0)).max() < 1e-13 * size
    assert np.abs(np.cross(lattice.nodes + u, found).sum(axis=0)).max() < 1e-13 * size * 0.06
    wrong = force(m, net._replace(part=0.9 * net.part), u)
    assert np.abs(wrong.sum(axis=0)).max() > 1e-4 * size


def test_a_network_from_a_shape_is_free_of_stress_in_it(assembly):
    """Cells of each size have their own edges, by which their volume changes."""
    m, lattice = material(assembly), assembly.lattice
    net = free(arrays(assembly, m))
    u = lattice.masters @ (5e-4 * np.random.default_rng(8).standard_normal(lattice.nodes.shape))
    stressed = np.abs(force(m, net, u)).max()
    assert np.abs(force(m, from_shape(net, u), u)).max() < 1e-9 * stressed


def test_stiffness_is_the_slope_of_the_forces(assembly):
    m, count = material(assembly), len(assembly.mass)
    net, matrix = arrays(assembly, m), stiffness_at_rest(assembly, m)
    small = np.random.default_rng(7).standard_normal((count, 3))
    small[hanging_nodes(assembly.masters)] = 0.0
    step = 1e-9
    moved = [force(m, net, assembly.masters @ (sign * step * small)) for sign in (1.0, -1.0)]
    slope = (moved[1] - moved[0]) / (2.0 * step)
    np.testing.assert_allclose(
        matrix @ small.ravel(), slope.ravel(), atol=2e-6 * np.abs(slope).max()
    )


@pytest.mark.parametrize("law", [Hooke, Basafa])
def test_a_stretch_stores_the_same_as_in_one_size(problem, assembly, law):
    """Each level has the modulus of a lattice of its size, whatever the law."""
    plain = on(problem, Grading(FINE, problem.tool.centre[None], ()))
    gradient = np.diag([0.25, -0.1, 0.05])
    work = []
    for one in (assembly, plain):
        k = reference_stiffness(E, one.lattice.spacing, NU)
        m = material(one, Hooke(k) if law is Hooke else Basafa(k, 5.0 * k, 0.2))
        u = uniform(one.lattice, gradient)
        work.append((force(m, free(arrays(one, m)), u) * u).sum())
    assert work[0] == pytest.approx(work[1], rel=1e-10)


# --- as grids -------------------------------------------------------------------------------------


def loaded(assembly, m, name, change=lambda grids: grids):
    """Motion (u, v) after some steps under the load, over the list of springs and over grids."""
    net, method = arrays(assembly, m), INTEGRATORS[name]
    dt = 0.5 * critical_time_step(assembly, m)
    start = assembly.masters @ np.random.default_rng(9).standard_normal(net.load.shape)
    found = []
    for advance, over in (
        (method.advance, net),
        (method.on_grid, change(grids_of(assembly.lattice, net))),
    ):
        u, v = 1e-5 * start, 1e-3 * start
        advance(m.law, over, np.ones((60, len(method.at))), dt, u, v)
        found.append((u, v))
    return found


def off_by(pair):
    return max(np.abs(a - b).max() / np.abs(a).max() for a, b in zip(*pair, strict=True))


@pytest.mark.parametrize("name", ["symplectic-euler", "velocity-verlet", "runge-kutta-4"])
def test_grids_move_as_the_list_of_springs_does(assembly, name):
    assert off_by(loaded(assembly, material(assembly), name)) < 1e-12


def test_grids_are_damped_as_the_list_of_springs_is(assembly):
    m = replace(material(assembly), damping=NodalDamping(20.0, beta=1e-4))
    assert off_by(loaded(assembly, m, "symplectic-euler")) < 1e-12


def nudged(field, change):
    """A wrong entry among what joins the grids, of the support the largest."""

    def planted(grids):
        values = getattr(grids.joints, field).copy()
        of_support = field in {"column", "value"}
        values[np.argmax(grids.joints.value) if of_support else len(values) // 2] += change
        return grids._replace(joints=grids.joints._replace(**{field: values}))

    return planted


@pytest.mark.parametrize(
    ("field", "change"), [("copy", 1), ("master", 1), ("part", 1e-4), ("column", 1), ("value", 1.0)]
)
def test_a_wrong_joint_is_seen(assembly, field, change):
    pair = loaded(assembly, material(assembly), "symplectic-euler", nudged(field, change))
    assert off_by(pair) > 1e-9


def test_every_spring_and_cell_is_in_one_grid(assembly):
    net = arrays(assembly, material(assembly))
    grids = grids_of(assembly.lattice, net).grids
    assert len(grids) == 3
    weights = [one.weight.sum() for one in grids]  # flexion and larger edges may share a place
    assert sum(weights) == pytest.approx((net.scale / net.length).sum(), rel=1e-12)
    assert sum(np.count_nonzero(one.bulk) for one in grids) == len(net.cells)
    # A row has the directions of its own cells alone: edges, face diagonals, flexion.
    assert [len(one.offset) for one in grids] == [12, 12, 12]


# --- rest and motion ------------------------------------------------------------------------------


def test_rest_is_reached_and_hanging_nodes_hang(assembly):
    m = material(assembly)
    net = arrays(assembly, m, linear=True)
    u, how = relax(m.law, net, tolerance=1e-9)
    assert how.status == "at rest"
    known = static_displacement(assembly, m)
    np.testing.assert_allclose(u, known, atol=1e-5 * np.abs(known).max())
    np.testing.assert_allclose(assembly.masters @ known, known, atol=1e-15)


def frequencies(assembly, m):
    """All frequencies [rad/s] of the nodes that do not hang, by dense matrices."""
    chosen = np.repeat(~hanging_nodes(assembly.masters), 3)
    k = stiffness_at_rest(assembly, m)[chosen][:, chosen].toarray()
    return np.sqrt(eigh(k, np.diag(np.repeat(assembly.mass, 3)[chosen]), eigvals_only=True))


def test_the_critical_step_is_that_of_all_frequencies(assembly):
    m = material(assembly)
    highest = frequencies(assembly, m).max()
    assert critical_time_step(assembly, m) == pytest.approx(2.0 / highest, rel=2e-3)
    net = arrays(assembly, m)
    omega, _ = largest_frequency(m.law, net, np.zeros_like(net.load))
    assert omega == pytest.approx(highest, rel=2e-3)


@pytest.mark.parametrize("name", ["symplectic-euler", "velocity-verlet", "runge-kutta-4"])
def test_a_step_below_the_limit_is_stable_and_one_above_is_not(assembly, name):
    m = material(assembly)
    net, method = arrays(assembly, m, linear=True), INTEGRATORS[name]
    limit = critical_time_step(assembly, m, name)
    sizes = []
    for share in (0.97, 1.05):
        u, v = (
            np.zeros_like(net.load),
            1e-3 * np.random.default_rng(8).standard_normal(net.load.shape),
        )
        interpolate(net, v)
        factors = np.zeros((3000, len(method.at)))
        method.advance(m.law, net, factors, share * limit, u, v)
        sizes.append(np.abs(u).max())
        np.testing.assert_allclose(assembly.masters @ u, u, rtol=1e-9, atol=1e-9 * sizes[-1])
    assert sizes[0] < 1e-3
    assert not sizes[1] < 1e3 * sizes[0]


def test_energy_is_conserved(assembly):
    """Of a free nonlinear body without damping or load, to the second order of the step."""
    m = material(assembly)
    net, method = free(arrays(assembly, m)), INTEGRATORS["velocity-verlet"]
    limit, mass = critical_time_step(assembly, m), assembly.mass[:, None]
    x = assembly.lattice.nodes
    drifts = []
    for share in (0.4, 0.2):
        u = np.zeros_like(net.load)
        v = 0.05 * np.stack(
            [np.sin(80.0 * x[:, 1]), np.cos(60.0 * x[:, 2]), x[:, 0] * 10.0], axis=1
        )
        interpolate(net, v)
        start, energies = (mass * v**2).sum() / 2.0, []
        momentum = (mass * v).sum(axis=0)
        for _ in range(40):
            method.advance(m.law, net, np.zeros((int(4 / share), 2)), share * limit, u, v)
            energies.append((mass * v**2).sum() / 2.0 + stored(m, net, u))
        np.testing.assert_allclose((mass * v).sum(axis=0), momentum, rtol=1e-10, atol=1e-12)
        drifts.append(np.abs(np.array(energies) / start - 1.0).max())
    assert drifts[1] < 0.35 * drifts[0] < 0.02


def stored(m, net, u):
    """Energy [J] of springs and cells."""
    i, j = net.ends.T
    lengths = np.linalg.norm(net.rest + u[j] - u[i], axis=1)
    springs = 0.5 * m.law.k * (net.scale / net.length * (lengths - net.length) ** 2).sum()
    corner = u[net.cells]
    slopes = (2.0 * np.array(list(np.ndindex(2, 2, 2))) - 1.0) / 4.0
    f = np.eye(3) + np.einsum("cad,ae->cde", corner, slopes) / net.edges[:, None, None]
    return springs + 0.5 * (net.bulk * (np.linalg.det(f) - 1.0) ** 2).sum()


def test_it_comes_close_to_the_finest_cells_throughout(problem):
    """The tool's rest; coarse cells throughout are off by several times as much."""
    probe = problem.tool.centre[None]
    finest = on(problem, Grading(FINE, probe, ()))
    near = on(problem, Grading(FINE, probe, (0.012, 0.024)))
    coarse = on(problem, Grading(4.0 * FINE, probe, ()))
    rests = [
        (one.lattice.interpolation(probe)[0] @ static_displacement(one, material(one)))[0]
        for one in (finest, near, coarse)
    ]
    size = np.linalg.norm(rests[0])
    apart = [np.linalg.norm(one - rests[0]) / size for one in rests[1:]]
    assert apart[0] < 0.03
    assert apart[1] > 4.0 * apart[0]
    assert len(near.mass) < 0.5 * len(finest.mass)
