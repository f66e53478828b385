"""Preconditioned conjugate gradients, and minimal residuals (MINRES) for mixed elements.

The preconditioner of quadratic elements is the sum of block Jacobi and of a solution with linear
elements on the same mesh, an eighth of the unknowns. The number of iterations does not grow as the
mesh is refined. The linear elements are solved by factors, or, when they are many, by a cycle of
algebraic multigrid. The iterations use a matrix in single precision, which halves the memory
traffic; iterative refinement recovers double precision.
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
TOLERANCE_FACTOR = {cg: 0.5, minres: 1e-6}
"""Inner over outer tolerance; MINRES stops relative to the norms of matrix times solution."""
SINGLE_TOLERANCE, LEAST_REDUCTION = 1e-4, 0.1
"""Smallest inner tolerance with the matrix in single precision, and the reduction of the residual
without which refinement continues in double precision."""
ROUNDING = 1e-15
"""Rounding of a residual relative to the sum of magnitudes of its terms."""
FACTORED_BELOW = 6_000
"""Unknowns of linear elements below which factors are as fast as a multigrid cycle."""
JACOBI_WEIGHT = 0.7
"""Damping of block Jacobi: undamped, its sum with the coarse solution overshoots."""


class Solver(Protocol):
    """Solver of K u = f for loads f [N] (n,)."""

    def __call__(
        self, load: Floats, tolerance: float | None = None, start: Floats | None = None
    ) -> Floats:
        """Displacement [m] (n,) to a residual of `tolerance` times the load, from `start`."""


def preconditioner(body: Body) -> Solve:
    """Symmetric positive approximate inverse of the displacement block of the stiffness."""
    matrix = body.stiffness.matrix.tobsr(blocksize=(3, 3))
    if not ELEMENTS[body.element].quadratic:
        return _linear_level(matrix, body.points)
    prolong = _from_vertices(body.nodes.mesh, body.node_count)
    coarse = _linear_level(_on_vertices(matrix, prolong), body.points[: prolong.shape[1]])
    restrict, jacobi = csr_array(prolong.T), _block_jacobi(matrix)

    def both(residual: Floats) -> Floats:
        found = coarse((restrict @ residual.reshape(-1, 3)).ravel())
        found = np.asarray(prolong @ found.reshape(-1, 3)).ravel()
        jacobi.add_product(residual, found)
        return found

    return both


def _on_vertices(matrix: bsr_array, prolong: csr_array) -> bsr_array:
    """The matrix of linear elements, by Galerkin projection of that of quadratic ones."""
    blocks = prolong.data[:, None, None] * np.eye(3)
    shape = (3 * prolong.shape[0], 3 * prolong.shape[1])
    by_node = bsr_array((blocks, prolong.indices, prolong.indptr), shape=shape)
    return by_node.T @ matrix @ by_node


def _block_jacobi(matrix: bsr_array) -> Blocks:
    """Damped inverses of the diagonal blocks."""
    whole = blocks_of(matrix)
    inverses = JACOBI_WEIGHT * np.linalg.inv(whole.data[diagonal_of(whole)])
    places = np.arange(len(inverses) + 1, dtype=np.int32)
    return Blocks(places[:-1], places[1:], places[:-1], inverses.astype(np.float32))


def _from_vertices(mesh: Any, nodes: int) -> csr_array:
    """Interpolation from vertices to all nodes: an edge node takes the mean of its ends."""
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
    """Iterative solver of K u = f to a relative residual of `tolerance` by default.

    Its calls raise ValueError without convergence: for a body that is not held, or nearly flat
    elements.
    """
    inner, pressure = preconditioner(body), body.stiffness.pressure
    if pressure is None:
        matrix = body.stiffness.blocks
        return _solver(cg, matrix, inner, tolerance, single=symmetric(matrix))
    schur = factorised(pressure.schur)
    whole, size = csr_array(body.stiffness.system()), body.stiffness.size

    def both(residual: Floats) -> Floats:
        return np.concatenate([inner(residual[:size]), schur(residual[size:])])

    return _solver(minres, whole, both, tolerance, size)


def _solver(
    method: Any,
    matrix: Any,
    inner: Solve,
    default: float,
    size: int | None = None,
    single: Any = None,
) -> Solver:
    """Solver for the first `size` unknowns; the others are pressures, without load."""

    def padded(values: Floats) -> Floats:
        return np.concatenate([values, np.zeros(matrix.shape[0] - len(values))])

    def solve(load: Floats, tolerance: float | None = None, start: Floats | None = None) -> Floats:
        wanted = default if tolerance is None else tolerance
        first = None if start is None else padded(start)
        return _refined(method, matrix, inner, padded(load), wanted, first, single)[:size]

    return solve


def _refined(
    method: Any,
    matrix: Any,
    inner: Solve,
    load: Floats,
    tolerance: float,
    start: Floats | None = None,
    single: Any = None,
) -> Floats:
    """Solution by iterative refinement.

    It also makes up for the stopping criterion of MINRES, which has a norm of its own. `single`:
    an approximation of the matrix in single precision for the inner iterations, used as long as it
    reduces the residual.
    """
    u = np.zeros_like(load) if start is None else start
    residual, scale = load - matrix @ u, float(np.linalg.norm(load))
    cheapest = matrix if single is None else single
    for _ in range(REFINEMENTS):
        norm = float(np.linalg.norm(residual))
        if norm <= tolerance * scale or norm <= _rounding(cheapest, u, norm, scale):
            return u
        least = ROUNDING if single is None else SINGLE_TOLERANCE
        inner_tolerance = max(TOLERANCE_FACTOR[method] * tolerance * scale / norm, least)
        inner_matrix = matrix if single is None else single
        with np.errstate(all="ignore"):  # a singular matrix may give 0 / 0, seen in the residual
            correction = _iterated(method, inner_matrix, inner, residual, inner_tolerance)
        corrected = load - matrix @ (u + correction)
        if single is not None and not np.linalg.norm(corrected) < LEAST_REDUCTION * norm:
            single = None
            continue
        u, residual = u + correction, corrected
        if not np.isfinite(residual).all():
            break
    raise ValueError(
        "the finite elements find no static equilibrium: the support does not hold the body, or a "
        "tetrahedron is nearly flat; enlarge support.depth, raise support.stiffness, or repair "
        "organ.mesh"
    )


def _iterated(method: Any, matrix: Any, inner: Solve, right: Floats, tolerance: float) -> Floats:
    product, preconditioning = (
        LinearOperator(matrix.shape, matvec=one, dtype=np.float64)
        for one in (matrix.__matmul__, inner)
    )
    found, _ = method(product, right, M=preconditioning, rtol=tolerance, maxiter=MAX_ITERATIONS)
    return np.asarray(found)


def _rounding(matrix: Any, u: Floats, norm: float, scale: float) -> float:
    """Rounding error of a residual, which no iteration reduces.

    Zero for a residual above IMBALANCE: a nearly singular matrix has arbitrarily large rounding.
    """
    if norm > IMBALANCE * scale:
        return 0.0
    by_blocks = isinstance(matrix, Blocks | SymmetricBlocks)
    magnitudes = matrix.magnitudes(u) if by_blocks else abs(matrix) @ np.abs(u)
    return ROUNDING * float(np.linalg.norm(magnitudes))
