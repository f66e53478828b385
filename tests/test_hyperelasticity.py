"""Hyperelastic statics against closed forms, derivatives, a manufactured field and its own laws."""

from dataclasses import replace

import numpy as np
import pytest
import skfem
from scipy.optimize import brentq
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import spsolve

from fem_reference import laws
from fem_reference.elasticity import discretise
from fem_reference.hyperelasticity import by_positive_weights, largest_log_strain, material, solid
from fem_reference.laws import NeoHookean, StVenantKirchhoff
from fem_reference.mixed_strain import mixed_solid
from fem_reference.newton import TOLERANCE, solve
from study.mesh.kinds import TetrahedralMesh
from study.numerics.continuation import UNSTABLE
from study.organ.block import block_mesh
from study.problem.contact import Foundation, ToolPatch
from study.problem.tissue import Tissue
from tests.benchmarks import large_strain

EDGE = 0.04
CUBE = (EDGE, EDGE, EDGE)
TISSUE = Tissue(youngs_modulus=5e3, poisson_ratio=0.45)
DOWN = np.array([0.0, 0.0, -1.0])
LAWS = tuple(laws.LAWS)
MU, LAME = 5e3 / 2.9, 5e3 * 0.45 / (1.45 * 0.1)
EYE = np.eye(3)


def pressed(size=0.02, force=0.05, mesh=None, tissue=TISSUE):
    """The cube on a foundation under a round tool."""
    tool = ToolPatch(np.array([EDGE / 2, EDGE / 2, EDGE]), DOWN, 0.015, force)
    return discretise(mesh or block_mesh(CUBE, size), tissue, Foundation(DOWN, 0, 1e-3, 1e7), tool)


FOUNDATION = Foundation(DOWN, 0, 1e-3, 1e7)
PRESSED = ToolPatch(np.array([EDGE / 2, EDGE / 2, EDGE]), DOWN, 0.015, 0.2)


def jittered(rng):
    mesh = block_mesh(CUBE, 0.02)
    inner = ((mesh.points > 1e-9) & (mesh.points < EDGE - 1e-9)).all(axis=1)
    points = mesh.points + inner[:, None] * rng.uniform(-3e-3, 3e-3, mesh.points.shape)
    return TetrahedralMesh(points, mesh.tetrahedra)


def homogeneous(body, F):
    """Unknowns of the displacement (F - I) X."""
    return (body.points @ (F - EYE).T).ravel()


ROLLERS = ((0, (0,)), (1, (1,)), (2, (2,)))
FIXED_BASE = ((2, (0, 1, 2)),)


def pulled(body, P, held=ROLLERS):
    """The body under dead tractions P N on all faces.

    Springs hold it at components of planes x_axis = 0 that its exact field does not move: they take
    no force and only choose the place.
    """
    surface = skfem.FacetBasis(body.nodes.mesh, body.nodes.elem, intorder=2)
    area = [skfem.LinearForm(lambda v, w, J=J: w.n[J] * v).assemble(surface) for J in range(3)]
    springs = np.zeros((len(body.points), 3))
    for axis, components in held:
        on_plane = body.points[:, axis] < 1e-9
        springs[np.ix_(on_plane, components)] = 5e3 * EDGE
    support = csc_array(diags_array(springs.ravel()))
    return replace(body, load=(np.stack(area, axis=1) @ P.T).ravel(), support=support)


def taylor_order(remainder, steps):
    """Slope of a Taylor remainder over the step in logarithms."""
    return np.polyfit(np.log(steps), np.log([remainder(h) for h in steps]), 1)[0]


