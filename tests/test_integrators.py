"""Implicit, split and position-based integrators and relaxation: order, stability, energy, rest."""

import numpy as np
import pytest
from numba.core.runtime import _nrt_python, rtsys
from numpy.linalg import eigvals, eigvalsh, norm
from scipy.sparse import csr_array, eye_array, kron

from msm import springs as lattice_springs
from msm import volume as volumes
from msm.calibration import reference_stiffness
from msm.damping import UNDAMPED, NodalDamping
from msm.forces import internal_forces
from msm.grid import grids_of
from msm.integrators import INTEGRATORS, UNBOUNDED, Integrator
from msm.kernel import kernel
from msm.lattice import build, interpolation, node_volumes
from msm.laws import Basafa, Hooke
from msm.model import Material, critical_time_step, run
from msm.network import network
from msm.relaxation import relax
from msm.tangent import add_diagonal, add_product, empty_tangent, linearise, make_definite
from study.models.lattice_assembly import assembled
from study.organ.block import block_mesh
from study.organ.occupancy import MeshBody
from study.scene.file import SceneError, read_scene
from study.scene.problem import problem_of
from tests.conftest import SMALL

E, H, DENSITY = 4e3, 0.01, 1060.0
IMPLICIT = ["implicit-euler", "implicit-midpoint"]
NEW = [*IMPLICIT, "split-volume", "xpbd"]


class Held:
    """A block on a support that couples its nodes, as a cut lattice has it, pushed on top."""

    def __init__(self, counts=(2, 2, 2), nu=0.45, load=0.02, support=2e5, damping=UNDAMPED):
        size = H * np.array(counts)
        self.lattice = build(MeshBody(block_mesh(tuple(size), H)), np.zeros(3), size, H)
        self.springs = lattice_springs.connect(self.lattice)
        self.mass = DENSITY * node_volumes(self.lattice)
        self.volume = volumes.volume_term(self.lattice, E, nu)
        self.law = Hooke(reference_stiffness(E, H, nu))
        self.damping = damping
        middles = (np.argwhere(np.ones((4 * counts[0], 4 * counts[1]))) + 0.5) * H / 4
        weights, _ = interpolation(self.lattice, np.column_stack([middles, 0 * middles[:, 0]]))
        self.support = csr_array(weights.T @ weights * (support * (H / 4) ** 2))
        self.load = np.zeros_like(self.lattice.nodes)
        top = self.lattice.nodes[:, 2] > size[2] - 1e-9
        self.load[top] = np.array([0.3, 0.1, -1.0]) * load / top.sum()

    def arrays(self, linear=False, volume=True):
        term = self.volume if volume else volumes.none(H)
        return network(
            self.springs,
            self.mass,
            self.support,
            self.load,
            term,
            self.damping,
            linear=linear,
        )

    def stiffness(self, volume=True):
        """Assembled at rest, [N/m], dense."""
        count = len(self.mass)
        springs = lattice_springs.stiffness_matrix(self.springs, count, self.law.k)
        whole = springs + kron(self.support, eye_array(3))
        if volume:
            whole = whole + volumes.stiffness_matrix(self.volume, count)
        return np.asarray(whole.todense())

    def critical_step(self, volume=True):
        """2 / omega_max of the lattice at rest [s]."""
        root = np.repeat(np.sqrt(self.mass), 3)
        return 2.0 / np.sqrt(eigvalsh(self.stiffness(volume) / np.outer(root, root))[-1])

    def still(self):
        return np.zeros((2, *self.load.shape))


def march(name, law, net, dt, steps, u, v, history=np.ones_like):
    """Steps in place under the load times history(t)."""
    method = INTEGRATORS[name]
    starts = dt * np.arange(steps)
    factors = np.stack([history(starts + at * dt) for at in method.at], axis=1)
    method.advance(law, net, factors, dt, u, v)


def push_and_let_go(t):
    return np.sin(20.0 * t) ** 2


# Order ---------------------------------------------------------------------------------------


def ends(name, body, net, duration, counts):
    found = []
    for steps in counts:
        u, v = body.still()
        march(name, body.law, net, duration / steps, steps, u, v, push_and_let_go)
        found.append(u)
    return found


