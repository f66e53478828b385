"""Subspaces for the motion under given load patterns, and modal superposition in them.

Load-dependent Ritz vectors are the static displacement u_0 = K^-1 f and u_k+1 = K^-1 M u_k. They
contain the response to slow loads exactly and need a few dozen solutions where time stepping needs
hundreds. Eigenvectors, the usual choice, converge more slowly under a local load. Wilson, Yuan and
Dickens (1982), Earthquake Eng. Struct. Dyn. 10:813.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial, reduce
from itertools import islice, pairwise

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh, expm
from scipy.sparse.linalg import LinearOperator, eigsh

from fem_reference.direct import Solve
from fem_reference.elasticity import Body
from fem_reference.solvers import solver
from study.problem.damping import RayleighDamping

Floats = NDArray[np.float64]

LOOSE, LOOSEST, LOOSENED = 1e-3, 0.2, 1.25
"""Residual of the second Ritz vector, largest residual, and growth from one vector to the next.

The projection is exact for any vectors, and an inexact vector costs the less the later it comes in
a Krylov space: Simoncini and Szyld (2003), SIAM J. Sci. Comput. 25:454. Measured on a block against
exact vectors, inexact ones change a curve by a tenth of the change by the last quarter of 17
vectors, and by as much as the last quarter of 65.
"""
DEPENDENT = 1e-10
"""Singular values, relative to the largest, that count as linear dependence."""


@dataclass(frozen=True)
class Subspace:
    """`vectors` (n, m), orthonormal in the mass, with projected `stiffness` (m, m) and `load` (m,).

    `others`: projections (m,) of the further loads.
    """

    vectors: Floats
    stiffness: Floats
    load: Floats
    others: tuple[Floats, ...] = ()

    @property
    def loads(self) -> Floats:
        """Projections (m, loads) of all loads."""
        return np.column_stack([self.load, *self.others])

    def rest(self, full: Floats | None = None) -> Floats:
        """Static displacement [m] (n,) under all loads, in the subspace.

        `full` (loads,): factor of each load, 1 by default.
        """
        loads = self.loads
        whole = loads.sum(axis=1) if full is None else loads @ full
        return np.asarray(self.vectors @ np.linalg.solve(self.stiffness, whole))

    def leading(self, size: int) -> Subspace:
        """The subspace of the first `size` vectors."""
        others = tuple(one[:size] for one in self.others)
        among = self.stiffness[:size, :size]
        return Subspace(self.vectors[:, :size], among, self.load[:size], others)


def eigenvectors(body: Body, solve: Solve, count: int) -> Floats:
    """Static displacements and the `count` lowest modes of vibration, (n, loads + count).

    The static displacements make a truncated superposition exact in statics.
    """
    shape = (body.stiffness.size, body.stiffness.size)
    operator = LinearOperator(shape, matvec=lambda u: body.stiffness @ u, dtype=np.float64)
    inverse = LinearOperator(shape, matvec=solve, dtype=np.float64)
    found = eigsh(operator, count, M=body.mass, sigma=0.0, OPinv=inverse, v0=np.ones(shape[0]))[1]
    return np.column_stack([*map(solve, body.loads.T), found])


def empty(size: int) -> Subspace:
    """A subspace without vectors, of `size` unknowns."""
    return Subspace(np.zeros((size, 0)), np.zeros((0, 0)), np.zeros(0))


def extended(body: Body, found: Subspace, vector: Floats) -> Subspace:
    """The subspace with one more vector, orthonormalised in the mass."""
    V = found.vectors
    for _ in range(2):  # one pass of Gram-Schmidt loses orthogonality to rounding
        vector = vector - V @ (V.T @ body.inertia(vector))
        vector = vector / np.sqrt(vector @ body.inertia(vector))
    force = body.stiffness @ vector
    column = V.T @ force
    stiffness = np.block([[found.stiffness, column[:, None]], [column[None], vector @ force]])
    known = found.others or tuple(np.zeros(found.load.size) for _ in body.others)
    others = tuple(np.append(a, vector @ b) for a, b in zip(known, body.others, strict=True))
    load = np.append(found.load, vector @ body.load)
    return Subspace(np.column_stack([V, vector]), stiffness, load, others)


class Guesses:
    """Start vectors of iterative solutions: best in energy among Ritz vectors and given `vectors`.

    `vectors` (n, k): approximations of the solutions, such as those on another mesh, or None.
    """

    def __init__(self, body: Body, vectors: Floats | None) -> None:
        self.body = body
        self.vectors = np.zeros((body.load.size, 0)) if vectors is None else vectors
        self._stiffness = self._among(self.vectors)
        self._mixed = self._among(self.vectors[:, :0])

    def _among(self, vectors: Floats) -> Floats:
        """Stiffness (k, m) between the given vectors and others (n, m)."""
        found = [self.vectors.T @ (self.body.stiffness @ one) for one in vectors.T]
        return np.reshape(found, (vectors.shape[1], self.vectors.shape[1])).T

    def start(self, found: Subspace, load: Floats) -> Floats:
        """Best approximation [m] (n,) in energy of the displacement under a load.

        From call to call, `found` may only grow.
        """
        W, V = self.vectors, found.vectors
        fresh = self._among(V[:, self._mixed.shape[1] :])
        self._mixed = mixed = np.hstack([self._mixed, fresh])
        energy = np.block([[found.stiffness, mixed.T], [mixed, self._stiffness]])
        sizes = np.sqrt(np.diag(energy))
        forces = np.concatenate([V.T @ load, W.T @ load]) / sizes
        y = np.linalg.lstsq(energy / np.outer(sizes, sizes), forces, rcond=DEPENDENT)[0] / sizes
        return np.asarray(V @ y[: V.shape[1]] + W @ y[V.shape[1] :])


def ritz_subspaces(body: Body, near: Floats | None = None) -> Iterator[Subspace]:
    """Subspaces of 1, 2, ... load-dependent Ritz vectors without end, of all loads in turn.

    `near` (n, k): approximations of the vectors, which save half of the iterations.
    """
    solve, guesses, found = solver(body), Guesses(body, near), empty(body.load.size)
    loads = body.loads.T
    for load in loads:
        found = extended(body, found, solve(load, start=guesses.start(found, load)))
        yield found
    tolerance = LOOSE
    while True:
        for _ in loads:  # a block of one vector per load
            load = body.inertia(found.vectors[:, -len(loads)])
            found = extended(body, found, solve(load, tolerance, guesses.start(found, load)))
            yield found
        tolerance = min(LOOSENED * tolerance, LOOSEST)


def ritz_subspace(body: Body, count: int) -> Subspace:
    """The first `count` load-dependent Ritz vectors. ValueError if the body has no equilibrium."""
    if count < 1:
        raise ValueError(f"{count} Ritz vectors span nothing; give 1 or more")
    return next(islice(ritz_subspaces(body), count - 1, None))


def modal_subspace(body: Body, count: int) -> Subspace:
    """The static displacements and the `count` lowest modes, or as many as the body has.

    ValueError if the body has no equilibrium.
    """
    size = body.stiffness.size
    vectors = eigenvectors(body, solver(body), min(count, size - 2))
    return reduce(partial(extended, body), vectors.T, empty(size))


class SubspaceMotion:
    """Motion from rest in a subspace, exact for a load that is linear over a `step` [s].

    `factor`: share of the body's load at times [s] (t,), or of each of its loads (t, loads).
    `displacement` [m] (n,) of all unknowns after the steps taken. `state` (m, 4): displacement,
    velocity, load and rate of load of each mode. The columns of `modes` (m, m) are the modes in
    coordinates of the subspace, `squares` [1/s^2] (m,) their squared angular frequencies.
    """

    def __init__(
        self,
        subspace: Subspace,
        damping: RayleighDamping,
        factor: Callable[[Floats], Floats],
        step: float,
    ) -> None:
        self.squares, self.modes = eigh(subspace.stiffness)
        self.subspace, self.factor, self.step, self.time = subspace, factor, step, 0.0
        self.state = np.zeros((len(self.squares), 4))
        self.displacement = np.zeros(len(subspace.vectors))
        self._load = self.modes.T @ subspace.loads
        self._moved = transitions(self.squares, damping, step)

    @cached_property
    def _shapes(self) -> Floats:
        return np.asarray(self.subspace.vectors @ self.modes)

    def take_step(self) -> None:
        """Advance by one step and evaluate the displacement."""
        self.go_on()
        self.deliver()

    def go_on(self, steps: int = 1) -> None:
        """Advance by `steps` steps without evaluating the displacement."""
        times = np.asarray(self.time + self.step * np.arange(steps + 1), dtype=np.float64)
        for before, after in pairwise(self.factor(times)):
            self.advance(before, after)
        self.time += self.step * steps

    def deliver(self) -> Floats:
        """Evaluate and return the displacement [m] (n,) at the current time."""
        self.displacement = self._shapes @ self.state[:, 0]
        return self.displacement

    def restart(self) -> None:
        """Return to rest at time zero."""
        self.time, self.displacement = 0.0, np.zeros_like(self.displacement)
        self.state[:] = 0.0

    def advance(self, before: Floats, after: Floats) -> None:
        """Advance the state by a step from the factors of the loads at its start and end."""
        state = self.state
        start, end = (self._load @ np.atleast_1d(share) for share in (before, after))
        state[:, 2], state[:, 3] = start, (end - start) / self.step
        state[:, :2] = np.einsum("mij,mj->mi", self._moved, state)[:, :2]


def superposition(
    subspace: Subspace,
    damping: RayleighDamping,
    factor: Callable[[Floats], Floats],
    times: Floats,
    inside: int = 1,
) -> tuple[Floats, Floats]:
    """Coordinates and their rates in the subspace, from rest, at equally spaced times [s].

    Each mode is integrated exactly for a load that is linear between the times. `inside`: number of
    equally spaced samples in each step, the last at its end; shape ((times - 1) * inside + 1, m).
    """
    step = float(times[1] - times[0])
    squares, modes = eigh(subspace.stiffness)
    loads = np.reshape(factor(times), (len(times), -1)) @ (modes.T @ subspace.loads).T
    forced = np.stack([loads[:-1], np.diff(loads, axis=0) / step], axis=-1)
    count, size = forced.shape[:2]
    starts, y = np.zeros((count + 1, size, 2)), np.zeros((count, inside, size, 2))
    _take_steps(transitions(squares, damping, step), forced, starts)
    y[:, -1] = starts[1:]
    whole = np.concatenate([starts[:-1], forced], axis=-1)
    for part in range(1, inside):
        moved = transitions(squares, damping, step * part / inside)[:, :2]
        y[:, part - 1] = np.einsum("mij,nmj->nmi", moved, whole)
    y = np.concatenate([np.zeros((1, size, 2)), y.reshape(-1, size, 2)])
    return y[..., 0] @ modes.T, y[..., 1] @ modes.T


@numba.njit(cache=True, error_model="numpy", no_cfunc_wrapper=True, _nrt=False)  # type: ignore[untyped-decorator] # numba has no types
def _take_steps(moved: Floats, forced: Floats, states: Floats) -> None:
    """Displacement and velocity (steps + 1, m, 2) by transitions (m, 4, 4) under loads."""
    for n in range(len(forced)):
        for m in range(len(moved)):
            for i in range(2):
                total = 0.0
                for j in range(2):
                    total += moved[m, i, j] * states[n, m, j]
                    total += moved[m, i, 2 + j] * forced[n, m, j]
                states[n + 1, m, i] = total


def transitions(squares: Floats, damping: RayleighDamping, step: float) -> Floats:
    """Transition matrices (m, 4, 4) of displacement, velocity, load and load rate over a step [s].

    `squares` [1/s^2] (m,): squared angular frequencies of the modes. Exact for a load that is
    linear over the step.
    """
    rate = np.zeros((len(squares), 4, 4))
    rate[:, [0, 1, 2], [1, 2, 3]] = 1.0
    rate[:, 1, 0], rate[:, 1, 1] = -squares, -(damping.mass + damping.stiffness * squares)
    return np.asarray(expm(step * rate))
