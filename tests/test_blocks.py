"""Compiled products of block matrices, and the cycle of multigrid made of them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import bsr_array, csc_array

from fem_reference import blocks
from fem_reference.blocks import blocks_of, symmetric
from fem_reference.elasticity import discretise
from fem_reference.iterative import _from_vertices, _on_vertices, iterative
from fem_reference.multigrid import multigrid
from fem_reference.stiffness import Stiffness
from study.problem.tissue import Tissue
from study.stages import threads as own_threads
from study.stages.threads import threads


def near(found, expected):
    return np.linalg.norm(found - expected) < 1e-14 * np.linalg.norm(expected)


@pytest.fixture(scope="module")
def body(small_posed):
    where = small_posed.foundation, small_posed.tool
    return discretise(small_posed.geometry.level(-1).mesh, Tissue(poisson_ratio=0.45), *where)


@pytest.mark.parametrize(("rows", "columns"), [(3, 3), (3, 6), (6, 3), (6, 6)])
def test_a_product_is_that_of_scipy_whatever_the_blocks(rows, columns, rng):
    indptr, indices = np.array([0, 2, 2, 4]), np.array([3, 0, 1, 2])  # not in order
    data = rng.normal(size=(4, rows, columns))
    matrix = bsr_array((data, indices, indptr), shape=(3 * rows, 4 * columns))
    x, total = rng.normal(size=4 * columns), rng.normal(size=3 * rows)
    expected = total - 0.5 * (matrix @ x)
    assert near(blocks_of(matrix.copy()) @ x, matrix @ x)
    blocks_of(matrix.copy()).add_product(x, total, -0.5)
    assert near(total, expected)


def test_blocks_that_are_not_of_threes_are_refused():
    matrix = bsr_array(np.ones((4, 6)), blocksize=(2, 3))
    with pytest.raises(ValueError, match="3 x 3"):
        blocks_of(matrix)


def test_magnitudes_are_those_of_a_matrix_of_magnitudes(body, rng):
    matrix, x = body.stiffness.matrix, rng.normal(size=body.stiffness.size)
    expected = abs(matrix) @ np.abs(x)
    assert near(blocks_of(matrix).magnitudes(x), expected)
    assert symmetric(blocks_of(matrix)).magnitudes(x) == pytest.approx(expected, rel=1e-6)


def test_half_of_a_symmetric_matrix_in_single_precision_is_enough_to_guide(body, rng):
    matrix, x = body.stiffness.matrix, rng.normal(size=body.stiffness.size)
    half = symmetric(blocks_of(matrix))
    expected = matrix @ x
    assert 1e-10 < np.linalg.norm(half @ x - expected) / np.linalg.norm(expected) < 1e-7
    skew = matrix.copy()
    below = np.flatnonzero(skew.indices[: skew.indptr[-1]] == 0)[1]  # in the first column
    skew.data[below] *= 2.0  # negative control
    assert np.array_equal(symmetric(blocks_of(skew)) @ x, half @ x)
    assert not near(blocks_of(skew) @ x, expected)


def test_two_threads_give_the_bits_of_one(body, rng, monkeypatch):
    matrix, x = body.stiffness.matrix, rng.normal(size=body.stiffness.size)
    monkeypatch.setattr(blocks, "WORTHWHILE", 0)
    monkeypatch.setattr(own_threads, "available", lambda: 2)
    for product in (blocks_of(matrix), symmetric(blocks_of(matrix))):
        alone = product @ x
        with threads(2):
            assert np.array_equal(product @ x, alone)


def test_a_product_in_parts_is_that_in_one(body, rng, monkeypatch):
    matrix, x = body.stiffness.matrix, rng.normal(size=body.stiffness.size)
    whole = blocks_of(matrix) @ x, symmetric(blocks_of(matrix)) @ x
    monkeypatch.setattr(blocks, "WORTHWHILE", 0)
    parted = blocks_of(matrix) @ x, symmetric(blocks_of(matrix)) @ x
    assert np.array_equal(whole[0], parted[0])
    assert near(parted[1], whole[1])  # what two parts add to a row is summed otherwise


def test_a_stiffness_of_another_format_is_solved_alike(body):
    other = replace(body, stiffness=Stiffness(csc_array(body.stiffness.matrix)))
    found, same = (iterative(one, 1e-10)(one.load) for one in (body, other))
    assert np.linalg.norm(found - same) < 1e-9 * np.linalg.norm(found)


def test_a_cycle_is_symmetric_and_takes_most_of_an_error(body, rng):
    prolong = _from_vertices(body.nodes.mesh, body.node_count)
    matrix = _on_vertices(body.stiffness.matrix, prolong)
    cycle = multigrid(matrix, body.points[: prolong.shape[1]])
    f, g = rng.normal(size=(2, matrix.shape[0]))
    assert f @ cycle(g) == pytest.approx(g @ cycle(f), rel=1e-5)  # single precision
    error, sizes = rng.normal(size=matrix.shape[0]), []
    for _ in range(20):
        error -= cycle(matrix @ error)
        sizes.append(np.sqrt(error @ (matrix @ error)))
    assert 0.0 < sizes[-1] < 0.8 * sizes[-2]
