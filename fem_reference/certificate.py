"""What a bound of a subspace's error needs to know of the body, computed once and small.

Of a Krylov space of the load, solved to rounding, and of how a given subspace lies in it. See
`fem_reference.certified` for what is made of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.sparse import csr_array

from fem_reference.definite import StiffnessFloor, stiffness_floor
from fem_reference.direct import EPSILON, Solve, factorised
from fem_reference.elasticity import Body
from fem_reference.subspace import Subspace, empty, extended

Floats = NDArray[np.float64]

VECTORS = 128
"""Of the Krylov space: the more, the nearer the bound is to the error."""
EXHAUSTED = 1e-9
"""Share of a vector outside of the Krylov space, in the mass, at which the space is complete."""


def krylov_space(body: Body, solve: Solve, count: int) -> Subspace:
    """At most `count` vectors K^-1 f, K^-1 M K^-1 f, ..., solved as exactly as `solve` does."""
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
    """K^-1 w of the one direction w of a Krylov space's residual, and its energy norm.

    `defect`: energy norm of K^-1 times all that is wrong with the other directions, and with this
    one; `static_defect`: with the static displacement.
    """

    solution: Floats
    norm: float
    defect: float
    static_defect: float


def residual(body: Body, space: Subspace, solve: Solve, floor: StiffnessFloor) -> Residual:
    """Of a Krylov space, with the rounding of what it is computed from.

    For coordinates y the residual is s w_0 - sum_k (y_k'' + a y_k') w_k, where w_k is M v_k and w_0
    is f, less what K V balances of it; all but the last w_k vanish.
    """
    V, K = space.vectors, body.stiffness
    wanted = np.column_stack([space.load, np.eye(len(V.T))])
    balanced = np.asarray(np.linalg.solve(space.stiffness, wanted), np.float64)
    whole = np.column_stack([body.load, body.mass @ V]) - _pushed(body, V) @ balanced
    solution = solve(whole[:, -1])
    whole[:, -1] -= K @ solution
    wrong = np.abs(whole) + _rounding(body, V, balanced, solution)
    sizes = np.sqrt((wrong**2 / floor.diagonal[:, None]).sum(axis=0))
    norm = float(np.sqrt(solution @ (K @ solution)))
    return Residual(solution, norm, float(np.linalg.norm(sizes[1:])), float(sizes[0]))


def _rounding(body: Body, V: Floats, balanced: Floats, solution: Floats) -> Floats:
    """Of each entry of the residual's directions: eps times entries of a row times magnitudes."""
    matrix = body.stiffness.matrix
    entries = int(np.diff(csr_array(matrix).indptr).max()) + len(V.T)
    size = np.abs(V) @ np.abs(balanced)
    size[:, -1] += np.abs(solution)
    pushed = abs(matrix) @ size
    pressure = body.stiffness.pressure
    if pressure is not None:
        nodal = pressure.lame * (abs(pressure.divergence) @ size)
        pushed += abs(pressure.divergence).T @ (nodal / pressure.mass.diagonal()[:, None])
    pushed[:, 0] += np.abs(body.load)
    pushed[:, 1:] += abs(body.mass) @ np.abs(V)
    return np.asarray(EPSILON * entries * pushed)


class Seen(NamedTuple):
    """Control points' displacement: of the modes (p, 3, M), K^-1 w (p, 3), and left-out parts.

    `outside` (p, 3, m): of what the subspace's modes have outside of the Krylov space;
    `compliance` (p,) [m/sqrt(J)]: largest displacement of unit energy norm.
    """

    modes: Floats
    solution: Floats
    outside: Floats
    compliance: Floats


@dataclass(frozen=True, eq=False)
class Certificate:
    """What the bound needs to know of a body and a subspace, none of it of the body's size.

    `squares` (M,) [1/s^2], `load` (M,): of the Krylov space's modes; `last` (M,): how much of its
    last vector each has, by which its residual goes; `norm`, `defect`, `static_defect`: of
    `Residual`; `lowest` [1/s^2]: proven below all eigenvalues; `inside` (M, m): the subspace's
    modes among those of the Krylov space; `outside` (1 + m, 1 + m): products in the stiffness of
    K^-1 w and of what of these modes is outside; `own_squares`, `own_load` (m,): of the subspace.
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
    seen: Seen

    @cached_property
    def rest(self) -> Floats:
        """Share of each mode in the displacement under the full load at rest."""
        return self.load / self.squares

    @property
    def error_at_rest(self) -> float:
        """Bound of the energy norm's error of the subspace at rest, over the energy norm there.

        Free of constants: the residual at rest is known, and so is its dual norm.
        """
        own = self.own_load / self.own_squares
        inside = self.squares @ (self.rest - self.inside @ own) ** 2
        outside = own @ self.outside[1:, 1:] @ own
        known = float(np.sqrt(np.maximum(inside + outside, 0.0)))
        return (known + self.static_defect) / float(np.sqrt(self.load @ self.rest))

    @property
    def rounding(self) -> float:
        """What rounding adds to a bound at once, relative to the energy norm at rest."""
        at_rest = float(np.sqrt(self.load @ self.rest))
        return (self.static_defect + self.defect * float(np.linalg.norm(self.load))) / at_rest


@dataclass(frozen=True, eq=False)
class Comparison:
    """A body's Krylov space, with which any subspaces of the body may be compared.

    `shapes` (n, M): its modes, the least square of their frequencies first; `load` (M,) and `last`
    (M,): what each has of the load, and of the space's last vector.
    """

    body: Body
    solve: Solve
    floor: StiffnessFloor
    shapes: Floats
    squares: Floats
    load: Floats
    last: Floats
    residual: Residual

    def certificate(self, subspace: Subspace, at_probes: csr_array) -> Certificate:
        """Of a subspace, as the body's control points are seen."""
        own_squares, own_modes = eigh(subspace.stiffness)
        own_shapes = subspace.vectors @ own_modes
        inside = (self.shapes.T @ _pushed(self.body, own_shapes)) / self.squares[:, None]
        left = np.column_stack([self.residual.solution, own_shapes - self.shapes @ inside])
        return Certificate(
            self.squares,
            self.load,
            self.last,
            *self.residual[1:],
            self.floor.eigenvalue,
            inside,
            left.T @ _pushed(self.body, left),
            own_squares,
            own_modes.T @ subspace.load,
            self._seen(at_probes, left),
        )

    def _seen(self, at_probes: csr_array, left: Floats) -> Seen:
        def of(vectors: Floats) -> Floats:
            count = vectors.shape[1]
            return np.asarray(at_probes @ vectors.reshape(-1, 3 * count)).reshape(-1, 3, count)

        compliance = [self._compliance(row) for row in at_probes.toarray()]
        beside = of(left)
        return Seen(of(self.shapes), beside[..., 0], beside[..., 1:], np.array(compliance))

    def _compliance(self, row: Floats) -> float:
        """Largest length of the displacement of unit energy norm at a point, from above.

        `row` (nodes,) has the weights of the nodes there.
        """
        forces = np.kron(row[:, None], np.eye(3))
        answers = np.column_stack([self.solve(one) for one in forces.T])
        balanced = _pushed(self.body, answers)
        wrong = np.linalg.norm((forces - balanced) / np.sqrt(self.floor.diagonal)[:, None])
        return float(np.sqrt(np.linalg.eigvalsh(answers.T @ balanced)[-1]) + wrong)


def comparison(body: Body, lowest: float, count: int = VECTORS) -> Comparison:
    """By at most `count` vectors, as many as the load reaches.

    `lowest` [1/s^2]: above the lowest eigenvalue, the nearer the better. The stiffness is factored
    twice. ValueError if it is not definite beyond rounding.
    """
    floor, solve = stiffness_floor(body, lowest), direct(body)
    space = krylov_space(body, solve, min(count, body.stiffness.size))
    squares, modes = eigh(space.stiffness)
    found = residual(body, space, solve, floor)
    shapes, load = space.vectors @ modes, modes.T @ space.load
    return Comparison(body, solve, floor, shapes, squares, load, modes[-1], found)


def certificate(
    body: Body, subspace: Subspace, at_probes: csr_array, vectors: int = VECTORS
) -> Certificate:
    """Of one subspace, by so many vectors or as many as it has itself; see `comparison`."""
    lowest = float(np.linalg.eigvalsh(subspace.stiffness)[0])
    wanted = max(vectors, subspace.load.size)
    return comparison(body, lowest, wanted).certificate(subspace, at_probes)


def direct(body: Body) -> Solve:
    """Solution of K u = f by factors, to rounding; the pressures are left out."""
    solve, size = factorised(body.stiffness.system()), body.stiffness.size
    padding = np.zeros(body.unknowns - size)
    return lambda load: solve(np.concatenate([load, padding]))[:size]


def _pushed(body: Body, vectors: Floats) -> Floats:
    """K times each of the vectors (n, m)."""
    return np.column_stack([body.stiffness @ v for v in vectors.T])
