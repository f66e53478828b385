"""The bound of a subspace's error against all modes of small bodies, each integrated exactly."""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.linalg import eigh, expm
from scipy.sparse import csc_array

from fem_reference import certified, stiffness_bound
from fem_reference.certificate import Certificate, certificate, krylov_space, residual
from fem_reference.certified import CertifiedMotion
from fem_reference.direct import factorised, pivots
from fem_reference.elasticity import discretise
from fem_reference.free_motion import decay, free_products
from fem_reference.observation import evaluation
from fem_reference.stiffness_bound import stiffness_lower_bound
from fem_reference.subspace import (
    Subspace,
    modal_subspace,
    ritz_subspace,
    superposition,
    transitions,
)
from study.organ.block import block_mesh
from study.problem.contact import Foundation, ToolPatch
from study.problem.damping import RayleighDamping
from study.problem.tissue import Tissue

ELEMENTS = (("p1", 0.01, 0.45), ("p2", 0.02, 0.3), ("taylor-hood", 0.02, 0.49))
PLACES = ((0.02, 0.01, 0.02), (0.01, 0.008, 0.02), (0.03, 0.015, 0.02))
PROBES = np.array([[0.02, 0.01, 0.0199], [0.012, 0.011, 0.007]])
CASES = 1000
PLANTED = 150
"""Cases in which a planted error has to be found."""


@dataclass(frozen=True)
class Known:
    """A body with all its modes."""

    body: object
    probes: object

    @cached_property
    def modes(self):
        n = self.body.stiffness.size
        K = np.column_stack([self.body.stiffness @ e for e in np.eye(n)])
        return eigh(0.5 * (K + K.T), self.body.mass.toarray())

    def motion(self, damping, loads, step):
        """Modal coordinates (steps + 1, n) from rest, exact for a load linear over steps."""
        squares, shapes = self.modes
        moved, force = transitions(squares, damping, step)[:, :2], shapes.T @ self.body.load
        state, found = np.zeros((len(squares), 2)), [np.zeros(len(squares))]
        for before, after in pairwise(loads):
            slope = (after - before) / step
            whole = np.column_stack([state, force * before, force * slope])
            state = np.einsum("mij,mj->mi", moved, whole)
            found.append(state[:, 0])
        return np.array(found)

    def error(self, damping, loads, step, subspace):
        """Energy norm, and length at the probes, of the subspace's error after each step."""
        squares, shapes = self.modes
        times = step * np.arange(len(loads))
        y, _ = superposition(subspace, damping, lambda t: np.interp(t, times, loads), times)
        inside = shapes.T @ (self.body.mass @ subspace.vectors)
        off = self.motion(damping, loads, step) - y @ inside.T
        u = (off @ shapes.T).reshape(len(loads), -1, 3)
        at = np.linalg.norm(np.einsum("pn,tnd->tpd", self.probes.toarray(), u), axis=2)
        return np.sqrt((squares * off**2).sum(axis=1)), at


def known(element, size, nu, place):
    tissue = Tissue(youngs_modulus=9e3, poisson_ratio=nu, density=1054.0)
    held = Foundation(np.array([0.0, 0.0, -1.0]), 0.0, 0.008, 1e6)
    tool = ToolPatch(np.array(place), np.array([0.0, 0.0, -1.0]), 0.014, 0.5)
    body = discretise(block_mesh((0.04, 0.02, 0.02), size), tissue, held, tool, element)
    return Known(body, evaluation(body, PROBES))


@pytest.fixture(scope="module")
def bodies():
    return [known(*element, place) for element in ELEMENTS for place in PLACES]


