"""What the reference saves, and that it is no accuracy: integrals, Ritz vectors, matrices kept."""

import dataclasses

import numpy as np
import pytest
import skfem
from scipy.sparse import csr_array

from fem_reference import iterative as iterative_module
from fem_reference import model as fem
from fem_reference import solvers, subspace
from fem_reference.direct import factorised
from fem_reference.elasticity import Body, Outline, discretise, of_tissue
from fem_reference.forms import gradients, pattern, products
from fem_reference.grid import curved, mapping, straight
from fem_reference.observation import carried
from fem_reference.solvers import solve_static
from fem_reference.subspace import ritz_subspace
from study.models import finite_elements as reference
from study.models.model import SILENT
from study.organ.block import block_mesh
from study.problem.damping import RayleighDamping
from study.problem.tissue import Tissue
from study.scene import Reference
from study.scene.problem import problem_of
from tests.test_limits import changed

DAMPING = RayleighDamping(mass=40.0, stiffness=4e-3)
COUNT = 16


def relative(found, exact):
    return np.linalg.norm(found - exact) / np.linalg.norm(exact)


def ramp(times):
    return np.minimum(np.asarray(times) / 0.2, 1.0)


@pytest.fixture(scope="module")
def where(small_posed):
    return small_posed.foundation, small_posed.tool


@pytest.fixture(scope="module")
def meshes(small_posed):
    return [small_posed.geometry.level(k).mesh for k in (-2, -1)]


@pytest.fixture(scope="module")
def bodies(meshes, where):
    """The same organ, coarse and fine."""
    return [discretise(mesh, Tissue(), *where) for mesh in meshes]


# --- integrals ---------------------------------------------------------------------------------


@pytest.fixture(scope="module", params=["straight", "curved"])
def basis(request):
    mesh = block_mesh((0.06, 0.04, 0.03), 0.015)
    grid = straight(mesh)
    if request.param == "curved":
        grid = curved(mesh, lambda x: x * (1.0 + 1e-3 * np.sin(90.0 * x[:, [1, 2, 0]])))
    return skfem.Basis(grid, skfem.ElementTetP2(), mapping(grid), intorder=4)


def same(found, form, basis):
    expected = csr_array(skfem.BilinearForm(form).assemble(basis))
    return abs(found - expected).max() < 1e-13 * abs(expected).max()


def test_integrals_are_those_of_scikit_fems_forms(basis):
    where, shape = pattern(basis), (basis.N, basis.N)
    assert same(products(basis, where), lambda u, v, _: u * v, basis)
    found = gradients(basis, where)
    for i, j in np.ndindex(3, 3):
        part = csr_array((found.values[:, i, j], found.indices, found.indptr), shape=shape)
        assert same(part, lambda u, v, _, i=i, j=j: v.grad[i] * u.grad[j], basis)
        if i != j:  # negative control
            assert not same(part.T, lambda u, v, _, i=i, j=j: v.grad[i] * u.grad[j], basis)


@pytest.mark.parametrize(
    ("element", "nu", "other"),
    [
        ("auto", 0.45, 0.25),
        ("auto", 0.499, 0.25),
        ("auto", 0.25, 0.499),
        ("taylor-hood", 0.49, 0.3),
        ("p1", 0.3, 0.1),
    ],
)
def test_other_elastic_constants_are_those_of_a_body_assembled_for_them(
    element, nu, other, meshes, where
):
    tissue = Tissue(poisson_ratio=other, youngs_modulus=3e3)
    one = discretise(meshes[0], Tissue(poisson_ratio=nu), *where, element)
    found, afresh = of_tissue(one, tissue, element), discretise(meshes[0], tissue, *where, element)
    scale = abs(afresh.stiffness.system()).max()
    assert found.element == afresh.element
    assert abs(found.stiffness.system() - afresh.stiffness.system()).max() < 1e-14 * scale
    assert abs(one.stiffness.matrix - afresh.stiffness.matrix).max() > 1e-2 * scale


def test_elements_with_other_nodes_are_refused(bodies):
    with pytest.raises(ValueError, match="p1 has other nodes than p2"):
        of_tissue(bodies[0], Tissue(), "p1")