@pytest.mark.parametrize("linear", [True, False])
@pytest.mark.parametrize("name", NEW)
def test_on_a_lattice_the_integrator_has_the_order_it_declares(name, linear):
    """Against Runge-Kutta with errors a thousand times smaller; damping grows with displacement."""
    body = Held(nu=0.45, load=0.05, damping=NodalDamping(5.0, 200.0))
    net = body.arrays(linear)
    duration = 40 * body.critical_step()
    (exact,) = ends("runge-kutta-4", body, net, duration, [2000])
    assert norm(exact, axis=1).max() > 0.02 * H  # what moves is worth following
    errors = [norm(u - exact) for u in ends(name, body, net, duration, (320, 640, 1280))]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx(INTEGRATORS[name].order, abs=0.2)


def test_split_volume_approaches_symplectic_euler_near_incompressibility():
    """At nu = 0.499 both have order one and differ by less the shorter the step."""
    body = Held(nu=0.499, damping=NodalDamping(5.0))
    net = body.arrays()
    duration = 40 * body.critical_step()
    counts = (100, 200, 400)
    pairs = [ends(n, body, net, duration, counts) for n in ("split-volume", "symplectic-euler")]
    apart = [norm(a - b) / norm(b) for a, b in zip(*pairs, strict=True)]
    assert apart[1] < 0.6 * apart[0]
    assert apart[2] < 0.6 * apart[1]


def test_split_volume_without_a_volume_term_is_symplectic_euler():
    body = Held(nu=0.25)
    net = body.arrays()
    dt = 0.5 * body.critical_step()
    (a, b), (c, d) = body.still(), body.still()
    march("split-volume", body.law, net, dt, 100, a, b)
    march("symplectic-euler", body.law, net, dt, 100, c, d)
    # Only the order of the divisions differs.
    assert a == pytest.approx(c, abs=1e-12 * norm(c))
    assert b == pytest.approx(d, abs=1e-12 * norm(d))


# Stability -----------------------------------------------------------------------------------


def growth(name, body, dt):
    """Largest factor by which a step of the undamped linear lattice multiplies a motion."""
    net, size = body.arrays(linear=True), body.load.size
    step = np.empty((2 * size, 2 * size))
    for k in range(2 * size):
        state = np.zeros(2 * size)
        state[k] = 1.0
        u, v = state.reshape(2, -1, 3)
        v /= dt  # so that position and velocity weigh alike
        march(name, body.law, net, dt, 1, u, v, np.zeros_like)
        step[:, k] = np.concatenate([u.ravel(), dt * v.ravel()])
    return np.abs(eigvals(step)).max()


# How far a growth may exceed 1: what the implicit solvers leave, 1e-9, and the eigenvalue solver.
SLACK = 1e-8


@pytest.mark.parametrize("nu", [0.25, 0.499])
@pytest.mark.parametrize("name", [*IMPLICIT, "xpbd"])
def test_no_step_is_too_long_for_it(name, nu):
    body = Held(nu=nu)
    for times in (1.5, 50.0):
        assert growth(name, body, times * body.critical_step()) < 1.0 + SLACK


def test_an_explicit_step_a_little_too_long_is_seen():
    """Negative control of the test above."""
    body = Held(nu=0.499)
    assert growth("symplectic-euler", body, 0.98 * body.critical_step()) < 1.0 + SLACK
    assert growth("symplectic-euler", body, 1.02 * body.critical_step()) > 1.1


def test_the_volume_term_does_not_bound_the_step_of_split_volume():
    body = Held(nu=0.499)
    explicit, split = body.critical_step(), body.critical_step(volume=False)
    assert split > 8.0 * explicit
    assert growth("split-volume", body, 0.98 * split) < 1.0 + SLACK
    assert growth("symplectic-euler", body, 0.98 * split) > 10.0


def test_the_springs_do_bound_the_step_of_split_volume():
    body = Held(nu=0.25)
    assert growth("split-volume", body, 1.02 * body.critical_step(volume=False)) > 1.1


@pytest.mark.parametrize(
    ("name", "times"), [("implicit-euler", 50.0), ("xpbd", 5.0), ("split-volume", 0.9)]
)
def test_at_large_displacements_long_steps_stay_finite(name, times):
    """Bent over by more than a third of a cell; split-volume at the step of springs alone."""
    body = Held((3, 3, 3), nu=0.499, load=0.1, damping=NodalDamping(5.0))
    u, v = body.still()
    dt = times * body.critical_step(volume=name != "split-volume")
    march(name, body.law, body.arrays(), dt, 500, u, v)
    assert 0.3 * H < np.abs(u).max() < 3 * H


# Energy and momentum -------------------------------------------------------------------------


