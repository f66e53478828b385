"""Subspaces for the motion under one load pattern, and superposition of their modes.

Load-dependent Ritz vectors, the static displacement u_0 = K^-1 f and then u_k+1 = K^-1 M u_k, hold
the answer to slow loads exactly and need a few dozen solutions where stepping needs hundreds;
eigenvectors of the body are the usual choice and converge more slowly under a local load. Wilson,
Yuan and Dickens (1982), Earthquake Eng. Struct. Dyn. 10:813.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh, expm
from scipy.sparse.linalg import LinearOperator, eigsh

from fem_reference.direct import Solve
from fem_reference.dynamics import Damping
from fem_reference.elasticity import Body

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Subspace:
    """`vectors` (n, m), orthonormal in the mass; `stiffness` (m, m) and `load` (m,) among them."""

    vectors: Floats
    stiffness: Floats
    load: Floats

    def rest(self) -> Floats:
        """Displacement [m] (n,) at rest under the load, exact where it lies in the subspace."""
        return np.asarray(self.vectors @ np.linalg.solve(self.stiffness, self.load))

    def leading(self, size: int) -> Subspace:
        """The subspace of the first vectors."""
        return Subspace(self.vectors[:, :size], self.stiffness[:size, :size], self.load[:size])


def eigenvectors(body: Body, solve: Solve, count: int) -> Floats:
    """The static displacement and the `count` lowest modes of vibration, (n, count + 1).

    With the first, a truncated superposition is exact at rest.
    """
    shape = (body.stiffness.size, body.stiffness.size)
    operator = LinearOperator(shape, matvec=lambda u: body.stiffness @ u, dtype=np.float64)
    inverse = LinearOperator(shape, matvec=solve, dtype=np.float64)
    found = eigsh(operator, count, M=body.mass, sigma=0.0, OPinv=inverse, v0=np.ones(shape[0]))[1]
    return np.column_stack([solve(body.load), found])


def empty(size: int) -> Subspace:
    """No vectors yet, of so many unknowns."""
    return Subspace(np.zeros((size, 0)), np.zeros((0, 0)), np.zeros(0))


def extended(body: Body, found: Subspace, vector: Floats) -> Subspace:
    """The subspace with one more vector, made orthogonal to the others in the mass."""
    V = found.vectors
    for _ in range(2):  # once is not enough in floating point
        vector = vector - V @ (V.T @ (body.mass @ vector))
        vector = vector / np.sqrt(vector @ (body.mass @ vector))
    pushed = body.stiffness @ vector
    column = V.T @ pushed
    stiffness = np.block([[found.stiffness, column[:, None]], [column[None], vector @ pushed]])
    return Subspace(
        np.column_stack([V, vector]), stiffness, np.append(found.load, vector @ body.load)
    )


def superposition(
    subspace: Subspace, damping: Damping, factor: Callable[[Floats], Floats], times: Floats
) -> tuple[Floats, Floats]:
    """Coordinates and their rates (times, m) in the subspace, from rest.

    Each mode is integrated exactly under a load that is linear between the times, equally spaced.
    """
    rates, Q = eigh(subspace.stiffness)
    step, load = float(times[1] - times[0]), Q.T @ subspace.load
    moved, f = _transitions(rates, damping, step), factor(times)
    y = np.zeros((len(times), len(rates), 2))
    for n in range(len(times) - 1):
        state = np.stack([*y[n].T, load * f[n], load * (f[n + 1] - f[n]) / step], axis=1)
        y[n + 1] = np.einsum("mij,mj->mi", moved, state)[:, :2]
    return y[..., 0] @ Q.T, y[..., 1] @ Q.T


def _transitions(rates: Floats, damping: Damping, step: float) -> Floats:
    """Of displacement, velocity, load and its slope over one step, (m, 4, 4)."""
    system = np.zeros((len(rates), 4, 4))
    system[:, 0, 1] = system[:, 1, 2] = system[:, 2, 3] = 1.0
    system[:, 1, 0] = -rates
    system[:, 1, 1] = -(damping.mass + damping.stiffness * rates)
    return np.asarray(expm(step * system))