# --- Ritz vectors ------------------------------------------------------------------------------


@pytest.fixture
def iterations(monkeypatch):
    """Applications of the preconditioner, of bodies that are all solved by iterations."""
    calls, make = [], iterative_module.preconditioner

    def counting(of):
        inner = make(of)
        return lambda r: (calls.append(1), inner(r))[1]

    monkeypatch.setattr(solvers, "FACTORED_BELOW", 0)
    monkeypatch.setattr(iterative_module, "preconditioner", counting)
    return calls


def near(bodies):
    coarse, fine = bodies
    return carried(ritz_subspace(coarse, COUNT).vectors, coarse, fine)


def vectors(body, given=None):
    growing = subspace.ritz_subspaces(body, given)
    return [next(growing) for _ in range(COUNT)][-1]


def test_vectors_of_a_coarser_mesh_save_iterations(bodies, iterations):
    given, fine = near(bodies), bodies[1]
    counts = []
    for start in (None, given, np.random.default_rng(1).standard_normal(given.shape)):
        iterations.clear()
        vectors(fine, start)
        counts.append(len(iterations))
    alone, helped, misled = counts
    assert helped < 0.9 * alone
    assert misled > 0.98 * alone  # negative control


def curves(body, observation):
    found = fem.run(body, DAMPING, ramp, observation)
    return found.trajectory, found.superposed.truncation_error


def worst(found, exact):
    """Largest relative L2 difference of a curve."""
    pairs = (
        (getattr(one, kind) for one in (found, exact)) for kind in ("displacement", "velocity")
    )
    return max(relative(a[:, i], b[:, i]) for a, b in pairs for i in range(a.shape[1]))


def test_loose_vectors_change_no_curve_by_what_is_said_of_the_subspace(
    bodies, small_posed, monkeypatch
):
    """The stated part of the subspace covers what its vectors are solved to."""
    observation, fine = small_posed.observation, bodies[1]
    exact, stated = curves(fine, observation)
    monkeypatch.setattr(solvers, "FACTORED_BELOW", 0)
    loose, also = curves(fine, observation)
    assert 0.0 < worst(loose, exact) < 0.3 * min(stated, also)
    monkeypatch.setattr(subspace, "LOOSE", 0.2)
    assert worst(curves(fine, observation)[0], exact) > min(stated, also)  # negative control


def test_the_first_vector_is_exact_however_it_was_sought(bodies, monkeypatch):
    given, fine = near(bodies), bodies[1]
    exact = factorised(fine.stiffness.matrix)(fine.load)
    monkeypatch.setattr(solvers, "FACTORED_BELOW", 0)
    assert relative(vectors(fine, given).rest(), exact) < 1e-8
    assert relative(solve_static(fine, start=given[:, 0]), exact) < 1e-8


# --- what is kept ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def prepared(small_scene):
    scene = dataclasses.replace(
        changed(small_scene, time={"samples": 21}), reference=Reference(element_size=0.015)
    )
    return reference.reference_of(scene).prepare(problem_of(scene))


@pytest.fixture(scope="module")
def solved(prepared):
    found, _ = prepared._solve(prepared._solve_coarsest(SILENT.progress)[0], SILENT.progress)
    return found


def test_only_the_finest_mesh_keeps_its_matrices(solved):
    *coarser, finest = solved
    assert all(isinstance(one.body, Outline) for one in coarser)
    assert isinstance(finest.body, Body)
    sizes = [one.body.unknowns for one in solved]
    assert sizes == sorted(sizes)


def test_rest_at_another_poisson_ratio_is_that_of_a_body_assembled_for_it(prepared):
    fresh = prepared.rest_at(0.25)
    prepared.run(SILENT)
    found = prepared.rest_at(0.25)
    tissue = dataclasses.replace(prepared.problem.tissue, poisson_ratio=0.25)
    other = dataclasses.replace(prepared.problem, tissue=tissue)
    assert relative(fresh, prepared.model.prepare(other).rest()) < 1e-9
    assert relative(found, prepared.rest()) > 1e-2