@pytest.fixture(scope="module")
def certified_bodies(bodies):
    """Bodies with subspaces of all sizes, and the certificate of each."""
    rng, found = np.random.default_rng(15), []
    for one in bodies:
        for make in (ritz_subspace, modal_subspace):
            whole = make(one.body, 12)
            for size in rng.choice(np.arange(1, 13), 3, replace=False):
                some = whole.leading(int(size))
                vectors = int(rng.choice([size, rng.integers(8, 25)]))
                found.append((one, some, certificate(one.body, some, one.probes, vectors)))
    return found


class Case(NamedTuple):
    """A subspace's certificate, its load, and the errors that a bound must not be below."""

    given: Certificate
    load: tuple[RayleighDamping, np.ndarray, float]
    energy: np.ndarray
    points: np.ndarray


@pytest.fixture(scope="module")
def cases(certified_bodies):
    """Random subspaces, dampings from none to heavy, loads, and steps from short to long."""
    rng = np.random.default_rng(2026)
    return [random_case(rng, certified_bodies) for _ in range(CASES)]


def random_case(rng, certified_bodies):
    one, subspace, given = certified_bodies[rng.integers(len(certified_bodies))]
    lowest = float(np.sqrt(one.modes[0][0]))
    mass = 0.0 if rng.random() < 0.2 else lowest * 10.0 ** rng.uniform(-3.0, 1.5)
    stiffness = 0.0 if rng.random() < 0.4 else 10.0 ** rng.uniform(-4.0, 0.5) / lowest
    loads, step = random_loads(rng, rng.integers(4, 13)), 10.0 ** rng.uniform(-1.5, 0.7) / lowest
    load = RayleighDamping(mass, stiffness), loads, step
    return Case(given, load, *one.error(*load, subspace))


def random_loads(rng, steps):
    """A ramp and hold, a load from the start, one with few kinks, or one with many."""
    kinked = np.cumsum(rng.normal(size=steps + 1) * (rng.random(steps + 1) < 0.3))
    ramp = np.minimum(np.arange(steps + 1) / rng.integers(1, steps), 1.0)
    kinds = (ramp, np.ones(steps + 1), kinked, rng.normal(size=steps + 1))
    return kinds[rng.integers(len(kinds))]


def bounds(given, damping, loads, step):
    times = step * np.arange(len(loads))
    motion = CertifiedMotion(given, damping, lambda t: np.interp(t, times, loads), step)
    found = [motion.bound]
    for _ in loads[1:]:
        motion.take_step()
        found.append(motion.bound)
    energies, points = zip(*found, strict=True)
    return np.array(energies), np.array(points)


def is_short(case, change=lambda given: given):
    energy, points = bounds(change(case.given), *case.load)
    return bool((energy < case.energy).any() or (points < case.points).any())


def test_a_bound_is_never_below_the_error(cases):
    assert len(cases) == CASES
    assert not any(is_short(case) for case in cases)


def test_it_is_mostly_near_the_error(cases):
    ratios = [
        bounds(case.given, *case.load)[0].max() / case.energy.max()
        for case in cases[:PLANTED]
        if case.energy.max() > 0.0
    ]
    assert np.median(ratios) < 4.0


@pytest.mark.parametrize(
    ("number", "share"),
    [("inside", 0.5), ("last", 0.5), ("outside", 0.25), ("load", 0.9), ("squares", 1.1)],
)
def test_a_certificate_with_part_of_a_number_is_found_out(number, share, cases):
    def change(given):
        return replace(given, **{number: share * getattr(given, number)})

    assert any(is_short(case, change) for case in cases[:PLANTED])


def test_half_of_a_dual_norm_is_found_out(cases):
    def change(given):
        outside = given.outside.copy()
        outside[0] *= 0.5
        outside[:, 0] *= 0.5
        return replace(given, norm=0.5 * given.norm, outside=outside)

    assert any(is_short(case, change) for case in cases[:PLANTED])


