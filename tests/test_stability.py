"""The critical step, at rest and deformed, and runs that must not go beyond it unseen."""

import dataclasses
from itertools import pairwise

import numpy as np
import pytest
from scipy.sparse import csr_array, diags_array

from msm import stability
from msm.assembly import Assembly, Material, arrays
from msm.calibration import reference_stiffness
from msm.damping import NodalDamping
from msm.forces import internal_forces
from msm.integrators import INTEGRATORS, UNBOUNDED
from msm.kinematics import inverted_cells
from msm.lattice import build, node_volumes
from msm.laws import Basafa, Hooke, piecewise
from msm.linearised import largest_strain, largest_vector_change
from msm.model import (
    Automatic,
    Counts,
    Fixed,
    LatticeStepper,
    Rate,
    critical_time_step,
    refuse,
    run,
)
from msm.springs import Springs, connect
from msm.stability import (
    CriticalStepTracker,
    cell_bound,
    frequency_bound,
    largest_frequency,
    longest_step,
)
from msm.statics import stiffness_at_rest
from msm.volume import volume_term
from study.organ.block import block_mesh
from study.organ.occupancy import MeshBody
from study.problem.trajectory import Observation

E, H, RHO = 5e3, 0.01, 1054.0
STIFFENING = Basafa(8.0, 1600.0, 0.2)
EXPLICIT = [name for name, method in INTEGRATORS.items() if method.oscillation < UNBOUNDED]


def column(counts, nu=None, gravity=0.0, held=True):
    """A block on its lower face under its own weight, and what it is made of."""
    size = tuple(H * n for n in counts)
    lattice = build(MeshBody(block_mesh(size, H)), np.zeros(3), np.array(size), H)
    mass = RHO * node_volumes(lattice)
    ground = np.where(lattice.nodes[:, 2] < 1e-9, E * H if held else 0.0, 0.0)
    load = np.outer(mass * gravity, [0.0, 0.0, -1.0])
    support = csr_array(diags_array(ground))
    body = Assembly(lattice, connect(lattice, 0.2), mass, support, load)
    law = Hooke(reference_stiffness(E, H, nu or 0.25))
    return body, Material(law, volume_term(lattice, E, nu) if nu else None)


def watch(body, seconds, samples):
    none = np.zeros((0, 3))
    times = np.linspace(0.0, seconds, samples)
    return Observation(times, body.lattice.nodes[[-1]], (samples - 1,), none, none)


def dense_frequency(stiffness, mass):
    root = np.sqrt(np.repeat(mass, 3))
    return np.sqrt(np.linalg.eigvalsh(stiffness / root[:, None] / root).max())


def stiffness_by_differences(law, net, u):
    """Minus the Jacobian of the forces, column by column."""
    jacobian, step = np.zeros((u.size, u.size)), 1e-7
    there, back = np.empty_like(u), np.empty_like(u)
    for i in range(u.size):
        moved = np.zeros(u.size)
        moved[i] = step
        internal_forces(law, net, u + moved.reshape(-1, 3), there)
        internal_forces(law, net, u - moved.reshape(-1, 3), back)
        jacobian[:, i] = -(there - back).ravel() / (2 * step)
    return 0.5 * (jacobian + jacobian.T)


def squashed(nodes, rng):
    """Pressed to 45 % of its height, sheared, and rough."""
    u = -0.55 * nodes * [0.0, 0.0, 1.0] + 0.3 * nodes[:, [2]] * [1.0, 0.0, 0.0]
    return u + 0.05 * H * rng.standard_normal(nodes.shape)


@pytest.mark.parametrize("nu", [None, 0.45, 0.49])
def test_the_critical_step_at_rest_is_that_of_the_whole_matrix(nu):
    body, material = column((4, 3, 3), nu)
    omega = dense_frequency(stiffness_at_rest(body, material).toarray(), body.mass)
    # The residual of 1e-3 of omega^2 leaves at most 5e-4 of omega.
    assert critical_time_step(body, material) == pytest.approx(2 / omega, rel=5e-4)


@pytest.mark.parametrize("law", [Hooke(20.0), STIFFENING])
@pytest.mark.parametrize("nu", [None, 0.45, 0.49])
@pytest.mark.parametrize("linear", [False, True])
def test_the_frequency_of_a_deformed_lattice_is_that_of_its_forces(law, nu, linear, rng):
    body, material = column((3, 3, 3), nu)
    net = arrays(body, material, linear=linear)
    u = squashed(body.lattice.nodes, rng)
    exact = dense_frequency(stiffness_by_differences(law, net, u), body.mass)
    assert largest_frequency(law, net, u)[0] == pytest.approx(exact, rel=5e-4)
    assert frequency_bound(law, net, u) >= exact


