"""Tissue that differs from place to place: shares of cells, Eshelby's ball, springs."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import cg

from fem_reference.elasticity import discretise
from fem_reference.elements import chosen_element
from fem_reference.newton import solve
from fem_reference.solvers import solve_static
from msm import lattice as cells
from msm.assembly import Assembly, of_tissue
from msm.model import critical_time_step
from msm.springs import connect
from msm.statics import stiffness_at_rest
from study.known.inclusion import STRAIN, BallInclusion
from study.known.verification import ball_inclusion
from study.mesh.tetrahedra import volumes
from study.models.tissue import elastic
from study.organ.block import block_mesh
from study.organ.occupancy import ImplicitBody
from study.problem.contact import Foundation, ToolPatch
from study.problem.heterogeneous import Ellipsoid, HeterogeneousTissue, Region, of_tetrahedra
from study.problem.tissue import Tissue

RADIUS, HALF, E = 0.01, 0.03, 9.5e3
DOWN = np.array([0.0, 0.0, -1.0])
CENTRE = np.full(3, 0.02)


def ball(modulus, radius=RADIUS, centre=CENTRE, **own):
    distance = Ellipsoid(centre, np.full(3, radius))
    return Region(name="ball", distance=distance, youngs_modulus=modulus, **own)


def pressed(tissue, element="p2", size=0.01):
    """A cube of 4 cm on a foundation under a tool."""
    tool = ToolPatch(np.array([0.02, 0.02, 0.04]), DOWN, 0.02, 0.05)
    mesh = block_mesh((0.04, 0.04, 0.04), size)
    return discretise(mesh, tissue, Foundation(DOWN, 0.0, 1e-3, 1e6), tool, element)


def in_a_lattice(found, count, flexion=0.2):
    """Error of Eshelby's ball in a lattice of so many cells along each edge of its cube."""
    h, nu = 2.0 * HALF / count, found.around.poisson_ratio
    whole = ImplicitBody(lambda points: np.full(points.shape[:-1], -1.0))
    mesh = cells.build(whole, np.full(3, -HALF), np.full(3, HALF), h)
    nodes, made = mesh.nodes, cells.composed(mesh, found.tissue)
    body = Assembly(
        mesh,
        connect(mesh, flexion),
        np.ones(len(nodes)),
        csr_array((len(nodes), len(nodes))),
        np.zeros_like(nodes),
        made,
        partial(connect, mesh, flexion, 0.0),
    )
    varied, material = of_tissue(body, elastic(mesh, E, nu), E)
    K, exact = stiffness_at_rest(varied, material), found.displacement(nodes)
    free = np.repeat((np.abs(nodes) < HALF - 1e-9).all(axis=1), 3)
    u = np.where(free, 0.0, exact.ravel())
    inner = K[free][:, free]
    u[free], failed = cg(
        inner, -(K @ u)[free], rtol=1e-11, M=diags_array(1.0 / inner.diagonal()), maxiter=5000
    )
    assert not failed
    return found.off(u.reshape(-1, 3), nodes)


def stiffer(times, nu=0.45):
    return BallInclusion.stiffer(RADIUS, times, Tissue(poisson_ratio=nu), STRAIN)


# Shares ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("radius", "within"), [(0.004, 0.04), (0.011, 0.01), (0.018, 0.005)])
def test_shares_of_elements_and_cells_keep_the_volume_of_a_ball(radius, within):
    tissue = HeterogeneousTissue(regions=(ball(E, radius),))
    mesh = block_mesh((0.04, 0.04, 0.04), 0.005)
    exact = 4.0 / 3.0 * np.pi * radius**3
    own = float(volumes(mesh) @ of_tetrahedra(mesh, tissue).share[:, 0])
    assert own == pytest.approx(exact, rel=within)
    whole = ImplicitBody(lambda points: np.full(points.shape[:-1], -1.0))
    lattice = cells.build(whole, np.zeros(3), np.full(3, 0.04), 0.005)
    own = float(cells.composed(lattice, tissue).share.sum() * 0.005**3)
    assert own == pytest.approx(exact, rel=within)


@pytest.mark.parametrize("semi_axes", [(0.018, 0.004, 0.004), (0.016, 0.016, 0.003)])
def test_shares_keep_the_volume_of_an_ellipsoid(semi_axes):
    """Far from a ball: what lies near is not told by the longest of its axes."""
    shape = Ellipsoid(CENTRE, np.array(semi_axes))
    tissue = HeterogeneousTissue(regions=(Region(name="oval", distance=shape, youngs_modulus=E),))
    mesh = block_mesh((0.04, 0.04, 0.04), 0.005)
    own = float(volumes(mesh) @ of_tetrahedra(mesh, tissue).share[:, 0])
    assert own == pytest.approx(4.0 / 3.0 * np.pi * np.prod(semi_axes), rel=0.02)


