"""Conjugate gradients on two levels of elements, and for mixed elements minimal residuals.

Quadratic elements are preconditioned by a solution with linear elements on the same mesh, an eighth
of the unknowns, added to the diagonal: the iterations do not grow as the mesh is refined. The
linear elements are solved by factors, or, when they are many, by a cycle of algebraic multigrid
with the six rigid motions as near-null space.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array, csr_matrix, eye_array, kron
from scipy.sparse.linalg import LinearOperator, cg, minres

from fem_reference.direct import IMBALANCE, Solve, factorised
from fem_reference.elasticity import Body
from fem_reference.elements import ELEMENTS

Floats = NDArray[np.float64]

MAX_ITERATIONS = 3000
REFINEMENTS = 6
STRICTER = {cg: 0.5, minres: 1e-6}
"""Minimal residuals stop by a residual relative to the matrix's norm times the solution's."""
ROUNDING = 1e-15
"""Of the sum of magnitudes that make up a residual."""
FACTORED_BELOW = 6_000
"""Linear unknowns that are solved by factors as fast as by a cycle."""


def preconditioner(body: Body) -> Solve:
    """Approximate inverse of the displacements' part of the stiffness, symmetric and positive."""
    matrix = csr_array(body.stiffness.matrix)
    if not ELEMENTS[body.element].quadratic:
        return _linear_level(matrix, body.points)
    prolong = csr_array(kron(_from_vertices(body.nodes.mesh, body.node_count), eye_array(3)))
    vertices = prolong.shape[1] // 3
    coarse = _linear_level(csr_array(prolong.T @ matrix @ prolong), body.points[:vertices])
    restrict, diagonal = csr_array(prolong.T), matrix.diagonal()
    return lambda residual: residual / diagonal + prolong @ coarse(restrict @ residual)


def _from_vertices(mesh: Any, nodes: int) -> csr_array:
    """Matrix from values at vertices to values at all nodes: edge nodes take the mean."""
    count, ends = int(mesh.nvertices), mesh.edges
    edges = count + np.arange(ends.shape[1])
    rows = np.concatenate([np.arange(count), edges, edges])
    columns = np.concatenate([np.arange(count), ends[0], ends[1]])
    values = np.concatenate([np.ones(count), np.full(2 * ends.shape[1], 0.5)])
    return csr_array((values, (rows, columns)), shape=(nodes, count))


def _linear_level(matrix: csr_array, points: Floats) -> Solve:
    if matrix.shape[0] < FACTORED_BELOW:
        return factorised(csc_array(matrix))
    from pyamg import smoothed_aggregation_solver

    smoother = ("block_gauss_seidel", {"sweep": "symmetric"})
    with _drawing_alike():
        levels = smoothed_aggregation_solver(
            csr_matrix(matrix).tobsr(blocksize=(3, 3)),
            B=rigid_motions(points),
            strength=("symmetric", {"theta": 0.0}),
            smooth="jacobi",
            presmoother=smoother,
            postsmoother=smoother,
        )
    cycle = levels.aspreconditioner()
    return lambda residual: np.asarray(cycle @ residual)


@contextmanager
def _drawing_alike() -> Iterator[None]:
    """Let pyamg begin its estimates of eigenvalues alike, so that a solution is the same each time.

    It draws from numpy's global generator, which is left as it was.
    """
    before = np.random.get_state()  # noqa: NPY002 - the one that pyamg draws from
    np.random.seed(0)  # noqa: NPY002
    try:
        yield
    finally:
        np.random.set_state(before)  # noqa: NPY002


def rigid_motions(points: Floats) -> Floats:
    """Three translations and three rotations (3 n, 6) of points (n, 3), about their centre."""
    x = points - points.mean(axis=0)
    motions = np.zeros((len(points), 3, 6))
    motions[:, :, :3] = np.eye(3)
    for k in range(3):
        motions[:, :, 3 + k] = np.cross(np.eye(3)[k], x)
    return motions.reshape(-1, 6)


def iterative(body: Body, tolerance: float) -> Solve:
    """Solution of K u = f to a residual of `tolerance` times f.

    ValueError if it is not reached: nothing holds the body, or the elements are nearly flat.
    """
    inner, pressure = preconditioner(body), body.stiffness.pressure
    if pressure is None:
        matrix = csr_array(body.stiffness.matrix)
        return lambda load: _refined(cg, matrix, inner, load, tolerance)
    # The Schur complement is equivalent to the pressure's mass over the shear modulus, at any nu.
    schur = factorised(csc_array((1.0 / pressure.shear + 1.0 / pressure.lame) * pressure.mass))
    whole, size = csr_array(body.stiffness.system()), body.stiffness.size

    def both(residual: Floats) -> Floats:
        return np.concatenate([inner(residual[:size]), schur(residual[size:])])

    padding = np.zeros(whole.shape[0] - size)
    return lambda load: _refined(minres, whole, both, np.concatenate([load, padding]), tolerance)[
        :size
    ]


def _refined(
    method: Any, matrix: csr_array, inner: Solve, load: Floats, tolerance: float
) -> Floats:
    """Iterate again on what is left, as minimal residuals stop by a norm of their own."""
    operator = LinearOperator(matrix.shape, matvec=inner, dtype=np.float64)
    found, left, scale = np.zeros_like(load), load, float(np.linalg.norm(load))
    magnitude = abs(matrix)
    for _ in range(REFINEMENTS):
        reachable = ROUNDING * float(np.linalg.norm(magnitude @ np.abs(found)))
        # Rounding excuses no more than that: of a nearly singular matrix it would excuse anything.
        if np.linalg.norm(left) <= max(tolerance * scale, min(reachable, IMBALANCE * scale)):
            return found
        wanted = STRICTER[method] * tolerance * scale / float(np.linalg.norm(left))
        within = {"rtol": max(wanted, ROUNDING), "maxiter": MAX_ITERATIONS}
        with np.errstate(all="ignore"):  # a singular matrix may end in 0 / 0, as the residual tells
            more, _ = method(matrix, left, M=operator, **within)
        found = found + more
        left = load - matrix @ found
        if not np.isfinite(left).all():
            break
    raise ValueError(
        "the finite elements find no rest: the support does not hold the body, or a tetrahedron is "
        "nearly flat; enlarge support.depth, raise support.stiffness, or repair organ.mesh"
    )