@pytest.mark.parametrize("stretch", [0.0, 0.3, -0.3])
def test_one_spring_reaches_the_bound_along_it_or_across(stretch):
    """Beyond the kink the tension has hardly a slope, and the spring is stiffest across."""
    law = piecewise([-0.5, 0.0, 0.1, 0.5], [-5.0, 0.0, 2.0, 2.1])
    body, material = column((1, 1, 1), 0.45, held=False)
    net = arrays(body, material)
    one = net._replace(
        ends=net.ends[:1], rest=net.rest[:1], length=net.length[:1], scale=net.scale[:1]
    )
    one = one._replace(bulk=np.zeros_like(net.bulk))
    u = stretch * body.lattice.nodes
    exact = largest_frequency(law, one, u)[0]
    assert frequency_bound(law, one, u) == pytest.approx(exact, rel=1e-6)


@pytest.mark.parametrize("linear", [False, True])
def test_one_cell_at_rest_reaches_the_bound_as_it_swells(linear):
    body, material = column((1, 1, 1), 0.45, held=False)
    net = arrays(body, material, linear=linear)
    net = net._replace(scale=np.zeros_like(net.scale))
    still = np.zeros_like(body.load)
    exact = largest_frequency(material.law, net, still)[0]
    assert frequency_bound(material.law, net, still) == pytest.approx(exact, rel=1e-6)


def test_the_bound_of_one_cell_is_safe_however_it_is_deformed(rng):
    """Swollen, shrunk and turned inside out; of springs it has none that could make up for it."""
    body, material = column((1, 1, 1), 0.45, held=False)
    net = arrays(body, material)
    net = net._replace(scale=np.zeros_like(net.scale))
    for gradient in (0.3 * np.eye(3), -0.5 * np.eye(3), *rng.standard_normal((10, 3, 3))):
        u = body.lattice.nodes @ gradient
        exact = largest_frequency(material.law, net, u)[0]
        assert frequency_bound(material.law, net, u) > 0.9999 * exact


def test_strains_and_changes_of_springs_are_those_of_the_deformation():
    """Of a stretch by axes, whose edges change most, and of a turn, which strains nothing."""
    body, material = column((2, 2, 2))
    net, nodes = arrays(body, material), body.lattice.nodes
    still = np.zeros_like(nodes)
    u = nodes * [0.1, -0.3, 0.2]
    assert largest_strain(net, u) == pytest.approx(0.3, rel=1e-12)
    assert largest_vector_change(net, u, still) == pytest.approx(0.3, rel=1e-12)
    assert largest_vector_change(net, u + 0.01, nodes * [0.1, 0.1, 0.3]) == pytest.approx(0.4)
    c, s = np.cos(0.7), np.sin(0.7)
    turned = nodes @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) - nodes
    assert largest_strain(net, turned) < 1e-12
    assert largest_vector_change(net, turned, still) == pytest.approx(2.0 * np.sin(0.35))


def test_springs_alone_outgrow_their_frequency_at_rest_but_never_its_bound(rng):
    """Negative control: the limit at rest is not safe, for springs turned into line add up."""
    body, material = column((4, 4, 4), held=False)
    net, nodes = arrays(body, material), body.lattice.nodes
    still = np.zeros_like(nodes)
    at_rest = largest_frequency(material.law, net, still)[0]
    bound = frequency_bound(material.law, net, still)
    found = []
    for size in (0.2, 0.5, 1.0, 1.5):
        gradient = size * rng.standard_normal((3, 3))
        found.append(largest_frequency(material.law, net, nodes @ gradient)[0])
        assert frequency_bound(material.law, net, nodes @ gradient) < bound * (1 + 1e-12)
    assert 1.15 * at_rest < max(found) < bound


def test_pressing_springs_together_makes_them_buckle_and_not_the_step_too_long():
    body, material = column((4, 4, 4), held=False)
    net = arrays(body, material)
    at_rest, _ = largest_frequency(material.law, net, np.zeros_like(body.load))
    pressed, _ = largest_frequency(material.law, net, -0.6 * body.lattice.nodes)
    assert pressed < 0.7 * at_rest


@pytest.mark.parametrize("nu", [0.25, 0.45, 0.49])
def test_the_cell_bound_is_safe_and_not_far_off(nu):
    """Measured 0.81, 0.70 and 0.68 of the critical step."""
    body, material = column((5, 5, 5), nu, held=False)
    share = cell_bound(E, nu, RHO, H) / critical_time_step(body, material)
    assert 0.65 < share < 1.0


