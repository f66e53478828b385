"""Compiled products of block matrices, and the cycle of multigrid made of them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import bsr_array, csc_array

from fem_reference.blocks import blocks_of, symmetric
from fem_reference.elasticity import discretise
from fem_reference.iterative import _from_vertices, _on_vertices, iterative
from fem_reference.multigrid import multigrid
from fem_reference.stiffness import Stiffness
from study.problem.tissue import Tissue


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


def test_half_of_a_symmetric_matrix_is_enough(body, rng):
    matrix, x = body.stiffness.matrix, rng.normal(size=body.stiffness.size)
    assert near(symmetric(matrix) @ x, matrix @ x)
    assert near(abs(symmetric(matrix)) @ x, abs(matrix) @ x)
    rounded = symmetric(matrix).single @ x
    assert 1e-10 < np.linalg.norm(rounded - matrix @ x) / np.linalg.norm(matrix @ x) < 1e-7
    skew = matrix.copy()
    skew.data[symmetric(matrix).upper.first[1] - 1] *= 2.0  # negative control, below the diagonal
    assert near(symmetric(skew) @ x, matrix @ x)
    assert not near(symmetric(skew) @ x, skew @ x)


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