def energies(name, steps=200):
    """Energy of the linear undamped lattice before and after, let go with a velocity."""
    body = Held((3, 2, 2))
    k, net = body.stiffness(), body.arrays(linear=True)
    u, v = body.still()
    v[:] = np.outer(body.lattice.nodes[:, 2], [0.3, 0.1, 0.2])

    def energy():
        return 0.5 * u.ravel() @ k @ u.ravel() + 0.5 * (body.mass[:, None] * v**2).sum()

    start = energy()
    march(name, body.law, net, 10 * body.critical_step(), steps, u, v, np.zeros_like)
    return start, energy()


def test_implicit_midpoint_keeps_the_energy_of_a_linear_lattice():
    """At ten times the explicit step; what is left is the tolerance of the solver, 1e-9 a step."""
    start, end = energies("implicit-midpoint")
    assert end == pytest.approx(start, rel=1e-8)


@pytest.mark.parametrize("name", ["implicit-euler", "xpbd"])
def test_the_damped_integrators_lose_energy(name):
    start, end = energies(name)
    assert end < 0.5 * start


@pytest.mark.parametrize("name", NEW)
def test_a_free_body_keeps_its_momentum(name, rng):
    body = Held((2, 2, 2), support=0.0, load=0.0)
    u, v = body.still()
    v[:] = 0.1 * rng.standard_normal(u.shape)
    before = body.mass @ v
    march(name, body.law, body.arrays(), body.critical_step(), 200, u, v)
    assert np.abs(u).max() > 0.05 * H
    # The implicit solvers leave 1e-9 of the momenta per step, at random.
    assert body.mass @ v == pytest.approx(before, abs=1e-7 * 0.1 * body.mass.sum())


# Rest ----------------------------------------------------------------------------------------


def at_rest(body):
    return np.linalg.solve(body.stiffness(), body.load.ravel()).reshape(-1, 3)


@pytest.mark.parametrize("nu", [0.25, 0.45, 0.499])
def test_relaxation_finds_the_static_solution(nu):
    """Its residual is 1e-10 of the load; a soft lattice makes at most a hundredfold of that."""
    body = Held((3, 3, 2), nu=nu)
    found, report = relax(body.law, body.arrays(linear=True), tolerance=1e-10)
    assert report.status == "at rest"
    assert report.residual <= 1e-10
    exact = at_rest(body)
    assert norm(found - exact) < 1e-8 * norm(exact)


def test_relaxation_and_implicit_steps_agree_at_large_displacements():
    body = Held((3, 3, 3), load=0.3)
    net = body.arrays()
    found, report = relax(body.law, net)
    u, v = body.still()
    march("implicit-euler", body.law, net, 10.0, 20, u, v)  # so long that inertia plays no part
    assert report.status == "at rest"
    assert norm(found - u) < 1e-6 * norm(u)
    assert norm(found - at_rest(body)) > 0.02 * norm(u)  # and it is not the linear one


@pytest.mark.parametrize("linear", [True, False])
def test_xpbd_approaches_the_static_solution_with_the_square_of_the_step(linear):
    """Softer than the lattice at rest by some 10 % at the explicit step, and declared so."""
    body = Held((3, 3, 3), load=0.1, damping=NodalDamping(60.0))
    net = body.arrays(linear)
    rest, _ = relax(body.law, net)
    errors = []
    for fraction in (0.5, 0.25, 0.125):
        u, v = rest.copy(), np.zeros_like(rest)
        dt = fraction * body.critical_step()
        march("xpbd", body.law, net, dt, int(2.0 / dt), u, v)
        assert norm(v) < 1e-5 * norm(u)  # in a second it would move by no more than this
        errors.append(norm(u - rest) / norm(rest))
    assert errors[-1] < 0.004
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.2)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.2)


@pytest.mark.parametrize("nu", [0.45, 0.499])
def test_split_volume_comes_to_rest_at_the_static_solution(nu):
    """Its loose solver tolerance does not add up: the bound is a tenth of that tolerance."""
    body = Held((3, 3, 2), nu=nu, damping=NodalDamping(60.0))
    u, v = body.still()
    dt = 0.9 * body.critical_step(volume=False)
    march("split-volume", body.law, body.arrays(linear=True), dt, int(3.0 / dt), u, v)
    exact = at_rest(body)
    assert norm(u - exact) < 1e-4 * norm(exact)