def test_what_drives_the_head_is_no_less_than_its_integral(cases):
    """The residual's rate over a step, by differences of a fine motion, in the norm it is in."""
    for case in cases[:10]:
        given, (damping, loads, step), parts = case.given, case.load, 400
        motion = CertifiedMotion(given, damping, lambda t, f=loads: f[0] + 0.0 * t, step)
        motion.take_step()  # away from rest
        slope = 0.7 * given.load.size
        rates, forces = [], motion._forces()
        fine = CertifiedMotion(given, damping, lambda t: 0.0 * t, step / parts)
        fine._long.state, fine.load = motion._long.state.copy(), motion.load
        for _ in range(parts):
            fine._long.advance(fine.load, slope)
            fine.load += slope * step / parts
            forces, before = fine._forces(), forces
            rates.append(np.abs(np.cumsum(given.last * (forces - before))))
        whole = given.norm * np.sum(rates, axis=0)
        found = motion._driven(slope)[1:]
        assert (found >= whole - 1e-9 * whole.max()).all()


@pytest.mark.parametrize(
    "term", ["_tail_by_kink", "_tail_by_load", "_leading_products", "_distance"]
)
def test_a_term_that_is_left_out_is_found_out(term, cases, monkeypatch):
    whole = getattr(certified, term)
    monkeypatch.setattr(certified, term, lambda *given: 0.0 * whole(*given))
    assert any(is_short(case) for case in cases[:PLANTED])


def test_a_decay_that_is_too_fast_is_found_out(cases, monkeypatch):
    def hasty(damping, lowest):
        found = decay(damping, lowest)
        return found._replace(rates=4.0 * found.rates)

    monkeypatch.setattr(certified, "decay", hasty)
    assert any(is_short(case) for case in cases[:PLANTED])


def test_compliance_is_that_of_the_stiffest_direction_at_a_control_point(certified_bodies):
    for one, _, given in certified_bodies[::6]:
        squares, shapes = one.modes
        rows = one.probes.toarray()
        for row, found in zip(rows, given.probes.compliance, strict=True):
            J = np.kron(row, np.eye(3)) @ shapes
            assert found == pytest.approx(np.sqrt(np.linalg.norm(J / squares @ J.T, 2)), rel=1e-8)


@pytest.mark.parametrize("mass", [3.0, 30.0])
def test_under_light_damping_the_bound_is_within_a_few_times_the_error(mass, bodies):
    one, step = bodies[0], 1.0 / 60.0
    subspace = ritz_subspace(one.body, 6)
    given = certificate(one.body, subspace, one.probes, 48)
    load = RayleighDamping(mass), np.minimum(np.arange(61) / 6.0, 1.0), step
    energy, point = one.error(*load, subspace)
    energy_bound, point_bound = bounds(given, *load)
    assert energy_bound.max() < 2.0 * energy.max()
    assert point_bound[:, 0].max() < 4.0 * point[:, 0].max()


def test_a_subspace_of_all_that_the_load_reaches_is_as_exact_as_rounding(bodies):
    one = bodies[0]
    subspace = modal_subspace(one.body, one.body.stiffness.size - 3)
    given = certificate(one.body, subspace, one.probes, one.body.stiffness.size)
    energy, _ = bounds(given, RayleighDamping(20.0), np.ones(20), 0.01)
    assert energy.max() < 1e-3 * np.sqrt(given.load @ given.rest)
    assert given.rounding < 1e-7


def test_a_rest_is_bounded_free_of_constants(bodies):
    """Of vectors that hold it, of some that do not, and of one that is wrong by a known share."""
    for one in bodies[::3]:
        squares, shapes = one.modes
        whole = shapes @ ((shapes.T @ one.body.load) / squares)
        at_rest = np.sqrt(one.body.load @ whole)
        modes = Subspace(shapes[:, :5], np.diag(squares[:5]), shapes[:, :5].T @ one.body.load)
        for subspace in (ritz_subspace(one.body, 3), modes):
            off = shapes.T @ (one.body.mass @ (whole - subspace.rest()))
            true = np.sqrt(squares @ off**2) / at_rest
            found = certificate(one.body, subspace, one.probes, 12).error_at_rest
            assert true <= found < 1.001 * true + 1e-7
            short = replace(subspace, load=0.99 * subspace.load)  # 1 % too small
            found = certificate(one.body, short, one.probes, 12).error_at_rest
            share = np.sqrt(subspace.load @ np.linalg.solve(subspace.stiffness, subspace.load))
            assert found == pytest.approx(np.hypot(true, 0.01 * share / at_rest), rel=1e-4)