def test_the_last_of_two_regions_counts_where_they_meet():
    two = (ball(2 * E, 0.015), ball(3 * E, 0.008))
    mesh = block_mesh((0.04, 0.04, 0.04), 0.005)
    found = of_tetrahedra(mesh, HeterogeneousTissue(regions=two))
    inner, whole = (4.0 / 3.0 * np.pi * r**3 for r in (0.008, 0.015))
    assert volumes(mesh) @ found.share == pytest.approx([whole - inner, inner], rel=0.02)
    assert found.around.min() >= 0.0


def test_a_cut_cell_has_the_mean_compliance_and_density_of_its_parts():
    region = ball(1e5, 1.0, np.array([-1.0, 0.0, 0.0]), poisson_ratio=0.3, density=2000.0)
    mesh = block_mesh((0.01, 0.01, 0.01), 0.01)
    moved = replace(mesh, points=mesh.points - 0.005)
    found = of_tetrahedra(moved, HeterogeneousTissue(regions=(region,)))
    share = found.share[:, 0]
    assert 0.05 < share.min() < share.max() < 0.95
    around = Tissue(poisson_ratio=0.45)
    expected = share * 2.6 / 1e5 + (1.0 - share) * 2.9 / E
    assert 1.0 / found.moduli(around).shear == pytest.approx(expected)
    assert found.density(1000.0) == pytest.approx(1000.0 + 1000.0 * share)


# Elements --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("element", "nu"), [("p1", 0.3), ("p2", 0.45), ("taylor-hood", 0.49)])
def test_an_inclusion_like_its_surroundings_changes_nothing(element, nu):
    plain = solve_static(pressed(Tissue(poisson_ratio=nu), element))
    like = HeterogeneousTissue(poisson_ratio=nu, regions=(ball(E),))
    assert solve_static(pressed(like, element)) == pytest.approx(plain, abs=1e-10 * plain.max())
    other = HeterogeneousTissue(poisson_ratio=nu, regions=(ball(1.01 * E),))
    assert np.abs(solve_static(pressed(other, element)) - plain).max() > 1e-4 * plain.max()


def test_elements_wholly_of_a_region_are_those_of_its_tissue():
    own = Tissue(youngs_modulus=3e4, poisson_ratio=0.3, density=1200.0)
    everywhere = HeterogeneousTissue(regions=(ball(3e4, 1.0, poisson_ratio=0.3, density=1200.0),))
    expected, found = pressed(own), pressed(everywhere)
    assert found.mass.sum() == pytest.approx(expected.mass.sum(), rel=1e-12)
    at_rest = solve_static(expected)
    assert solve_static(found) == pytest.approx(at_rest, abs=1e-9 * np.abs(at_rest).max())


def test_a_pressure_of_its_own_follows_a_region():
    """Mixed elements near nu 1/2, against displacements alone at a ratio that both can do."""
    tissue = HeterogeneousTissue(poisson_ratio=0.4, regions=(ball(1e5, poisson_ratio=0.3),))
    plain, mixed = (solve_static(pressed(tissue, name, 0.005)) for name in ("p2", "taylor-hood"))
    assert np.linalg.norm(plain - mixed) < 0.02 * np.linalg.norm(plain)
    empty = HeterogeneousTissue(poisson_ratio=0.4, regions=(ball(1e5, 1.0, poisson_ratio=0.0),))
    with pytest.raises(ValueError, match="poisson_ratio"):
        pressed(empty, "taylor-hood")


def test_large_strain_follows_a_region():
    tissue = HeterogeneousTissue(regions=(ball(1e5),))
    body = pressed(tissue)
    small = replace(body, load=1e-4 * body.load)
    state = solve(small, tissue, "neo-hookean").states[-1]
    linear = solve_static(small)
    assert state.displacement == pytest.approx(linear, abs=1e-3 * np.abs(linear).max())


def test_the_element_suits_the_highest_poisson_ratio():
    tissue = HeterogeneousTissue(regions=(ball(E, poisson_ratio=0.499),))
    assert chosen_element("auto", tissue.highest_poisson_ratio) == "taylor-hood"
    assert pressed(tissue, "auto", 0.02).element == "taylor-hood"


# Eshelby ---------------------------------------------------------------------------------------