def test_without_the_volume_term_a_method_that_solves_for_it_may_step_further():
    body, material = column((3, 3, 3), 0.49)
    springs_alone = dataclasses.replace(material, volume=None)
    explicit = critical_time_step(body, material, "symplectic-euler")
    split = critical_time_step(body, material, "split-volume")
    assert split > 2.5 * explicit
    assert split == pytest.approx(critical_time_step(body, springs_alone), rel=1e-3)


def oscillates(integrator, zeta, dt, steps=4000):
    """Whether one damped mass of omega = 1 stays bounded from a displaced start."""
    nothing = Springs(np.zeros((0, 2), int), np.zeros((0, 3)), np.zeros(0))
    body, material = column((1, 1, 1))
    net = arrays(body, material)._replace(
        ends=nothing.ends.astype(np.int32),
        rest=nothing.rest,
        length=nothing.weight,
        scale=nothing.weight,
        mass=np.ones(1),
        gamma_0=np.full(1, 2 * zeta),
        gamma_1=np.zeros(1),
        row=np.array([0, 1], dtype=np.int32),
        column=np.zeros(1, dtype=np.int32),
        value=np.ones(1),
        load=np.zeros((1, 3)),
    )
    u, v = np.ones((1, 3)), np.zeros((1, 3))
    method = INTEGRATORS[integrator]
    method.advance(Hooke(1.0), net, np.zeros((steps, len(method.at))), dt, u, v)
    return bool(np.abs(u).max() < 1e3)


@pytest.mark.parametrize("zeta", [0.0, 0.1, 0.5, 0.84, 1.0, 3.0, 12.0])
@pytest.mark.parametrize("integrator", ["symplectic-euler", "velocity-verlet", "runge-kutta-4"])
def test_the_longest_step_is_stable_at_any_damping_and_no_longer_without(integrator, zeta):
    limit = longest_step(INTEGRATORS[integrator], 1.0, 2 * zeta)
    assert oscillates(integrator, zeta, 0.999 * limit)
    if zeta == 0.0:
        assert not oscillates(integrator, zeta, 1.01 * limit)


def test_without_their_coupling_the_two_limits_of_runge_kutta_would_not_be_safe():
    """Negative control: at zeta = 0.5 both limits taken alone allow a step beyond its region."""
    method = INTEGRATORS["runge-kutta-4"]
    alone = min(method.oscillation, method.damping / (2 * 0.5))
    assert longest_step(method, 1.0, 2 * 0.5) < alone
    assert not oscillates("runge-kutta-4", 0.5, 0.999 * alone)


@pytest.mark.parametrize("law", [Hooke(20.0), STIFFENING])
@pytest.mark.parametrize("nu", [None, 0.45, 0.49])
@pytest.mark.parametrize("linear", [False, True])
def test_the_followed_limit_stays_within_three_percent_of_the_true_one(law, nu, linear, rng):
    """From rest to a rough squash and back; measured at most 2 % too long."""
    body, material = column((5, 4, 6), nu)
    net = arrays(body, material, linear=linear)
    tracker = CriticalStepTracker(law, net, INTEGRATORS["symplectic-euler"])
    end = squashed(body.lattice.nodes, rng)
    for share in np.sin(np.linspace(0, np.pi, 40)):
        omega, _ = largest_frequency(law, net, share * end)
        found = tracker.limit(share * end)
        assert found < 1.03 * 2 / omega
        assert found > 0.8 * 2 / omega
    assert 1 < tracker.updates < 40


def test_one_crushed_cell_is_found_in_a_lattice_that_is_at_rest_elsewhere():
    body, material = column((8, 8, 8), 0.45)
    net = arrays(body, material)
    tracker = CriticalStepTracker(STIFFENING, net, INTEGRATORS["symplectic-euler"])
    u = np.zeros_like(body.load)
    rest = tracker.limit(u)
    u[body.lattice.cells[100, 7]] = [-0.6 * H, -0.5 * H, -0.7 * H]
    omega, _ = largest_frequency(STIFFENING, net, u)
    assert 2 / omega < 0.85 * rest
    assert tracker.limit(u) == pytest.approx(2 / omega, rel=0.005)


@pytest.fixture(scope="module")
def collapse():
    """A soft column 20 cm tall that sinks by a third under its own weight, and swings on."""
    return column((4, 4, 20), 0.45, gravity=9.81)


def sink(collapse, step, samples=101):
    body, material = collapse
    return run(body, material, np.ones_like, watch(body, 2.0, samples), step)