def test_relaxation_says_when_it_is_not_at_rest():
    body = Held()
    _, report = relax(body.law, body.arrays(), most_steps=5)
    assert report.status == "not at rest"
    assert report.steps == 5
    assert report.residual > 1e-8
    lost, report = relax(body.law, body.arrays()._replace(load=np.full_like(body.load, 1e200)))
    assert report.status == "diverged"
    assert np.isnan(lost).all()


@pytest.mark.parametrize(
    ("bad", "key"),
    [
        ({"tolerance": 0.0}, "tolerance"),
        ({"most_steps": 0}, "most_steps"),
        ({"start": np.zeros((2, 3))}, "start"),
    ],
)
def test_relaxation_refuses_what_cannot_end(bad, key):
    body = Held()
    with pytest.raises(ValueError, match=key):
        relax(body.law, body.arrays(), **bad)


# Failure -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NEW)
def test_what_cannot_be_solved_ends_as_not_a_number(name):
    """Two nodes on one point: the spring between them has no direction."""
    body = Held()
    u, v = body.still()
    u[1] = u[0] + body.lattice.nodes[0] - body.lattice.nodes[1]
    march(name, body.law, body.arrays(), body.critical_step(), 3, u, v)
    assert np.isnan(v).any()
    assert np.isnan(u).any()


def test_an_implicit_step_is_solved_or_not_a_number():
    """Under whatever load: it satisfies m v = h (f + load) to the tolerance, or it says so."""
    body = Held((3, 3, 3))
    net = body.arrays()
    h = 20 * body.critical_step()
    unsolved = 0
    for load in 10.0 ** np.arange(-2, 9):
        u, v = body.still()
        march("implicit-euler", body.law, net, h, 1, u, v, lambda t, f=load: 0 * t + f / 0.02)
        force = np.empty_like(u)
        internal_forces(body.law, net, u, force)
        pushed = h * load / 0.02 * body.load
        left = norm(body.mass[:, None] * v - h * force - pushed)
        terms = norm([body.mass[:, None] * v, h * force, pushed])
        unsolved += np.isnan(v).all()
        assert np.isnan(v).all() or left < 2e-9 * terms
    assert 0 < unsolved < 11  # both happen: six of these, from a kilonewton upwards


def test_xpbd_is_offered_linear_springs_only_for_it_reads_a_law_as_one_stiffness():
    body = Held()
    assert [name for name, method in INTEGRATORS.items() if method.linear_only] == ["xpbd"]
    found = []
    for law in (Basafa(9.0, 1800.0, 0.05), Hooke(9.0)):
        u, v = body.still()
        march("xpbd", law, body.arrays(), 1e-3, 20, u, v)
        found.append(u)
    assert np.abs(found[0]).max() > 0.0
    np.testing.assert_array_equal(*found)


# Tangent -------------------------------------------------------------------------------------


@pytest.mark.parametrize("linear", [True, False])
@pytest.mark.parametrize("law", [Hooke(16.0), Basafa(9.0, 1800.0, 0.05)])
def test_the_tangent_is_the_slope_of_the_forces(law, linear, rng):
    body = Held(nu=0.49)
    net = body.arrays(linear)
    u, p = 0.05 * H * rng.standard_normal((2, *body.load.shape))
    tangent, found = empty_tangent(net), np.zeros_like(u)
    linearise(law, net, u, tangent)
    add_product(net, tangent, p, 1.0, found)
    ahead, behind, step = np.empty_like(u), np.empty_like(u), 1e-5
    internal_forces(law, net, u + step * p, ahead)
    internal_forces(law, net, u - step * p, behind)
    slope = (behind - ahead) / (2 * step)
    # Central differences: step squared for a smooth law, step for the kinks of the other.
    assert norm(found - slope) < 1e-5 * norm(slope)
    rest = np.zeros_like(u)
    linearise(law, net, rest, tangent)
    found[:] = 0.0
    add_product(net, tangent, p, 1.0, found)
    if not linear:
        assert norm(found - slope) > 0.01 * norm(slope)  # at another state it is another one


