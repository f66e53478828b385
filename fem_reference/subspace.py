"""Subspaces for the motion under one load pattern, and superposition of their modes.

Load-dependent Ritz vectors, the static displacement u_0 = K^-1 f and then u_k+1 = K^-1 M u_k, hold
the answer to slow loads exactly and need a few dozen solutions where stepping needs hundreds;
eigenvectors of the body are the usual choice and converge more slowly under a local load. Wilson,
Yuan and Dickens (1982), Earthquake Eng. Struct. Dyn. 10:813.
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
"""Residual of the second Ritz vector, of any, and the ratio of one's to that of the one before.

Any vector serves, as what is projected is exact; and the later a vector of a Krylov space, the less
is lost by an inexact one: Simoncini and Szyld (2003), SIAM J. Sci. Comput. 25:454. Measured on a
block, against exact vectors: where 17 suffice, a curve changes by a tenth of what it does by the
last quarter of them, and where it takes 65 by as much.
"""
DEPENDENT = 1e-10
"""Relative to the largest, of the energies of nearly dependent vectors."""


@dataclass(frozen=True)
class Subspace:
    """`vectors` (n, m), orthonormal in the mass; `stiffness` (m, m) and `load` (m,) among them.

    `others` (m,) each: of the body's further loads.
    """

    vectors: Floats
    stiffness: Floats
    load: Floats
    others: tuple[Floats, ...] = ()

    @property
    def loads(self) -> Floats:
        """All loads (m, loads), in full."""
        return np.column_stack([self.load, *self.others])

    def rest(self, full: Floats | None = None) -> Floats:
        """Displacement [m] (n,) at rest under all loads, exact where it lies in the subspace.

        `full` (loads,): the share of each; all of each by default.
        """
        loads = self.loads
        whole = loads.sum(axis=1) if full is None else loads @ full
        return np.asarray(self.vectors @ np.linalg.solve(self.stiffness, whole))

    def leading(self, size: int) -> Subspace:
        """The subspace of the first vectors."""
        others = tuple(one[:size] for one in self.others)
        among = self.stiffness[:size, :size]
        return Subspace(self.vectors[:, :size], among, self.load[:size], others)


def eigenvectors(body: Body, solve: Solve, count: int) -> Floats:
    """The static displacements and the `count` lowest modes of vibration, (n, loads + count).

    With the first, a truncated superposition is exact at rest.
    """
    shape = (body.stiffness.size, body.stiffness.size)
    operator = LinearOperator(shape, matvec=lambda u: body.stiffness @ u, dtype=np.float64)
    inverse = LinearOperator(shape, matvec=solve, dtype=np.float64)
    found = eigsh(operator, count, M=body.mass, sigma=0.0, OPinv=inverse, v0=np.ones(shape[0]))[1]
    return np.column_stack([*map(solve, body.loads.T), found])


def empty(size: int) -> Subspace:
    """No vectors yet, of so many unknowns."""
    return Subspace(np.zeros((size, 0)), np.zeros((0, 0)), np.zeros(0))


def extended(body: Body, found: Subspace, vector: Floats) -> Subspace:
    """The subspace with one more vector, made orthogonal to the others in the mass."""
    V = found.vectors
    for _ in range(2):  # once is not enough in floating point
        vector = vector - V @ (V.T @ body.inertia(vector))
        vector = vector / np.sqrt(vector @ body.inertia(vector))
    pushed = body.stiffness @ vector
    column = V.T @ pushed
    stiffness = np.block([[found.stiffness, column[:, None]], [column[None], vector @ pushed]])
    known = found.others or tuple(np.zeros(found.load.size) for _ in body.others)
    others = tuple(np.append(a, vector @ b) for a, b in zip(known, body.others, strict=True))
    load = np.append(found.load, vector @ body.load)
    return Subspace(np.column_stack([V, vector]), stiffness, load, others)


class Guesses:
    """Where solutions are sought from: the best in energy among Ritz vectors and given `vectors`.

    `vectors` (n, k), near those that are sought: on another mesh, or none.
    """

    def __init__(self, body: Body, vectors: Floats | None) -> None:
        self.body = body
        self.vectors = np.zeros((body.load.size, 0)) if vectors is None else vectors
        self._stiffness = self._among(self.vectors)
        self._mixed = self._among(self.vectors[:, :0])

    def _among(self, vectors: Floats) -> Floats:
        """Stiffness (k, m) between the given vectors and others (n, m), of which none is kept."""
        found = [self.vectors.T @ (self.body.stiffness @ one) for one in vectors.T]
        return np.reshape(found, (vectors.shape[1], self.vectors.shape[1])).T

    def start(self, found: Subspace, load: Floats) -> Floats:
        """Displacement (n,) that nears the one under a load most; `found` only grows."""
        W, V = self.vectors, found.vectors
        fresh = self._among(V[:, self._mixed.shape[1] :])
        self._mixed = mixed = np.hstack([self._mixed, fresh])
        energy = np.block([[found.stiffness, mixed.T], [mixed, self._stiffness]])
        sizes = np.sqrt(np.diag(energy))
        forces = np.concatenate([V.T @ load, W.T @ load]) / sizes
        y = np.linalg.lstsq(energy / np.outer(sizes, sizes), forces, rcond=DEPENDENT)[0] / sizes
        return np.asarray(V @ y[: V.shape[1]] + W @ y[V.shape[1] :])


def ritz_subspaces(body: Body, near: Floats | None = None) -> Iterator[Subspace]:
    """Of one load-dependent Ritz vector, of two, and so on without end, of all loads in turn.

    With vectors `near` them (n, k), which save half of the iterations.
    """
    solve, guesses, found = solver(body), Guesses(body, near), empty(body.load.size)
    loads = body.loads.T
    for load in loads:
        found = extended(body, found, solve(load, start=guesses.start(found, load)))
        yield found
    tolerance = LOOSE
    while True:
        for _ in loads:  # each has its own sequence, a block of vectors to all of them
            load = body.inertia(found.vectors[:, -len(loads)])
            found = extended(body, found, solve(load, tolerance, guesses.start(found, load)))
            yield found
        tolerance = min(LOOSENED * tolerance, LOOSEST)


def ritz_subspace(body: Body, count: int) -> Subspace:
    """The first `count` load-dependent Ritz vectors. ValueError if the body finds no rest."""
    if count < 1:
        raise ValueError(f"{count} Ritz vectors span nothing; give 1 or more")
    return next(islice(ritz_subspaces(body), count - 1, None))


def modal_subspace(body: Body, count: int) -> Subspace:
    """The static displacement and the `count` lowest modes, or as many as the body has.

    ValueError if the body finds no rest.
    """
    size = body.stiffness.size
    vectors = eigenvectors(body, solver(body), min(count, size - 2))
    return reduce(partial(extended, body), vectors.T, empty(size))


class SubspaceMotion:
    """Motion from rest in a subspace, exact under a load that is linear over a `step` [s].

    `factor`: share of the body's load at times [s] (t,), or of each of its loads (t, loads).
    `displacement` [m] (n,) of all unknowns after the steps taken. `state` (m, 4): displacement,
    velocity, load and its slope of each mode of the subspace, whose coordinates there are the
    columns of `modes` (m, m) and whose squared angular frequencies [1/s^2] are `squares` (m,).
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
        """Go one step on, to the displacement there."""
        self.go_on()
        self.deliver()

    def go_on(self, steps: int = 1) -> None:
        """Go so many steps on, and leave the displacement where it was."""
        times = np.asarray(self.time + self.step * np.arange(steps + 1), dtype=np.float64)
        for before, after in pairwise(self.factor(times)):
            self.advance(before, after)
        self.time += self.step * steps

    def deliver(self) -> Floats:
        """Bring the displacement [m] (n,) to where the motion is."""
        self.displacement = self._shapes @ self.state[:, 0]
        return self.displacement

    def restart(self) -> None:
        """Put it at rest again, at the time zero."""
        self.time, self.displacement = 0.0, np.zeros_like(self.displacement)
        self.state[:] = 0.0

    def advance(self, before: Floats, after: Floats) -> None:
        """Take the state over a step with so much of the loads at its start and its end."""
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
    """Coordinates and their rates in the subspace, from rest, at equally spaced times.

    Each mode is integrated exactly under a load that is linear between the times. With `inside`,
    each of these steps is also looked at so many times, equally spaced and its end the last of
    them, as exactly; shape ((times - 1) * inside + 1, m).
    """
    step = float(times[1] - times[0])
    squares, modes = eigh(subspace.stiffness)
    held = np.reshape(factor(times), (len(times), -1)) @ (modes.T @ subspace.loads).T
    forced = np.stack([held[:-1], np.diff(held, axis=0) / step], axis=-1)
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


@numba.njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator] # numba has no types
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
    """Of displacement, velocity, load and its slope over a step [s], (m, 4, 4), by mode.

    `squares` [1/s^2] (m,): squared angular frequencies; exact for a load that is linear over the
    step.
    """
    rate = np.zeros((len(squares), 4, 4))
    rate[:, [0, 1, 2], [1, 2, 3]] = 1.0
    rate[:, 1, 0], rate[:, 1, 1] = -squares, -(damping.mass + damping.stiffness * squares)
    return np.asarray(expm(step * rate))