def test_nothing_is_not_known_of_a_body_at_rest_without_a_load(certified_bodies):
    given = certified_bodies[0][2]
    energy, point = bounds(given, RayleighDamping(5.0, 1e-3), np.zeros(5), 0.01)
    assert not energy.any()
    assert not point.any()


def test_a_certificate_is_not_of_the_body_s_size(certified_bodies):
    one, subspace, given = certified_bodies[-1]
    sizes = {len(given.squares), len(subspace.load), len(subspace.load) + 1}
    assert {*given.inside.shape, *given.outside.shape} <= sizes
    assert one.body.unknowns not in sizes


def test_the_residual_of_a_krylov_space_has_one_direction_of_known_norm(bodies):
    for one in bodies[::3]:
        body, (squares, shapes) = one.body, one.modes
        factors = factorised(body.stiffness.system())
        padding = np.zeros(body.unknowns - body.stiffness.size)
        n = body.stiffness.size

        def solve(f, factors=factors, padding=padding, n=n):
            return factors(np.concatenate([f, padding]))[:n]

        space = krylov_space(body, solve, 9)
        found = residual(body, space, solve, stiffness_lower_bound(body, squares[0]))
        V = space.vectors
        KV = np.column_stack([body.stiffness @ v for v in V.T])
        whole = body.mass @ V - KV @ np.linalg.inv(space.stiffness)
        norms = np.linalg.norm((shapes.T @ whole) / np.sqrt(squares)[:, None], axis=0)
        assert found.norm == pytest.approx(norms[-1], rel=1e-6)
        assert (norms[:-1] < found.defect).all()
        assert found.defect < 1e-6 * found.norm


def test_a_floor_is_proven_below_all_eigenvalues(bodies):
    for one in bodies:
        lowest = one.modes[0][0]
        for tried in (lowest, 30.0 * lowest):  # the lowest modes may not move under the load
            floor = stiffness_lower_bound(one.body, tried)
            assert 0.2 * lowest < floor.eigenvalue < lowest
            K = one.modes[1] * np.sqrt(floor.diagonal)[:, None]
            assert np.linalg.norm(K / np.sqrt(one.modes[0]), 2) < 1.0


def test_pivots_count_the_eigenvalues_below_a_shift(bodies):
    for one in bodies:
        squares, pressures = one.modes[0], one.body.unknowns - one.body.stiffness.size
        shift = 0.5 * (squares[4] + squares[5])
        nothing = np.zeros(one.body.stiffness.size)
        found = pivots(stiffness_bound._shifted(one.body, shift, nothing))
        assert found.in_place
        assert found.negative == 5 + pressures
        assert 0.0 < found.rounding < 1e-8  # far below the gap to the next eigenvalue


def test_a_body_that_nothing_holds_has_no_floor(bodies):
    loose = replace(
        bodies[0].body,
        stiffness=replace(
            bodies[0].body.stiffness,
            matrix=bodies[0].body.stiffness.matrix - bodies[0].body.support,
        ),
    )
    with pytest.raises(ValueError, match="nothing holds the body"):
        stiffness_lower_bound(loose, 1e-3)


DAMPINGS = [(0.0, 0.0), (0.3, 0.0), (40.0, 0.0), (0.0, 3e-3), (0.0, 0.8), (5.0, 1.0)]