def test_the_definite_tangent_is_positive_and_has_the_diagonal_it_says(rng):
    body = Held(nu=0.49)
    net = body.arrays()
    u = -0.3 * body.lattice.nodes + 0.1 * H * rng.standard_normal(body.load.shape)
    tangent = empty_tangent(net)
    linearise(body.law, net, u, tangent)
    size = u.size

    def matrix():
        columns = np.zeros((size, size))
        for k in range(size):
            p = np.zeros(size)
            p[k] = 1.0
            add_product(net, tangent, p.reshape(-1, 3), 1.0, columns[k].reshape(-1, 3))
        return columns

    exact = matrix()
    assert exact == pytest.approx(exact.T, abs=1e-12 * np.abs(exact).max())
    assert eigvalsh(exact)[0] < 0.0  # pressed to seven tenths, the lattice wants to buckle
    make_definite(tangent)
    definite, diagonal = matrix(), np.zeros_like(u)
    assert eigvalsh(definite)[0] > 0.0
    add_diagonal(net, tangent, 1.0, diagonal)
    assert np.diag(definite) == pytest.approx(diagonal.ravel(), rel=1e-12)


# Memory --------------------------------------------------------------------------------------


@pytest.mark.parametrize("on_grid", [False, True])
@pytest.mark.parametrize("name", INTEGRATORS)
def test_every_array_that_a_kernel_makes_is_freed(name, on_grid):
    """One compiled with `makes_arrays` false would keep those that kernels below it make."""
    body = Held()
    net, method, (u, v) = body.arrays(), INTEGRATORS[name], body.still()
    step, of = method.advance, net
    if on_grid:
        step, of = method.on_grid, grids_of(body.lattice, net)
        if step is None:
            pytest.skip("has no grid")
    factors, dt = np.ones((3, len(method.at))), 0.1 * body.critical_step()
    assert balance(lambda: step(body.law, of, factors, dt, u, v)) == 0
    assert norm(u) > 0.0


def test_an_array_that_is_never_freed_is_seen():
    keep = kernel(makes_arrays=False)(lambda n: made(n).shape[0])
    assert balance(lambda: keep(3)) == 1


@kernel()
def made(n):
    return np.empty(n)


def balance(work):
    """How many more arrays were made than freed."""
    work()  # compiled before they are counted
    _nrt_python.memsys_enable_stats()
    try:
        before = rtsys.get_allocation_stats()
        work()
        after = rtsys.get_allocation_stats()
    finally:
        _nrt_python.memsys_disable_stats()
    return (after.mi_alloc - before.mi_alloc) - (after.mi_free - before.mi_free)


# An integrator from elsewhere ----------------------------------------------------------------


@kernel(nogil=True)
def leapfrog(law, net, factors, dt, u, v):
    """Symplectic Euler once more, without damping."""
    force = np.empty_like(u)
    for n in range(len(factors)):
        internal_forces(law, net, u, force)
        v += dt * (force + factors[n, 0] * net.load) / net.mass.reshape(-1, 1)
        u += dt * v


def test_only_kernels_of_the_package_are_kept_on_disk():
    """Others would outlive a change of what they call."""
    assert leapfrog.stats.cache_path is None
    assert "__pycache__" in INTEGRATORS["symplectic-euler"].advance.stats.cache_path


def test_an_integrator_added_to_the_table_runs_without_further_changes(monkeypatch):
    toy = Integrator(1, (1.0,), leapfrog, 2.0, UNBOUNDED, linear_only=True)
    monkeypatch.setitem(INTEGRATORS, "toy", toy)
    overrides = (*SMALL, "lattice.integrator=toy", 'models=["fem", "msm"]')
    scene = read_scene("block", overrides)
    posed = problem_of(scene)
    assembly = assembled(posed, scene.lattice)
    material = Material(Hooke(38.0))
    limits = [critical_time_step(assembly, material, name) for name in ("toy", "symplectic-euler")]
    assert limits[0] == pytest.approx(limits[1], rel=1e-12)
    ours, theirs = (
        run(assembly, material, posed.factor, posed.observation, integrator=name).trajectory
        for name in ("toy", "symplectic-euler")
    )
    assert ours.status == "finished"
    size = np.abs(theirs.displacement).max()
    np.testing.assert_allclose(ours.displacement, theirs.displacement, atol=1e-9 * size)
    with pytest.raises(ValueError, match="toy takes linear springs only"):
        run(
            assembly,
            Material(Basafa(9.0, 9.0, 0.1)),
            posed.factor,
            posed.observation,
            integrator="toy",
        )
    with pytest.raises(SceneError, match="toy takes linear springs only"):
        read_scene("block", ("lattice.integrator=toy", 'models=["basafa"]'))
    with pytest.raises(SceneError, match=r"damping\.stiffness: toy has only the mass part"):
        read_scene("block", (*overrides, "damping.kind=rayleigh", "damping.stiffness=1 ms"))