def test_a_collapse_is_finite_where_the_step_follows_the_limit(collapse):
    found = sink(collapse, Automatic())
    assert found.trajectory.status == "finished"
    assert np.isfinite(found.trajectory.displacement).all()
    assert found.trajectory.displacement[:, 0, 2].min() < -0.06  # of 0.2
    assert found.largest_strain > 0.5
    assert found.smallest_step < found.largest_step < 0.81 * found.critical_time_step
    assert found.margin > 1.0
    assert found.inverted_cells == 0


def test_the_same_collapse_diverges_at_nine_tenths_of_the_limit_at_rest(collapse):
    """Negative control: stable at small strain, and for over a second of this run."""
    body, material = collapse
    critical = critical_time_step(body, material)
    interval = 2.0 / 100
    step = interval / np.ceil(interval / (0.9 * critical))
    assert step < 0.9 * critical
    found = sink(collapse, Fixed(step))
    assert found.trajectory.status == "diverged"
    assert 1.0 < found.trajectory.ended_at < 2.0
    assert (np.abs(body.lattice.nodes - found.trajectory.ended_near).max(axis=1) < 1e-12).any()
    assert found.margin < 1.02
    assert found.smallest_step == found.largest_step == pytest.approx(step)
    lost = np.isnan(found.trajectory.displacement).any(axis=(1, 2))
    assert lost[-1]
    assert (np.diff(lost.astype(int)) >= 0).all()


def test_divergence_is_seen_within_a_sample_of_many_steps(collapse):
    body, material = collapse
    seconds = 2.0
    found = run(body, material, np.ones_like, watch(body, seconds, 2), Fixed(seconds / 200))
    assert found.trajectory.status == "diverged"
    # At five times the limit a motion grows a hundredfold a step: lost within the first stretch.
    assert found.trajectory.ended_at <= 50 * seconds / 200
    assert found.margin < 0.3


def test_steps_beyond_a_falling_limit_are_undone():
    """A law that stiffens 25-fold under a blow: the limit falls faster than it is looked at.

    No cell is turned inside out, after which the motion would depend on rounding.
    """
    body, material = column((4, 4, 6), gravity=50.0)
    material = dataclasses.replace(material, law=STIFFENING, damping=NodalDamping(5.0))
    found = run(body, material, np.ones_like, watch(body, 0.5, 26))
    assert found.trajectory.status == "finished"
    assert found.inverted_cells == 0
    assert found.repeated_steps > 0
    assert found.smallest_step < 0.5 * found.critical_time_step
    assert found.margin >= 1 / 0.95 - 1e-6
    again = run(body, material, np.ones_like, watch(body, 0.5, 26))
    assert np.array_equal(again.trajectory.displacement, found.trajectory.displacement)


@pytest.mark.parametrize(("integrator", "order"), [("symplectic-euler", 1), ("velocity-verlet", 2)])
def test_halving_every_step_of_a_varying_sequence_shows_the_order(integrator, order):
    body, material = column((3, 3, 8), 0.45, gravity=6.0)
    material = dataclasses.replace(material, damping=NodalDamping(10.0))
    seen = watch(body, 0.2, 11)

    def ends(step):
        return run(body, material, np.sin, seen, step, integrator=integrator)

    first = ends(Automatic(0.4))
    counts = first.substeps + np.arange(10) % 3  # a sequence that does vary
    motions = [ends(Counts(2**n * counts)).trajectory.displacement[-1] for n in range(4)]
    changes = [np.linalg.norm(b - a) for a, b in pairwise(motions)]
    assert np.log2(changes[-2] / changes[-1]) == pytest.approx(order, abs=0.2)


def test_a_body_that_flies_off_is_divergence_however_short_the_step():
    body, material = column((2, 2, 2), gravity=9.81, held=False)
    found = run(body, material, np.ones_like, watch(body, 1.0, 51))
    assert found.trajectory.status == "diverged"
    # It falls by its own size, g t^2 / 2 = 0.02 m, and is seen to within a stretch of steps.
    assert found.trajectory.ended_at == pytest.approx(np.sqrt(2 * 0.02 / 9.81), abs=0.03)
    fallen = found.trajectory.displacement[1, 0, 2]
    assert fallen == pytest.approx(-9.81 * 0.02**2 / 2, rel=0.2)


def test_an_integrator_without_a_limit_takes_one_step_a_sample():
    body, material = column((2, 2, 2), 0.45, gravity=1.0)
    found = run(body, material, np.ones_like, watch(body, 0.2, 11), integrator="implicit-euler")
    assert (found.substeps == 1).all()
    assert found.trajectory.status == "finished"


