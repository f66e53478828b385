"""Conjugate gradients on two levels of elements, and for mixed elements minimal residuals.

Quadratic elements are preconditioned by a solution with linear elements on the same mesh, an eighth
of the unknowns, added to that of every node alone: the iterations do not grow as the mesh is
refined. The linear elements are solved by factors, or, when they are many, by a cycle of algebraic
multigrid. The iterations go by a matrix in single precision, half of what is read, and what this
leaves of a residual is iterated on again.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array
from scipy.sparse.linalg import LinearOperator, cg, minres

from fem_reference.blocks import Blocks, SymmetricBlocks, blocks_of, diagonal_of, symmetric
from fem_reference.direct import IMBALANCE, Solve, factorised
from fem_reference.elasticity import Body
from fem_reference.elements import ELEMENTS
from fem_reference.multigrid import multigrid

Floats = NDArray[np.float64]

MAX_ITERATIONS = 3000
REFINEMENTS = 6
STRICTER = {cg: 0.5, minres: 1e-6}
"""Minimal residuals stop by a residual relative to the matrix's norm times the solution's."""
GUIDED, LED = 1e-4, 0.1
"""Residual to which a matrix in single precision is followed at once, and at which it is left."""
ROUNDING = 1e-15
"""Of the sum of magnitudes that make up a residual."""
FACTORED_BELOW = 6_000
"""Linear unknowns that are solved by factors as fast as by a cycle."""
SHARE = 0.7
"""Of the solution of every node alone: the sum with that of linear elements overshoots."""


class Solver(Protocol):
    """Solution of K u = f for loads f [N] (n,), however many."""

    def __call__(
        self, load: Floats, tolerance: float | None = None, start: Floats | None = None
    ) -> Floats:
        """Displacement [m] (n,) to a residual of `tolerance` times the load, from a `start`."""


def preconditioner(body: Body) -> Solve:
    """Approximate inverse of the displacements' part of the stiffness, symmetric and positive."""
    matrix = body.stiffness.matrix.tobsr(blocksize=(3, 3))
    if not ELEMENTS[body.element].quadratic:
        return _linear_level(matrix, body.points)
    prolong = _from_vertices(body.nodes.mesh, body.node_count)
    coarse = _linear_level(_on_vertices(matrix, prolong), body.points[: prolong.shape[1]])
    restrict, alone = csr_array(prolong.T), _of_nodes_alone(matrix)

    def both(residual: Floats) -> Floats:
        found = coarse((restrict @ residual.reshape(-1, 3)).ravel())
        found = np.asarray(prolong @ found.reshape(-1, 3)).ravel()
        alone.add_product(residual, found)
        return found

    return both


def _on_vertices(matrix: bsr_array, prolong: csr_array) -> bsr_array:
    """The matrix of linear elements, as quadratic ones that are linear."""
    blocks = prolong.data[:, None, None] * np.eye(3)
    shape = (3 * prolong.shape[0], 3 * prolong.shape[1])
    by_node = bsr_array((blocks, prolong.indices, prolong.indptr), shape=shape)
    return by_node.T @ matrix @ by_node


def _of_nodes_alone(matrix: bsr_array) -> Blocks:
    """A share of the inverses of the diagonal blocks."""
    whole = blocks_of(matrix)
    inverses = SHARE * np.linalg.inv(whole.data[diagonal_of(whole)])
    places = np.arange(len(inverses) + 1, dtype=np.int32)
    return Blocks(places[:-1], places[1:], places[:-1], inverses.astype(np.float32))


def _from_vertices(mesh: Any, nodes: int) -> csr_array:
    """Matrix from values at vertices to values at all nodes: edge nodes take the mean."""
    count, ends = int(mesh.nvertices), mesh.edges
    edges = count + np.arange(ends.shape[1])
    rows = np.concatenate([np.arange(count), edges, edges])
    columns = np.concatenate([np.arange(count), ends[0], ends[1]])
    values = np.concatenate([np.ones(count), np.full(2 * ends.shape[1], 0.5)])
    return csr_array((values, (rows, columns)), shape=(nodes, count))