@pytest.mark.parametrize(("mass", "stiffness"), DAMPINGS)
def test_free_motion_decays_in_its_norm_at_every_rate(mass, stiffness, rng):
    damping, lowest = RayleighDamping(mass, stiffness), 2.0
    found = decay(damping, lowest)
    assert (found.rates > 0.0).any() == (mass + stiffness > 0.0)
    squares = np.concatenate([[lowest], lowest * 10.0 ** rng.uniform(0.0, 6.0, 40)])
    x, v = rng.normal(size=(2, 41)) * np.array([[1.0], [1.0]]) / np.sqrt(squares)
    v = v * np.sqrt(squares)
    before = found.squared(x, v, squares)
    assert (before >= found.margin[:, None] * squares * x**2 * (1.0 - 1e-9)).all()
    assert (
        found.squared(x, 0.0 * v, squares)
        <= found.lift[:, None] ** 2 * squares * x**2 * (1.0 + 1e-9)
    ).all()
    for step in (1e-3, 0.1, 3.0):
        moved = transitions(squares, damping, step)[:, :2, :2]
        after = found.squared(*np.einsum("mij,jm->im", moved, np.stack([x, v])), squares)
        most = np.exp(-2.0 * found.rates * step)[:, None] * before
        assert (after <= most * (1.0 + 1e-9) + 1e-13).all()


@pytest.mark.parametrize(("mass", "stiffness"), DAMPINGS)
def test_products_of_free_motions_are_those_of_quadrature(mass, stiffness, rng):
    damping, squares, step = RayleighDamping(mass, stiffness), np.array([1.0, 30.0, 2e3]), 0.4
    state = rng.normal(size=(3, 2))

    def displacements(t):
        rate = np.zeros((3, 2, 2))
        rate[:, 0, 1], rate[:, 1, 0] = np.sqrt(squares), -np.sqrt(squares)
        rate[:, 1, 1] = -(mass + stiffness * squares)
        return np.einsum("mj,mj->m", expm(t * rate)[:, 0], state)

    wanted, _ = quad_vec(
        lambda t: np.outer(displacements(t), displacements(t)), 0.0, step, epsabs=1e-11
    )
    found = np.einsum("ia,iajb,jb->ij", state, free_products(squares, damping, step), state)
    assert found == pytest.approx(wanted, rel=1e-8, abs=1e-10)


def test_pivots_of_a_matrix_that_rounding_could_turn_are_not_trusted(rng):
    """The smallest eigenvalue, against the diagonal, is told from one below rounding."""
    basis = np.linalg.qr(rng.normal(size=(40, 40)))[0]
    for smallest in (1e-3, 1e-6, -1e-6, 1e-16, -1e-16):
        matrix = (basis * np.concatenate([[smallest], rng.uniform(0.5, 2.0, 39)])) @ basis.T
        found = pivots(csc_array(0.5 * (matrix + matrix.T)))
        if abs(smallest) > 1e-9:
            assert found.negative == (smallest < 0.0)
            assert found.rounding < 0.1 * abs(smallest)
        else:
            assert found.rounding > abs(smallest)


def test_what_the_page_shows_bounds_each_frame(bodies):
    page = (Path(__file__).parents[1] / "docs" / "superposition.md").read_text(encoding="utf-8")
    block = next(text for text in page.split("```python\n")[1:] if "CertifiedMotion" in text)
    shown: dict[str, object] = {}
    exec(block.split("```")[0], shown)  # noqa: S102 - what is run is our own page
    one, step, loads = bodies[0], 1.0 / 60.0, np.linspace(0.0, 1.0, 7)
    times, damping = step * np.arange(7), RayleighDamping(20.0)
    found = shown["bounds"](
        one.body, PROBES, damping, lambda t: np.interp(t, times, loads), step, 6
    )
    _, true = one.error(damping, loads, step, ritz_subspace(one.body, 16))
    assert (np.array(list(found)) >= true[1:]).all()