@pytest.mark.parametrize(
    ("step", "message"),
    [
        (Fixed(0.003), r"step\.seconds: 0\.003 s does not divide .* take 0\.0025 s"),
        (Fixed(0.0), r"step\.seconds must be positive"),
        (Rate(-1.0), r"step\.hertz must be positive"),
        (Automatic(0.0), r"step\.fraction must be positive"),
        (Counts(np.ones(3, dtype=np.int64)), r"step\.substeps .* 10 sampling intervals"),
        (Counts(np.zeros(10, dtype=np.int64)), r"step\.substeps .* at least one"),
        (Rate(1e7), r"the limit is 3e\+05"),
    ],
)
def test_a_step_that_does_not_suit_the_samples_is_refused(step, message):
    body, material = column((2, 2, 2))
    with pytest.raises(ValueError, match=message):
        run(body, material, np.ones_like, watch(body, 0.1, 11), step)


def test_a_rate_is_raised_until_it_divides_the_samples():
    body, material = column((2, 2, 2))
    found = run(body, material, np.ones_like, watch(body, 0.1, 11), Rate(950.0))
    assert found.smallest_step == found.largest_step == pytest.approx(1e-3)
    assert found.steps == 100


def test_position_based_springs_are_linear_only():
    body, material = column((2, 2, 2))
    stiffening = dataclasses.replace(material, law=STIFFENING)
    with pytest.raises(ValueError, match="linear springs only"):
        run(body, stiffening, np.ones_like, watch(body, 0.1, 11), Rate(1e3), integrator="xpbd")


def test_inverted_cells_are_counted_by_their_determinant(rng):
    body, _ = column((4, 4, 4))
    lattice = body.lattice
    u = 0.9 * H * rng.standard_normal(lattice.nodes.shape)
    toward = (2.0 * np.indices((2, 2, 2)).reshape(3, 8).T - 1.0) / (4.0 * H)
    gradient = np.einsum("cad,ae->cde", u[lattice.cells], toward)
    expected = int((np.linalg.det(np.eye(3) + gradient) <= 0).sum())
    assert 0 < expected < len(lattice.cells)
    assert inverted_cells(lattice.cells.astype(np.int32), lattice.edges, u) == expected


def test_a_state_that_is_not_finite_counts_as_beyond_all_bounds():
    from msm.linearised import farthest

    u = np.zeros((5, 3))
    u[3, 1] = -0.2
    assert farthest(u) == (0.2, 3)
    for bad in (np.nan, np.inf, -np.inf):
        u[4, 2] = bad
        assert farthest(u) == (np.inf, 4)


def test_the_coupling_of_damping_and_oscillation_does_not_touch_implicit_damping():
    method = INTEGRATORS["symplectic-euler"]
    assert longest_step(method, 10.0, 1e9) == pytest.approx(0.2)
    assert longest_step(method, 0.0, 0.0) == float("inf")
    assert stability.DAMPING_WEIGHT < 1.0


def test_the_step_at_rest_is_that_of_the_steeper_side_of_a_corner():
    """Of a law twice as steep towards compression; the other way round nothing changes."""
    (body, _), strain = column((2, 2, 3)), [-0.1, 0.0, 0.1]
    steep = critical_time_step(body, Material(Hooke(20.0)))
    for tension in ([-2.0, 0.0, 1.0], [-1.0, 0.0, 2.0], [-2.0, 0.0, 2.0]):
        cornered = Material(piecewise(strain, tension))
        assert critical_time_step(body, cornered) == pytest.approx(steep, rel=1e-3)
        stepper = LatticeStepper(body, cornered, np.ones_like)
        assert stepper.limit_at_rest == pytest.approx(steep, rel=2e-3)
    soft = critical_time_step(body, Material(piecewise(strain, [-1.0, 0.0, 1.0])))
    assert soft > 1.05 * steep


def test_steps_are_limited_as_they_are_asked_for_and_not_where_they_are_halved(monkeypatch):
    """A run that was let through is not refused when its error is to be told."""
    body, material = column((2, 2, 3))
    seen = watch(body, 0.1, 17)
    asked = run(body, material, np.ones_like, seen)
    monkeypatch.setattr("msm.model.MAX_STEPS", asked.steps)
    halved = run(body, material, np.ones_like, seen, Counts(2 * asked.substeps))
    assert halved.steps == 2 * asked.steps
    for step, remedy in ((Fixed(0.1 / 16 / 64), "time_step"), (Rate(64 * 160.0), "step_rate")):
        with pytest.raises(ValueError, match=f"lattice.{remedy}"):
            refuse(body, material, seen, step)
