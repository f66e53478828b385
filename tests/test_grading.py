"""Meshes refined where the error is: nested, well shaped, and finer where it comes from."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from fem_reference.elasticity import discretise
from fem_reference.error_estimate import SAFETY_ASSUMED, SAFETY_GRADED, graded_error
from fem_reference.external_loads import ExternalLoads, with_external_loads
from fem_reference.recovery import energy_products, goal_errors, recovered
from fem_reference.solvers import solve_static, solver
from study.mesh.bisection import bisected, cut_into
from study.mesh.kinds import TetrahedralMesh
from study.mesh.locate import locate
from study.mesh.tetrahedra import FACES, refined, smallest_dihedral_angle, volumes
from study.models import finite_elements
from study.models.finite_elements import reference_of
from study.models.grading import GROWTHS, growth_for, next_graded, probe_errors
from study.models.model import SILENT
from study.organ.block import block_mesh
from study.organ.geometry import Level
from study.organ.grading import equidistributed
from study.problem.contact import Foundation, ToolPatch, Weight
from study.problem.heterogeneous import Ellipsoid, HeterogeneousTissue, Region
from study.problem.supports import FixedSurface
from study.problem.tissue import Tissue
from study.scene.file import read_scene
from study.scene.problem import problem_of
from study.system.progress import Silent
from tests.mesh_samples import cube, write_tetrahedra

BLOCK = block_mesh((0.08, 0.06, 0.04), 0.02)


def uniform(problem, count):
    """The coarsest mesh of a problem and its refinements into eight."""
    meshes = [problem.geometry.level(-2).mesh]
    while len(meshes) < count:
        meshes.append(refined(meshes[-1]))
    return meshes


def near(mesh, place, distance):
    centre = mesh.points[mesh.tetrahedra].mean(axis=1)
    return np.linalg.norm(centre - place, axis=1) < distance


def is_conforming(mesh):
    """Every face that is not on the box belongs to two tetrahedra."""
    faces = np.sort(mesh.tetrahedra[:, FACES].reshape(-1, 3), axis=1)
    single, count = np.unique(faces, axis=0, return_counts=True)
    assert count.max() == 2
    outer = mesh.points[single[count == 1]]
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    flat = (np.isclose(outer, low, atol=1e-12) | np.isclose(outer, high, atol=1e-12)).all(axis=1)
    return bool(flat.any(axis=1).all())


# --- bisection ---------------------------------------------------------------------------------


def test_bisected_tetrahedra_lie_in_their_parents_and_fill_them():
    corner = BLOCK.points.min(axis=0)
    found = bisected(BLOCK, near(BLOCK, corner, 0.03))
    assert is_conforming(found.mesh)
    np.testing.assert_array_equal(found.mesh.points[: len(BLOCK.points)], BLOCK.points)
    inside = volumes(found.mesh)
    assert inside.min() > 0
    sums = np.bincount(found.parents, inside)
    np.testing.assert_allclose(sums, volumes(BLOCK), rtol=1e-12)
    parent = BLOCK.points[BLOCK.tetrahedra[found.parents]]
    edges = np.swapaxes(parent[:, 1:] - parent[:, :1], 1, 2)
    for vertex in found.mesh.tetrahedra.T:
        offset = found.mesh.points[vertex] - parent[:, 0]
        local = np.linalg.solve(edges, offset[:, :, None])[..., 0]
        assert local.min() > -1e-9
        assert local.sum(axis=1).max() < 1.0 + 1e-9


def test_repeated_bisection_keeps_the_shapes():
    mesh, worst = BLOCK, smallest_dihedral_angle(BLOCK).min()
    corner = mesh.points.min(axis=0)
    for level in range(15):
        mesh = bisected(mesh, near(mesh, corner, 0.05 * 0.75**level)).mesh
    assert volumes(mesh).min() < 1e-4 * volumes(BLOCK).min()
    assert smallest_dihedral_angle(mesh).min() > 0.5 * worst
    assert is_conforming(mesh)


def test_nothing_marked_is_the_same_mesh_and_one_marked_is_cut():
    none = bisected(BLOCK, np.zeros(len(BLOCK.tetrahedra), dtype=bool))
    np.testing.assert_array_equal(none.mesh.tetrahedra, BLOCK.tetrahedra)
    mark = np.arange(len(BLOCK.tetrahedra)) == 7
    assert (bisected(BLOCK, mark).parents == 7).sum() >= 2


def test_parts_are_at_least_what_was_asked():
    parts = np.where(near(BLOCK, BLOCK.points.min(axis=0), 0.03), 10.0, 1.0)
    found = cut_into(BLOCK, parts)
    assert (volumes(found.mesh) <= (volumes(BLOCK) / parts)[found.parents] * (1 + 1e-6)).all()
    assert (np.bincount(found.parents)[parts > 1] >= 10).all()


def test_errors_are_shared_out_at_the_number_asked_for():
    mesh = block_mesh((0.08, 0.06, 0.04), 0.01)
    centre = mesh.points[mesh.tetrahedra].mean(axis=1)
    errors = np.exp(-np.linalg.norm(centre - mesh.points.min(axis=0), axis=1) / 0.01)
    count = len(mesh.tetrahedra)
    for more in (count, 3 * count):
        found = equidistributed(mesh, errors, 4.0, more)
        assert len(found.mesh.tetrahedra) - count == pytest.approx(more, rel=0.1)
        parts = np.bincount(found.parents)
        assert parts[errors.argmax()] > 4 * parts[errors.argmin()]


# --- the estimate ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def pressed():
    """A small block, its problem and a body on its coarsest mesh."""
    scene = read_scene("block", ["reference.element_size=20 mm", 'models=["fem"]'])
    problem = problem_of(scene)
    return scene, problem, reference_of(scene).prepare(problem)


def test_the_recovered_strain_of_a_quadratic_field_is_its_own(pressed):
    """A strain that the shape functions hold is without error, and one they do not hold is not."""
    _, problem, prepared = pressed
    body = prepared.body(problem.geometry.level(-2))
    x, y, z = body.points.T
    smooth = np.stack([x * y, y * z, x * x], axis=1).ravel()
    found = recovered(body, smooth)
    assert np.abs(found.error).max() < 2e-3 * np.abs(found.strain).max()
    rough = np.stack([np.abs(x - 0.02) ** 1.5, 0 * x, 0 * x], axis=1).ravel()
    other = recovered(body, rough)
    assert np.abs(other.error).max() > 2e-2 * np.abs(other.strain).max()


@pytest.mark.parametrize("case", ["fixed", "denser inclusion", "weight"])
def test_a_uniform_strain_is_recovered_whatever_the_mass(case):
    """The projection is that of the shape functions; constraints and masses are no part of it."""
    top, down = np.array([0.02, 0.02, 0.04]), np.array([0.0, 0.0, -1.0])
    base = Foundation(down, 0.0, 1e-3, 1e6)
    inside = Ellipsoid(np.full(3, 0.02), np.full(3, 0.01))
    ball = Region(name="ball", distance=inside, youngs_modulus=4e3, density=5000.0)
    tissue = HeterogeneousTissue(regions=(ball,)) if case == "denser inclusion" else Tissue()
    support = FixedSurface(base, np.ones(3, dtype=bool)) if case == "fixed" else base
    patch = ToolPatch(top, down, 0.02, 0.0)
    body = discretise(block_mesh((0.04,) * 3, 0.01), tissue, support, patch, "p2")
    if case == "weight":
        body = with_external_loads(body, ExternalLoads(weights=(Weight(patch, 0.05),)))
    gradient = np.array([[0.01, 0.02, 0.0], [0.0, -0.01, 0.03], [0.01, 0.0, 0.02]])
    found = recovered(body, (body.points @ gradient.T).ravel())
    assert np.abs(found.error).max() < 1e-3 * np.abs(found.strain).max()


def test_the_effectivity_of_the_estimated_energy_is_steady(pressed):
    """Of nested meshes, whose energies differ from that of a fine one by that of their errors.

    It comes out too small, by much the same factor on each, and so serves to tell cells apart.
    """
    scene, problem, prepared = pressed
    bodies = [prepared.body(Level(mesh, 1.0)) for mesh in uniform(problem, 3)]
    solved = [solve_static(body) for body in bodies]
    exact = float(bodies[-1].load @ solved[-1])
    found = []
    for body, u in zip(bodies[:-1], solved[:-1], strict=True):
        error = recovered(body, u).error
        stated = energy_products(body, scene.tissue, error, error).sum()
        found.append(np.sqrt(stated / (exact - float(body.load @ u))))
    assert 0.3 < min(found) <= max(found) < 1.2
    assert max(found) < 2.0 * min(found)


def test_marking_goes_where_a_singularity_was_planted(pressed):
    """A goal at a corner of the block, far from the tool, and a tool too small for its mesh."""
    scene, problem, prepared = pressed
    level = problem.geometry.level(0)
    body = prepared.body(level)
    u = solve_static(body)
    top = body.points.max(axis=0)
    goal = np.zeros_like(u)
    goal[3 * np.linalg.norm(body.points - top, axis=1).argmin()] = 1.0
    errors = goal_errors(body, scene.tissue, solver(body), u, [goal])
    assert errors.sum() > 0
    centre = level.mesh.points[level.mesh.tetrahedra].mean(axis=1)
    assert np.linalg.norm(centre[errors.argmax()] - top) < 0.03
    far = np.linalg.norm(centre - top, axis=1) > 0.06
    assert errors[far].mean() < 0.2 * errors[~far].mean()


def test_graded_levels_are_nested_and_finer_at_the_control_points(pressed):
    _, problem, prepared = pressed
    level = problem.geometry.level(-2)
    finer = next_graded(problem, level, prepared.body(level))
    assert 1.5 * len(level.mesh.tetrahedra) < len(finer.mesh.tetrahedra)
    assert finer.size < level.size
    old = len(level.mesh.points)
    np.testing.assert_array_equal(finer.mesh.points[:old], level.mesh.points)
    centre = finer.mesh.points[finer.mesh.tetrahedra].mean(axis=1)
    within = locate(level.mesh, centre)[1]
    assert within.min() > -1e-9
    size = volumes(finer.mesh)
    probe = problem.observation.probes[problem.tool_probe]
    assert size[np.linalg.norm(centre - probe, axis=1) < 0.02].mean() < 0.7 * size.mean()


def test_graded_levels_come_out_the_same_again(pressed):
    _, problem, prepared = pressed
    level = problem.geometry.level(-2)
    one, other = (next_graded(problem, level, prepared.body(level)) for _ in range(2))
    assert one.mesh.points.tobytes() == other.mesh.points.tobytes()
    assert one.mesh.tetrahedra.tobytes() == other.mesh.tetrahedra.tobytes()
    assert prepared.model.reference.refinement == "auto"
    reference = dataclasses.replace(prepared.model.reference, refinement="graded")
    again = dataclasses.replace(prepared.model, reference=reference).prepare(problem)
    first, last = len(level.mesh.tetrahedra), len(one.mesh.tetrahedra)
    found = again.level_of((first, last), Silent())
    assert found.mesh.tetrahedra.tobytes() == one.mesh.tetrahedra.tobytes()
    assert again.level_of((first, last + 1), Silent()) is None
    assert again.level_of((first + 1, last), Silent()) is None
    small = next_graded(problem, level, prepared.body(level), GROWTHS[0])
    assert len(small.mesh.tetrahedra) < last
    found = again.level_of((first, len(small.mesh.tetrahedra)), Silent())
    assert found.mesh.tetrahedra.tobytes() == small.mesh.tetrahedra.tobytes()


@pytest.mark.parametrize(
    ("excess", "growth"),
    [(0.5, GROWTHS[0]), (1.59, GROWTHS[0]), (1.61, GROWTHS[1]), (2.3, GROWTHS[2]), (9.0, 4.0)],
)
def test_a_mesh_grows_as_its_error_requires(excess, growth):
    assert growth_for(excess) == growth
    assert growth_for(np.inf) == GROWTHS[-1]


def test_a_mesh_is_no_larger_than_the_accuracy_requires(pressed, monkeypatch):
    """Four times the elements while the error is large or unknown, fewer when it is close."""
    prepared = pressed[2]
    reference = dataclasses.replace(prepared.model.reference, refinement="graded", accuracy=0.01)
    prepared = dataclasses.replace(prepared.model, reference=reference).prepare(pressed[1])
    solution = SimpleNamespace(level=None, found=SimpleNamespace(elements=10**6))
    worst, growths = iter([0.2, 0.021, 0.012, 0.009]), []
    monkeypatch.setattr(prepared, "_body_of", lambda _: None)
    monkeypatch.setattr(prepared, "refined", lambda *given: growths.append(given[2]) or given)
    monkeypatch.setattr(prepared, "_refine", lambda solved, *_: solved.append(solution))
    monkeypatch.setattr(finite_elements, "locks", lambda *_: False)
    monkeypatch.setattr(
        finite_elements,
        "mesh_error",
        lambda *_, **__: SimpleNamespace(worst=SimpleNamespace(displacement=next(worst))),
    )
    solved, error = prepared._solve_graded(solution, Silent())
    assert growths == [GROWTHS[2], GROWTHS[2], GROWTHS[1], GROWTHS[0]]
    assert (len(solved), error.worst.displacement) == (5, 0.009)


def test_a_control_point_at_rest_has_no_share(pressed):
    _, problem, prepared = pressed
    body = prepared.body(problem.geometry.level(-2))
    assert probe_errors(problem, body).min() >= 0.0


# --- the stated error --------------------------------------------------------------------------


def test_a_sequence_of_the_order_taken_has_its_error_with_the_safety_factor():
    sizes = [1.0, 0.7, 0.5]
    results = [np.full((4, 3), 1.0 + 0.1 * h**2) for h in sizes]
    found = graded_error(results, sizes, 2.0)
    true = 0.1 * 0.25 / (1.0 + 0.1 * 0.25)
    assert found.error == pytest.approx(SAFETY_GRADED * true, rel=1e-6)
    two = graded_error(results[1:], sizes[1:], 2.0)
    assert two.error == pytest.approx(SAFETY_ASSUMED * true, rel=1e-6)


def test_a_change_that_is_small_by_chance_does_not_count():
    sizes = [1.0, 0.7, 0.5]
    same_twice = [np.full((4, 3), value) for value in (1.1, 1.0, 1.0)]
    assert graded_error(same_twice, sizes, 2.0).error > 0.02


def test_the_stated_error_holds_against_a_much_finer_mesh(tmp_path):
    """Of a user's tetrahedra, which are graded unless the scene says otherwise."""
    points, tetrahedra = cube(2)
    path = write_tetrahedra(tmp_path / "cube.vtu", 0.08 * points, tetrahedra)
    given = [f"organ.mesh={path}", "organ.unit=m", "tool.radius=20 mm", 'models=["fem"]']
    scene = read_scene("block", [*given, "reference.element_size=40 mm"])
    prepared = reference_of(scene).prepare(problem_of(scene))
    run = prepared.run(SILENT)
    elements = run.record.elements
    assert len(elements.levels) == 3
    assert [one.size for one in elements.levels] == sorted(
        (one.size for one in elements.levels), reverse=True
    )
    level = prepared.refined(prepared.best.level, prepared.best.body)
    fine = prepared.solved_on(level, Silent()).found.trajectory.displacement
    coarse = run.trajectory.displacement
    for i, stated in enumerate(elements.mesh_error.by_probe.values()):
        true = np.linalg.norm(coarse[:, i] - fine[:, i]) / np.linalg.norm(fine[:, i])
        assert true < stated.displacement < 50 * true


def test_a_mesh_is_the_same_where_nothing_is_wrong():
    mesh = TetrahedralMesh(*cube(1))
    found = equidistributed(mesh, np.zeros(len(mesh.tetrahedra)), 4.0, 0)
    assert len(found.mesh.tetrahedra) == len(mesh.tetrahedra)
