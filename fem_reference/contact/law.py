"""Laws of unilateral contact and Coulomb friction at a set of contact points.

Each point has a contact force in the frame of its normal, which points away from the tool, and two
tangents; relative displacements depend linearly on the forces, by a compliance. Without friction
the forces follow from a primal-dual active set: Hintermueller, Ito and Kunisch (2002), SIAM J.
Optim. 13:865; if that cycles, from non-negative least squares. With friction they follow from
nonlinear Gauss-Seidel: Jourdan, Alart and Jean (1998), Comput. Methods Appl. Mech. Eng. 155:31.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem_reference.contact.friction import nonlinear_gauss_seidel

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

MOST_ACTIVE_SETS = 60
"""Changes of the active set before non-negative least squares are used."""


@dataclass(frozen=True, eq=False)
class ComplementarityProblem:
    """Gaps A force + b >= 0, forces >= 0, and one of the two zero, for u unknown forces.

    `compliance` [m/N] (u, u): A; `offset` [m] (u,): b, gaps without forces, infinite where the
    force is zero. `bilateral` (u,): forces of either sign, whose gap is zero.
    """

    compliance: Floats
    offset: Floats
    bilateral: Bools


def frictionless_forces(problem: ComplementarityProblem, start: Floats) -> Floats:
    """Contact forces [N] (u,) without friction, sought from those of a `start`."""
    A, b, bilateral = problem.compliance, problem.offset, problem.bilateral
    usable = np.isfinite(b)
    active = usable & (bilateral | (start > 0.0))
    for _ in range(MOST_ACTIVE_SETS):
        found = np.zeros(len(b))
        chosen = np.flatnonzero(active)
        if len(chosen):
            found[chosen] = np.linalg.solve(A[np.ix_(chosen, chosen)], -b[chosen])
        gap = A @ found + np.where(usable, b, 0.0)
        wanted = usable & (bilateral | np.where(active, found > 0.0, gap < 0.0))
        if np.array_equal(wanted, active):
            return found
        active = wanted
    return _by_least_squares(A, b, bilateral, usable)


def _by_least_squares(A: Floats, b: Floats, bilateral: Bools, usable: Bools) -> Floats:
    """The same forces: bilateral ones eliminated, the others by non-negative least squares."""
    from scipy.optimize import nnls

    found = np.zeros(len(b))
    h, p = np.flatnonzero(bilateral), np.flatnonzero(usable & ~bilateral)
    own = np.linalg.solve(A[np.ix_(h, h)], np.column_stack([A[np.ix_(h, p)], b[h]]))
    among = A[np.ix_(p, p)] - A[np.ix_(p, h)] @ own[:, :-1]
    right = b[p] - A[np.ix_(p, h)] @ own[:, -1]
    root = np.linalg.cholesky(0.5 * (among + among.T))
    pushed, _ = nnls(root.T, -np.linalg.solve(root, right), maxiter=30 * len(p))
    found[p] = pushed
    found[h] = -own[:, -1] - own[:, :-1] @ pushed
    return found


def frictional_forces(
    compliance: Floats, offset: Floats, friction: Floats, start: Floats
) -> Floats:
    """Contact forces [N] (v, 3) along normal and tangents with Coulomb's `friction` (v,).

    `compliance` [m/N] (3 v, 3 v); `offset` [m] (v, 3): gap, and slip along the tangents, without
    forces. An infinite gap has no force, an infinite coefficient of friction is a bilateral bond.
    """
    usable = np.flatnonzero(np.isfinite(offset[:, 0]))
    found = np.zeros_like(offset)
    unknowns = (3 * usable[:, None] + np.arange(3)).ravel()
    among = np.ascontiguousarray(compliance[np.ix_(unknowns, unknowns)])
    arguments = (offset[usable], friction[usable], start[usable])
    found[usable] = nonlinear_gauss_seidel(among, *(np.ascontiguousarray(one) for one in arguments))
    return found


def law_residual(offset: Floats, force: Floats, friction: Floats, stiffness: float) -> float:
    """Largest violation [m] of Coulomb's law by forces [N] (v, 3), gaps and slips [m] (v, 3).

    Forces that meet the law are their own projection onto the friction cone after correction by the
    gaps and slips times any `stiffness` [N/m]; the violation is the difference over that stiffness.
    An infinite gap has no force, an infinite coefficient of friction is a bilateral bond.
    """
    bilateral = np.isinf(friction)
    usable = np.isfinite(offset[:, 0])
    shown = np.where(usable[:, None], offset, 0.0)
    trial = force - stiffness * shown
    normal = np.where(usable, np.maximum(trial[:, 0], 0.0), 0.0)
    tangential = np.hypot(trial[:, 1], trial[:, 2])
    limit = np.where(bilateral, 0.0, friction) * np.maximum(force[:, 0], 0.0)
    share = np.minimum(1.0, limit / np.maximum(tangential, 1e-300))
    wanted = np.column_stack([normal, share[:, None] * trial[:, 1:]])
    violation = np.where(bilateral[:, None], stiffness * shown, force - wanted)
    return float(np.linalg.norm(violation, axis=1).max(initial=0.0)) / stiffness