def _linear_level(matrix: bsr_array, points: Floats) -> Solve:
    if matrix.shape[0] < FACTORED_BELOW:
        return factorised(matrix)
    return multigrid(matrix, points)


def iterative(body: Body, tolerance: float) -> Solver:
    """Solution of K u = f to a residual of `tolerance` times f, where no other is asked for.

    ValueError if it is not reached: nothing holds the body, or the elements are nearly flat.
    """
    inner, pressure = preconditioner(body), body.stiffness.pressure
    if pressure is None:
        matrix = body.stiffness.blocks
        return _solver(cg, matrix, inner, tolerance, guide=symmetric(matrix))
    schur = factorised(pressure.schur)
    whole, size = csr_array(body.stiffness.system()), body.stiffness.size

    def both(residual: Floats) -> Floats:
        return np.concatenate([inner(residual[:size]), schur(residual[size:])])

    return _solver(minres, whole, both, tolerance, size)


def _solver(
    method: Any,
    matrix: Any,
    inner: Solve,
    usual: float,
    size: int | None = None,
    guide: Any = None,
) -> Solver:
    """Of the first `size` unknowns, the others being those of a pressure and without load."""

    def padded(values: Floats) -> Floats:
        return np.concatenate([values, np.zeros(matrix.shape[0] - len(values))])

    def solve(load: Floats, tolerance: float | None = None, start: Floats | None = None) -> Floats:
        wanted = usual if tolerance is None else tolerance
        first = None if start is None else padded(start)
        return _refined(method, matrix, inner, padded(load), wanted, first, guide)[:size]

    return solve


def _refined(
    method: Any,
    matrix: Any,
    inner: Solve,
    load: Floats,
    tolerance: float,
    start: Floats | None = None,
    guide: Any = None,
) -> Floats:
    """Iterate again on what is left, as minimal residuals stop by a norm of their own.

    With a `guide`, a matrix near to the other that takes less time, until it leads no further.
    """
    found = np.zeros_like(load) if start is None else start
    left, scale = load - matrix @ found, float(np.linalg.norm(load))
    rough = matrix if guide is None else guide
    for _ in range(REFINEMENTS):
        size = float(np.linalg.norm(left))
        if size <= tolerance * scale or size <= _rounding(rough, found, size, scale):
            return found
        least = ROUNDING if guide is None else GUIDED
        wanted = max(STRICTER[method] * tolerance * scale / size, least)
        with np.errstate(all="ignore"):  # a singular matrix may end in 0 / 0, as the residual tells
            more = _iterated(method, matrix if guide is None else guide, inner, left, wanted)
        better = load - matrix @ (found + more)
        if guide is not None and not np.linalg.norm(better) < LED * size:
            guide = None
            continue
        found, left = found + more, better
        if not np.isfinite(left).all():
            break
    raise ValueError(
        "the finite elements find no rest: the support does not hold the body, or a tetrahedron is "
        "nearly flat; enlarge support.depth, raise support.stiffness, or repair organ.mesh"
    )


def _iterated(method: Any, matrix: Any, inner: Solve, right: Floats, tolerance: float) -> Floats:
    product, better = (
        LinearOperator(matrix.shape, matvec=one, dtype=np.float64)
        for one in (matrix.__matmul__, inner)
    )
    found, _ = method(product, right, M=better, rtol=tolerance, maxiter=MAX_ITERATIONS)
    return np.asarray(found)


def _rounding(matrix: Any, found: Floats, size: float, scale: float) -> float:
    """How much of a residual is rounding, which no iteration reduces.

    That is no excuse for an imbalance that no answer has: in a nearly singular matrix it would
    excuse anything.
    """
    if size > IMBALANCE * scale:
        return 0.0
    by_blocks = isinstance(matrix, Blocks | SymmetricBlocks)
    whole = matrix.magnitudes(found) if by_blocks else abs(matrix) @ np.abs(found)
    return ROUNDING * float(np.linalg.norm(whole))
