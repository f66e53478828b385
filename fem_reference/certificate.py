"""Data of an error bound for motions in a subspace, computed once per body and subspace.

Their size does not depend on that of the body. They describe a Krylov space of the load, solved to
rounding, and the position of a given subspace relative to it. `fem_reference.certified` evaluates
the bound.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.sparse import csr_array

from fem_reference.direct import EPSILON, Solve
from fem_reference.elasticity import Body
from fem_reference.solvers import by_factors
from fem_reference.stiffness_bound import StiffnessBound, stiffness_lower_bound
from fem_reference.subspace import Subspace, empty, extended

Floats = NDArray[np.float64]

VECTORS = 128
"""Dimension of the Krylov space: the larger, the tighter the bound."""
EXHAUSTED = 1e-9
"""Mass norm of the part of a vector outside the Krylov space, relative to the vector, at which the
space is complete."""


def krylov_space(body: Body, solve: Solve, count: int) -> Subspace:
    """Krylov space of at most `count` vectors K^-1 f, K^-1 M K^-1 f, ... by the solver `solve`."""
    found = extended(body, empty(body.stiffness.size), solve(body.load))
    while found.load.size < count:
        vector = solve(body.mass @ found.vectors[:, -1])
        outside = vector - found.vectors @ (found.vectors.T @ (body.mass @ vector))
        if _norm(body, outside) <= EXHAUSTED * _norm(body, vector):
            break
        found = extended(body, found, vector)
    return found


def _norm(body: Body, vector: Floats) -> float:
    return float(np.sqrt(vector @ (body.mass @ vector)))


class Residual(NamedTuple):
    """Solution K^-1 w for the single direction w of a Krylov space's residual, and its energy norm.

    `defect`: bound of the energy norm of K^-1 times the rounding errors of all directions;
    `static_defect`: the same for the static displacement.
    """

    solution: Floats
    norm: float
    defect: float
    static_defect: float


def residual(body: Body, space: Subspace, solve: Solve, bound: StiffnessBound) -> Residual:
    """Residual direction of a Krylov space, with bounds of its rounding errors.

    For coordinates y the residual is s w_0 - sum_k (y_k'' + a y_k') w_k, where w_k is M v_k and w_0
    is f, each minus its projection K V (V^T K V)^-1 V^T. All but the last w_k vanish but for
    rounding.
    """
    V, K = space.vectors, body.stiffness
    projected = np.column_stack([space.load, np.eye(len(V.T))])
    coordinates = np.asarray(np.linalg.solve(space.stiffness, projected), np.float64)
    forces = np.column_stack([body.load, body.mass @ V])
    directions = forces - _stiffness_times(body, V) @ coordinates
    solution = solve(directions[:, -1])
    directions[:, -1] -= K @ solution
    errors = np.abs(directions) + _rounding(body, V, coordinates, solution)
    sizes = np.sqrt((errors**2 / bound.diagonal[:, None]).sum(axis=0))
    norm = float(np.sqrt(solution @ (K @ solution)))
    return Residual(solution, norm, float(np.linalg.norm(sizes[1:])), float(sizes[0]))


def _rounding(body: Body, V: Floats, coordinates: Floats, solution: Floats) -> Floats:
    """Rounding bound of each entry of the directions: eps, entries per row, magnitudes."""
    matrix = body.stiffness.matrix
    entries = int(np.diff(csr_array(matrix).indptr).max()) + len(V.T)
    size = np.abs(V) @ np.abs(coordinates)
    size[:, -1] += np.abs(solution)
    magnitude = abs(matrix) @ size
    pressure = body.stiffness.pressure
    if pressure is not None:
        nodal = pressure.lame * (abs(pressure.divergence) @ size)
        magnitude += abs(pressure.divergence).T @ (nodal / pressure.mass.diagonal()[:, None])
    magnitude[:, 0] += np.abs(body.load)
    magnitude[:, 1:] += abs(body.mass) @ np.abs(V)
    return np.asarray(EPSILON * entries * magnitude)


class ProbeResponse(NamedTuple):
    """Displacement of the control points in the `modes` (p, 3, M) and the `solution` K^-1 w (p, 3).

    `outside` (p, 3, m): parts of the subspace's modes outside the Krylov space;
    `compliance` (p,) [m/sqrt(J)]: largest displacement in a motion of unit energy norm.
    """

    modes: Floats
    solution: Floats
    outside: Floats
    compliance: Floats


@dataclass(frozen=True, eq=False)
class Certificate:
    """Data of the bound for a body and a subspace, none of the size of the body.

    Krylov space: `squares` [1/s^2] (M,) of its modes, their `load` (M,), and their component `last`
    (M,) along its last vector, to which the residual is proportional. `norm`, `defect`,
    `static_defect`: of `Residual`. `lowest` [1/s^2]: proven lower bound of all eigenvalues.
    Subspace: `own_squares` [1/s^2] and `own_load` (m,) of its modes; `inside` (M, m): their
    components in the modes of the Krylov space; `outside` (1 + m, 1 + m): energy products of K^-1 w
    and of their parts outside. `probes`: displacements of the control points.
    """

    squares: Floats
    load: Floats
    last: Floats
    norm: float
    defect: float
    static_defect: float
    lowest: float
    inside: Floats
    outside: Floats
    own_squares: Floats
    own_load: Floats
    probes: ProbeResponse

    @cached_property
    def rest(self) -> Floats:
        """Modal coordinates (M,) of the static displacement under the full load."""
        return self.load / self.squares

    @property
    def error_at_rest(self) -> float:
        """Bound of the static error of the subspace in the energy norm, relative to the solution.

        It has no unknown constants: the static residual and its dual norm are known.
        """
        own = self.own_load / self.own_squares
        inside = self.squares @ (self.rest - self.inside @ own) ** 2
        outside = own @ self.outside[1:, 1:] @ own
        known = float(np.sqrt(np.maximum(inside + outside, 0.0)))
        return (known + self.static_defect) / float(np.sqrt(self.load @ self.rest))

    @property
    def rounding(self) -> float:
        """Contribution of rounding to a bound, relative to the static energy norm."""
        at_rest = float(np.sqrt(self.load @ self.rest))
        return (self.static_defect + self.defect * float(np.linalg.norm(self.load))) / at_rest


@dataclass(frozen=True, eq=False)
class Comparison:
    """A Krylov space of a body, with which its subspaces are compared.

    `shapes` (n, M): modes in order of `squares`; `load` (M,) and `last` (M,): their components of
    the load and of the last vector of the space.
    """

    body: Body
    solve: Solve
    bound: StiffnessBound
    shapes: Floats
    squares: Floats
    load: Floats
    last: Floats
    residual: Residual

    def certificate(self, subspace: Subspace, at_probes: csr_array) -> Certificate:
        """Certificate of a subspace; `at_probes` interpolates at the control points."""
        own_squares, own_modes = eigh(subspace.stiffness)
        own_shapes = subspace.vectors @ own_modes
        inside = (self.shapes.T @ _stiffness_times(self.body, own_shapes)) / self.squares[:, None]
        outside = np.column_stack([self.residual.solution, own_shapes - self.shapes @ inside])
        return Certificate(
            self.squares,
            self.load,
            self.last,
            *self.residual[1:],
            self.bound.eigenvalue,
            inside,
            outside.T @ _stiffness_times(self.body, outside),
            own_squares,
            own_modes.T @ subspace.load,
            self._probe_response(at_probes, outside),
        )

    def _probe_response(self, at_probes: csr_array, outside: Floats) -> ProbeResponse:
        def at_points(vectors: Floats) -> Floats:
            count = vectors.shape[1]
            return np.asarray(at_probes @ vectors.reshape(-1, 3 * count)).reshape(-1, 3, count)

        compliance = [self._compliance(row) for row in at_probes.toarray()]
        beside, shapes = at_points(outside), at_points(self.shapes)
        return ProbeResponse(shapes, beside[..., 0], beside[..., 1:], np.array(compliance))

    def _compliance(self, row: Floats) -> float:
        """Upper bound of the displacement at a point in a motion of unit energy norm.

        `row` (nodes,): interpolation weights of the point.
        """
        forces = np.kron(row[:, None], np.eye(3))
        if self.body.fixed is not None:
            forces[self.body.fixed] = 0.0  # which do not move
        solutions = np.column_stack([self.solve(force) for force in forces.T])
        balanced = _stiffness_times(self.body, solutions)
        error = np.linalg.norm((forces - balanced) / np.sqrt(self.bound.diagonal)[:, None])
        return float(np.sqrt(np.linalg.eigvalsh(solutions.T @ balanced)[-1]) + error)


def comparison(body: Body, lowest: float, count: int = VECTORS) -> Comparison:
    """Krylov space of at most `count` vectors; fewer where it is exhausted.

    `lowest` [1/s^2]: upper bound of the lowest eigenvalue, the tighter the better. The stiffness is
    factored twice. ValueError if it is not positive definite beyond rounding.
    """
    bound, solve = stiffness_lower_bound(body, lowest), by_factors(body)
    space = krylov_space(body, solve, min(count, body.stiffness.size))
    squares, modes = eigh(space.stiffness)
    found = residual(body, space, solve, bound)
    shapes, load = space.vectors @ modes, modes.T @ space.load
    return Comparison(body, solve, bound, shapes, squares, load, modes[-1], found)


def certificate(
    body: Body, subspace: Subspace, at_probes: csr_array, vectors: int = VECTORS
) -> Certificate:
    """Certificate of one subspace by a Krylov space of `vectors`, at least its own dimension."""
    lowest = float(np.linalg.eigvalsh(subspace.stiffness)[0])
    wanted = max(vectors, subspace.load.size)
    return comparison(body, lowest, wanted).certificate(subspace, at_probes)


def _stiffness_times(body: Body, vectors: Floats) -> Floats:
    """K times each of the vectors (n, m)."""
    return np.column_stack([body.stiffness @ v for v in vectors.T])