@pytest.mark.parametrize("law", LAWS)
def test_stress_and_tangent_are_derivatives_of_the_energy(law, rng):
    found = material(TISSUE, law)
    F, dF = EYE + 0.2 * rng.standard_normal((2, 3, 3))
    P, A = found.stress(F), found.tangent(F)
    steps = 0.1 / 2.0 ** np.arange(3, 8)

    def of_energy(h):
        return abs(found.energy(F + h * dF) - found.energy(F) - h * (P * dF).sum())

    def of_stress(h, slope=A):
        linear = np.einsum("iJkL,kL->iJ", slope, dF)
        return np.linalg.norm(found.stress(F + h * dF) - P - h * linear)

    assert taylor_order(of_energy, steps) == pytest.approx(2.0, abs=0.1)
    assert taylor_order(of_stress, steps) == pytest.approx(2.0, abs=0.1)
    # Without the term of the geometry the remainder is only of first order.
    wrong = A - np.einsum("ik,JL->iJkL", EYE, np.linalg.solve(F, P))
    assert taylor_order(lambda h: of_stress(h, wrong), steps) < 1.3


@pytest.mark.parametrize("law", LAWS)
def test_forces_and_stiffness_are_derivatives_of_the_bodys_energy(law, rng):
    problem = solid(pressed(mesh=jittered(rng)), TISSUE, law)
    u, du = 5e-4 * rng.standard_normal((2, len(problem.load)))
    f, K = problem.internal_force(u), problem.tangent(u)
    steps = 0.5 / 2.0 ** np.arange(1, 6)

    def of_energy(h):
        return abs(problem.energy(u + h * du) - problem.energy(u) - h * f @ du)

    def of_force(h):
        return np.linalg.norm(problem.internal_force(u + h * du) - f - h * (K @ du))

    assert taylor_order(of_energy, steps) == pytest.approx(2.0, abs=0.1)
    assert taylor_order(of_force, steps) == pytest.approx(2.0, abs=0.1)
    assert abs(K - K.T).max() < 1e-14 * abs(K).max()


@pytest.mark.parametrize("law", LAWS)
def test_the_stiffness_is_that_of_scikit_fems_own_form(law, rng):
    body = pressed(0.04)
    u = 1e-3 * rng.standard_normal(len(body.load))
    found = material(TISSUE, law)

    def form(du, v, w):
        F = np.moveaxis(np.asarray(w["u"].grad), (0, 1), (-2, -1)) + EYE
        return np.einsum("...iJkL,iJ...,kL...->...", found.tangent(F), v.grad, du.grad)

    basis = by_positive_weights(body.basis)
    expected = skfem.BilinearForm(form).assemble(basis, u=basis.interpolate(u))
    K = solid(body, TISSUE, law).tangent(u) - body.support
    assert abs(K - expected).max() < 1e-13 * abs(K).max()


@pytest.mark.parametrize("law", LAWS)
def test_without_load_the_stiffness_is_the_linear_one(law):
    body = pressed()
    K = solid(body, TISSUE, law).tangent(np.zeros(len(body.load)))
    assert abs(K - body.stiffness.matrix).max() < 1e-13 * abs(K).max()


@pytest.mark.parametrize("law", LAWS)
def test_energy_and_stress_do_not_depend_on_the_frame(law, rng):
    found = material(TISSUE, law)
    F = EYE + 0.2 * rng.standard_normal((3, 3))
    Q = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    Q *= np.linalg.det(Q)
    assert found.energy(Q @ F) == pytest.approx(found.energy(F), rel=1e-12)
    assert found.stress(Q @ F) == pytest.approx(Q @ found.stress(F), rel=1e-10, abs=1e-9)