def test_the_closed_form_is_continuous_and_in_balance():
    found = stiffer(10.0)
    directions = np.random.default_rng(0).normal(size=(40, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    within, beyond = (
        found.displacement(RADIUS * (1.0 + off) * directions) for off in (-1e-9, 1e-9)
    )
    assert within == pytest.approx(beyond, abs=1e-9 * RADIUS)
    mu, lame = (E / 2.9, 2.0 * 0.45 / 0.1 * E / 2.9)
    for point in (directions[0] * 1.5 * RADIUS, directions[1] * 2.0 * RADIUS):
        assert np.abs(_imbalance(found, point, mu, lame)).max() < 1e-4 * mu / RADIUS


def _imbalance(found, x, mu, lame):
    """Navier's equation by central differences [N/m^3]."""
    h = 1e-2 * RADIUS
    steps = h * np.eye(3)
    at = lambda *moves: found.displacement((x + sum(moves))[None])[0]  # noqa: E731
    second = np.empty((3, 3, 3))
    for i, one in enumerate(steps):
        for j, other in enumerate(steps):
            second[i, j] = (
                at(one, other) - at(one, -other) - at(-one, other) + at(-one, -other)
            ) / (4.0 * h**2)
    return mu * np.einsum("iik->k", second) + (lame + mu) * np.einsum("ikk->i", second)


def test_elements_come_nearer_to_eshelbys_ball_as_they_shrink():
    coarse, fine = (ball_inclusion.error("p2", 0.3, 10.0, count) for count in (4, 7))
    assert fine < 0.75 * coarse
    assert fine < 0.25
    assert ball_inclusion.error("p1", 0.3, 1.0, 3) < 1e-12


@pytest.mark.parametrize("nu", [0.25, 0.45])
def test_lattices_come_nearer_to_eshelbys_ball_as_they_shrink(nu):
    coarse, fine = (in_a_lattice(stiffer(10.0, nu), count) for count in (7, 15))
    assert fine < 0.7 * coarse
    assert fine < 0.1


def test_a_ball_a_thousand_times_as_stiff_is_nearly_rigid_in_a_lattice():
    """A tenth off from two cells a radius on: where a cell is nearly full, its sampling tells."""
    assert in_a_lattice(stiffer(1000.0), 10) < 0.15


def test_a_lattice_holds_a_ball_like_its_surroundings_exactly():
    assert in_a_lattice(stiffer(1.0), 7) < 1e-9


def test_a_mean_of_stiffness_would_make_a_stiff_ball_larger(monkeypatch):
    """What cut cells have is seen: Voigt's mean in its place is caught."""
    from study.problem import heterogeneous

    def voigt(self, around, *, one_ratio=False):
        del one_ratio
        mean = self.around * around.youngs_modulus
        mean = mean + self.share[:, 0] * self.tissue.regions[0].youngs_modulus
        nu = around.poisson_ratio
        return heterogeneous.Moduli(
            mean * nu / (1.0 + nu) / (1.0 - 2.0 * nu), mean / (2.0 + 2.0 * nu)
        )

    good = in_a_lattice(stiffer(10.0), 12)
    monkeypatch.setattr(heterogeneous.Composition, "moduli", voigt)
    assert in_a_lattice(stiffer(10.0), 12) > 2.5 * good


# Springs ---------------------------------------------------------------------------------------


def scene_assembly(tissue, lattice="lattice"):
    from study.models.lattice_assembly import assembled
    from study.scene.file import read_scene
    from study.scene.problem import problem_of

    scene = read_scene("block", ('organ.size=["40 mm", "40 mm", "40 mm"]',))
    problem = replace(problem_of(scene), tissue=tissue)
    return assembled(problem, replace(scene.lattice, springs=lattice))


@pytest.mark.parametrize("springs", ["lattice", "tetrahedra"])
def test_springs_of_a_region_are_stiffer_and_those_around_stay(springs):
    tissue = HeterogeneousTissue(regions=(ball(1e5, 0.012, density=2000.0),))
    plain = scene_assembly(tissue, springs)
    material = elastic(plain.lattice, E, 0.25)
    found, _ = of_tissue(plain, material, E)
    ratio = found.springs.weight / plain.springs.weight
    assert ratio.min() == pytest.approx(1.0)
    assert ratio.max() <= 1e5 / E + 1e-9
    extra = 1000.0 * 4.0 / 3.0 * np.pi * 0.012**3 * (2000.0 - tissue.density) / 1000.0
    assert plain.mass.sum() - scene_assembly(Tissue(), springs).mass.sum() == pytest.approx(
        extra, rel=0.05
    )
    assert critical_time_step(found, material) < critical_time_step(plain, material)


def test_an_estimate_tunes_the_tissue_around_alone():
    plain = scene_assembly(HeterogeneousTissue(regions=(ball(1e5, 1.0),)))
    weights = [
        of_tissue(plain, elastic(plain.lattice, own, 0.25), own)[0].springs.weight * own
        for own in (5e3, 2e4)
    ]
    assert weights[0] == pytest.approx(weights[1])  # all of it is inclusion


def test_at_large_strain_a_pressure_of_its_own_follows_an_inclusion():
    """Both kinds of elements differ by what the mesh costs them, the ball far more."""
    tissue = HeterogeneousTissue(youngs_modulus=E, poisson_ratio=0.4, regions=(ball(10.0 * E),))
    p2, mixed = (
        solve(pressed(tissue, element), tissue).states[0].displacement
        for element in ("p2", "taylor-hood")
    )
    around = Tissue(youngs_modulus=E, poisson_ratio=0.4)
    without = solve(pressed(around), around).states[0].displacement
    size = np.linalg.norm(p2)
    assert np.linalg.norm(mixed - p2) < 0.02 * size
    assert np.linalg.norm(without - p2) > 0.1 * size