@pytest.mark.parametrize("law", LAWS)
def test_turning_by_90_degrees_costs_nothing(law):
    problem = solid(body := pressed(), TISSUE, law)
    problem = replace(problem, support=0.0 * body.support)
    u = homogeneous(body, np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
    assert abs(problem.energy(u)) < 1e-12 * MU * EDGE**3
    assert np.abs(problem.internal_force(u)).max() < 1e-12 * MU * EDGE**2
    # The linear body, for comparison, is stretched by it.
    assert 0.5 * u @ ((body.stiffness.matrix - body.support) @ u) > MU * EDGE**3


@pytest.mark.parametrize("law", LAWS)
def test_patch_test_at_finite_strain_on_a_distorted_mesh(law, rng):
    body = pressed(mesh=jittered(rng))
    problem = replace(solid(body, TISSUE, law), support=0.0 * body.support)
    F = EYE + 0.15 * rng.standard_normal((3, 3))
    u = homogeneous(body, F)
    assert problem.energy(u) == pytest.approx(problem.law.energy(F) * EDGE**3, rel=1e-12)
    force = problem.internal_force(u).reshape(-1, 3)
    inner = ((body.points > 1e-9) & (body.points < EDGE - 1e-9)).all(axis=1)
    assert inner.any()
    assert np.abs(force[inner]).max() < 1e-12 * np.abs(force).max()


def across(law, stretch):
    """Lateral stretch and nominal stress along, of a bar with free sides, from its own equations.

    Neo-Hookean: mu (a^2 - 1) + lambda ln(a^2 s) = 0 and P = mu (s - 1/s) + lambda ln(a^2 s) / s.
    St. Venant-Kirchhoff: uniaxial Hooke's law between E and S.
    """
    if law == "st-venant-kirchhoff":
        strain = 0.5 * (stretch**2 - 1.0)
        return np.sqrt(1.0 - 0.9 * strain), stretch * 5e3 * strain
    a = brentq(lambda a: MU * (a * a - 1) + LAME * np.log(a * a * stretch), 0.5, 2.0, xtol=1e-15)
    volume = np.log(a * a * stretch)
    return a, MU * (stretch - 1.0 / stretch) + LAME * volume / stretch


@pytest.mark.parametrize("stretch", [0.8, 1.3])
@pytest.mark.parametrize("law", LAWS)
def test_a_bar_with_free_sides_takes_the_closed_form(law, stretch, rng):
    lateral, along = across(law, stretch)
    body = pulled(pressed(mesh=jittered(rng)), np.diag([0.0, 0.0, along]))
    (state,) = solve(body, TISSUE, law).states
    expected = homogeneous(body, np.diag([lateral, lateral, stretch]))
    # Forces balance to 1e-8 of the load, and the last step of Newton's method is far below that.
    assert np.abs(state.displacement - expected).max() < 1e-10 * np.abs(expected).max()
    assert state.largest_strain == pytest.approx(abs(np.log(stretch)), rel=1e-8)
    assert state.smallest_volume == pytest.approx(lateral**2 * stretch, rel=1e-8)
    other = across(LAWS[law == LAWS[0]], stretch)[0]
    assert abs(other - lateral) > 1e-3  # the closed forms tell the laws apart


def test_simple_shear_takes_the_closed_form():
    """J = 1, so that P = mu (F - F^-T) = mu gamma (e1 e3 + e3 e1) in the neo-Hookean law."""
    F, P = EYE.copy(), np.zeros((3, 3))
    F[0, 2] = gamma = 0.3
    P[0, 2] = P[2, 0] = MU * gamma
    body = pulled(pressed(), P, FIXED_BASE)
    (state,) = solve(body, TISSUE).states
    expected = homogeneous(body, F)
    assert np.abs(state.displacement - expected).max() < 1e-10 * np.abs(expected).max()
    assert state.energy == pytest.approx(0.5 * MU * gamma**2 * EDGE**3, rel=1e-9)


@pytest.mark.parametrize("law", LAWS)
def test_small_loads_depart_from_the_linear_solution_in_proportion_to_them(law):
    body = pressed()
    linear = spsolve(body.stiffness.matrix.tocsc(), body.load)
    factors = np.array([0.0125, 0.025, 0.05, 0.1])
    states = solve(body, TISSUE, law, factors).states
    departure = [
        np.linalg.norm(s.displacement / s.load_factor - linear) / np.linalg.norm(linear)
        for s in states
    ]
    slope = np.polyfit(np.log(factors), np.log(departure), 1)[0]
    assert slope == pytest.approx(1.0, abs=0.1)  # the second-order term is 10 % at most
    assert departure[0] < 2e-2


def manufactured(size, law):
    """Relative L2 errors of u and its gradient where the load is that of a known smooth field."""
    body = pressed(size, tissue=TISSUE)
    basis = skfem.Basis(body.nodes.mesh, body.basis.elem, intorder=6)
    stress, per_volume = material(TISSUE, law).stress, 5e3 / EDGE**2
    wave = 1.5 * np.array([[0.3, 1.0, 0.7], [0.9, 0.4, -1.0], [-0.6, 0.8, 0.5]]) / EDGE

    def exact(x):
        return 0.003 * np.sin(np.einsum("ij,j...->i...", wave, x))

    def gradient(x):
        slope = 0.003 * np.cos(np.einsum("ij,j...->i...", wave, x))
        return slope[:, None] * wave[:, :, None, None]

    def form(v, w):
        P = stress(np.moveaxis(gradient(w.x), (0, 1), (-2, -1)) + EYE)
        held = per_volume * np.einsum("i...,i...", exact(w.x), v)
        return np.einsum("...iJ,iJ...->...", P, v.grad) + held

    support = csc_array(body.mass * (per_volume / TISSUE.density))
    (state,) = solve(
        replace(body, load=skfem.LinearForm(form).assemble(basis), support=support), TISSUE, law
    ).states
    assert state.largest_strain > 0.13
    found = basis.interpolate(state.displacement)
    x = np.asarray(basis.global_coordinates())
    return [
        np.sqrt((((f - e) ** 2) * basis.dx).sum() / ((e**2) * basis.dx).sum())
        for f, e in ((np.asarray(found), exact(x)), (found.grad, gradient(x)))
    ]


@pytest.mark.parametrize("law", LAWS)
def test_a_manufactured_large_deformation_converges_with_the_orders_of_quadratic_elements(law):
    coarse, fine = manufactured(EDGE / 3, law), manufactured(EDGE / 4, law)
    orders = np.log(np.array(coarse) / fine) / np.log(4 / 3)
    # From below, 2.7 and 1.8 on the coarsest meshes.
    assert orders == pytest.approx([3.0, 2.0], abs=0.2)
    assert fine[0] < 6e-4


def rate(residuals):
    """Order of convergence, from the last three residuals."""
    before, last = np.diff(np.log(residuals[-3:]))
    return last / before


def test_newtons_method_converges_quadratically():
    (state,) = solve(pressed(force=0.1), TISSUE).states
    assert state.residuals[-1] <= TOLERANCE
    assert rate(state.residuals) == pytest.approx(2.0, abs=0.3)


def test_a_tangent_without_the_geometric_term_is_seen_in_the_rate(monkeypatch):
    full = NeoHookean.tangent

    def without(self, F):
        second = np.linalg.solve(F, self.stress(F))
        return full(self, F) - np.einsum("ik,...JL->...iJkL", EYE, second)

    monkeypatch.setattr(NeoHookean, "tangent", without)
    (state,) = solve(pressed(force=0.1), TISSUE).states
    assert rate(state.residuals) < 1.3


def test_the_way_of_loading_does_not_change_the_rest():
    body = pressed(force=0.1)
    (at_once,) = solve(body, TISSUE).states
    in_steps = solve(body, TISSUE, load_factors=(0.2, 0.7, 1.0)).states[-1]
    back = solve(body, TISSUE, load_factors=(1.3, 1.0)).states[-1]
    for other in (in_steps, back):
        difference = np.abs(other.displacement - at_once.displacement).max()
        assert difference < 1e-7 * np.abs(at_once.displacement).max()


def test_st_venant_kirchhoff_gives_way_in_compression_and_says_so():
    """Its nominal stress s (s^2 - 1) E / 2 has its extreme, 0.1925 E, at a stretch of 1/sqrt(3)."""
    limit = 5e3 / (3.0 * np.sqrt(3.0))
    body = pulled(pressed(0.04), np.diag([0.0, 0.0, -1.1 * limit]))
    path = solve(body, TISSUE, "st-venant-kirchhoff", (0.5, 1.0))
    assert not path.converged
    assert path.failure
    assert [s.load_factor for s in path.states] == [0.5]
    assert 0.8 < path.reached * 1.1 <= 1.0
    assert solve(body, TISSUE, "neo-hookean", (0.5, 1.0)).converged


def test_a_rest_that_the_body_would_leave_is_refused():
    """A bar under dead loads, held softly at its base: balanced, but bound to turn over."""
    lateral, along = across("neo-hookean", 0.8)
    held = pulled(pressed(0.04), np.diag([0.0, 0.0, along]))
    loose = replace(held, support=1e-4 * held.support)
    exact = homogeneous(held, np.diag([lateral, lateral, 0.8]))
    unbalanced = solid(loose, TISSUE).internal_force(exact) - loose.load
    assert np.linalg.norm(unbalanced) < 1e-10 * np.linalg.norm(loose.load)
    assert solve(held, TISSUE).converged
    path = solve(loose, TISSUE)
    assert UNSTABLE in path.failure
    assert not path.states


def test_a_load_beyond_reach_ends_the_path_without_a_number():
    path = solve(pressed(force=1.0), TISSUE, load_factors=(0.01, 1000.0))
    assert not path.converged
    assert len(path.states) == 1
    assert 0.01 <= path.reached < 1000.0
    assert "times the load" in path.failure


def test_every_state_keeps_its_elements_the_right_way_round():
    for state in solve(pressed(force=0.1), TISSUE, load_factors=(1.0, 3.0)).states:
        assert 0.0 < state.smallest_volume <= 1.0


def test_the_largest_strain_counts_compression_and_extension_alike():
    assert largest_log_strain(np.diag([1.0, 1.1, 0.5])) == pytest.approx(np.log(2.0))
    assert largest_log_strain(np.diag([1.0, 2.0, 0.9])) == pytest.approx(np.log(2.0))


def test_neo_hookean_resists_collapse_and_st_venant_kirchhoff_does_not():
    flat = np.diag([1.0, 1.0, 1e-6])
    assert NeoHookean(LAME, MU).energy(flat) > 50 * LAME
    assert StVenantKirchhoff(LAME, MU).energy(flat) < LAME


@pytest.mark.parametrize("factors", [(0.0,), (1.0, float("nan"))])
def test_a_load_factor_that_loads_nothing_is_refused(factors):
    with pytest.raises(ValueError, match="load_factors"):
        solve(pressed(0.04), TISSUE, load_factors=factors)


def test_an_unknown_law_and_a_pressure_field_are_refused():
    with pytest.raises(ValueError, match="neo-hookean or st-venant-kirchhoff"):
        solve(pressed(0.04), TISSUE, "mooney")
    stiff = Tissue(poisson_ratio=0.495)
    with pytest.raises(ValueError, match="element 'p2'"):
        solve(pressed(0.04, tissue=stiff), stiff, "st-venant-kirchhoff")
    with pytest.raises(ValueError, match="element 'p2'"):
        solid(pressed(0.04, tissue=stiff), stiff)


def test_with_a_pressure_the_rest_is_that_of_displacements_alone():
    """Where both are good, the two kinds of elements differ by what the mesh costs them."""
    tissue = Tissue(youngs_modulus=5e3, poisson_ratio=0.3)
    p2, mixed = (
        discretise(block_mesh(CUBE, 0.01), tissue, FOUNDATION, PRESSED, element)
        for element in ("p2", "taylor-hood")
    )
    (a,), (b,) = (solve(one, tissue).states for one in (p2, mixed))
    assert np.linalg.norm(a.displacement - b.displacement) < 0.02 * np.linalg.norm(a.displacement)
    assert b.largest_strain == pytest.approx(a.largest_strain, rel=0.1)
    assert b.energy == pytest.approx(a.energy, rel=0.02)
    assert b.iterations >= len(b.residuals) - 1
    # Near incompressibility only the mixed ones give the volume back.
    stiff = Tissue(youngs_modulus=5e3, poisson_ratio=0.4999)
    (c,) = solve(discretise(block_mesh(CUBE, 0.01), stiff, FOUNDATION, PRESSED), stiff).states
    assert c.residuals[-1] < 1e-8
    assert 0.5 < np.abs(c.displacement).max() / np.abs(a.displacement).max() < 1.0


def test_the_law_of_the_lattice_is_its_springs_and_volume_term(rng):
    """At rest it is Hooke's law, isotropic; its derivatives hold at large strain."""
    law = large_strain.Springs(LAME, MU)
    assert np.abs(law.tangent(EYE) - NeoHookean(LAME, MU).tangent(EYE)).max() < 1e-12 * LAME
    F, dF = EYE + 0.2 * rng.standard_normal((2, 3, 3))
    P, A = law.stress(F), law.tangent(F)
    steps = 0.1 / 2.0 ** np.arange(3, 8)

    def of_energy(h):
        return abs(law.energy(F + h * dF) - law.energy(F) - h * (P * dF).sum())

    def of_stress(h):
        linear = np.einsum("iJkL,kL->iJ", A, dF)
        return np.linalg.norm(law.stress(F + h * dF) - P - h * linear)

    assert taylor_order(of_energy, steps) == pytest.approx(2.0, abs=0.1)
    assert taylor_order(of_stress, steps) == pytest.approx(2.0, abs=0.1)


def test_the_table_distinguishes_the_cells_of_a_lattice_from_its_law():
    found = large_strain.read_compared()
    assert {r.load_n for r in found} == set(large_strain.COMPARED_LOADS)
    for r in found:
        # Triangle inequality; elements of both laws are of about the same size.
        assert r.lattice <= 1.1 * (r.springs_law + r.lattice_cells)
        assert r.springs_law < r.linear < 0.35 * r.strain_elements
        assert np.isnan(r.st_venant_kirchhoff) or r.st_venant_kirchhoff > r.linear
    for least in (r for r in found if r.load_n == large_strain.COMPARED_LOADS[0]):
        # Under a small load all that is left is what the linear lattice misses too.
        assert least.lattice_cells == pytest.approx(least.lattice_cells_linear, rel=0.05)


def test_the_lattice_sinks_in_as_its_law_in_elements_does():
    """Depth over the linear one: 5 % more for both at 0.8 N, 0.5 % for neo-Hookean elements."""
    (row,) = [r for r in large_strain.read() if r.load_n == 0.8]
    case = large_strain.block()
    body = large_strain.quarter(case, 0.02)
    linear = 0.8 * body.load @ spsolve(body.stiffness.matrix.tocsc(), body.load)

    def sinks(law):
        (state,) = solve(body, case.tissue(0.45), law, (0.8,)).states
        return body.load @ state.displacement / linear - 1.0

    of_lattice = row.depth_m / row.depth_linear_m - 1.0
    law = large_strain.Springs(*large_strain.lame(case.youngs_modulus, 0.45))
    assert sinks(law) == pytest.approx(of_lattice, rel=0.05)  # 1 % apart, the meshes' part
    assert sinks("neo-hookean") < 0.2 * of_lattice


@pytest.mark.slow
def test_the_smallest_load_of_the_table_is_what_the_code_gives():
    committed = large_strain.read_compared()[0]
    (found,) = large_strain.compared((committed.spacing_m,), (committed.load_n,))
    assert found == pytest.approx(committed, rel=1e-4)  # six digits; forces balance to 1e-8


def test_the_energy_of_each_point_counts_for_and_none_against():
    """The quadrature of the mass has a negative weight, by which a collapse would give energy."""
    body = pressed()
    assert (body.nodes.dx < 0.0).any()
    for weights in (solid(body, TISSUE).weights, mixed_solid(body.nodes.mesh, TISSUE).weights):
        assert (weights > 0.0).all()
        assert weights.sum() == pytest.approx(body.nodes.dx.sum(), rel=1e-12)
