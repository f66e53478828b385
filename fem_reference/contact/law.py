"""Which of many small areas touch a tool, and with what forces.

Each has a force on the body in the frame of its normal n, which points away from the tool, and two
tangents, and the mean displacements answer forces by a compliance. Where nothing is dragged, forces
follow from a primal-dual active set: Hintermueller, Ito and Kunisch (2002), SIAM J. Optim. 13:865,
and should that cycle, from least squares with forces of one sign. With Coulomb's friction they are
relaxed block by block: Jourdan, Alart and Jean (1998), Comput. Methods Appl. Mech. Eng. 155:31.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem_reference.contact.friction import relaxed

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

MOST_CHANGES = 60
"""Of the active set, before the other method is taken."""


@dataclass(frozen=True, eq=False)
class Areas:
    """What is to be found forces for: `compliance` [m/N] (u, u) of all unknown forces.

    `offset` [m] (u,): gaps without forces, of normals that may not become negative; of held ones
    and of tangents, relative displacements. `held` (u,): forces of either sign that let no
    displacement be; the others are of normals, and none pulls.
    """

    compliance: Floats
    offset: Floats
    held: Bools


def forces(areas: Areas, start: Floats) -> Floats:
    """Forces [N] (u,), sought from those of a `start`, without friction."""
    A, b, held = areas.compliance, areas.offset, areas.held
    usable = np.isfinite(b)
    active = usable & (held | (start > 0.0))
    for _ in range(MOST_CHANGES):
        found = np.zeros(len(b))
        chosen = np.flatnonzero(active)
        if len(chosen):
            found[chosen] = np.linalg.solve(A[np.ix_(chosen, chosen)], -b[chosen])
        gap = A @ found + np.where(usable, b, 0.0)
        wanted = usable & (held | np.where(active, found > 0.0, gap < 0.0))
        if np.array_equal(wanted, active):
            return found
        active = wanted
    return _by_least_squares(A, b, held, usable)


def _by_least_squares(A: Floats, b: Floats, held: Bools, usable: Bools) -> Floats:
    """The same, the held forces eliminated, and the others from a problem of one sign."""
    from scipy.optimize import nnls

    found = np.zeros(len(b))
    h, p = np.flatnonzero(held), np.flatnonzero(usable & ~held)
    own = np.linalg.solve(A[np.ix_(h, h)], np.column_stack([A[np.ix_(h, p)], b[h]]))
    among = A[np.ix_(p, p)] - A[np.ix_(p, h)] @ own[:, :-1]
    right = b[p] - A[np.ix_(p, h)] @ own[:, -1]
    root = np.linalg.cholesky(0.5 * (among + among.T))
    pushed, _ = nnls(root.T, -np.linalg.solve(root, right), maxiter=30 * len(p))
    found[p] = pushed
    found[h] = -own[:, -1] - own[:, :-1] @ pushed
    return found


def dragged(compliance: Floats, offset: Floats, friction: Floats, start: Floats) -> Floats:
    """Forces [N] (v, 3) along normal and tangents with Coulomb's `friction` (v,).

    `compliance` [m/N] (3 v, 3 v), `offset` [m] (v, 3): gap, and slip along the tangents without
    forces. Areas of infinite gap stay free; a friction that is infinite holds.
    """
    usable = np.flatnonzero(np.isfinite(offset[:, 0]))
    found = np.zeros_like(offset)
    unknowns = (3 * usable[:, None] + np.arange(3)).ravel()
    among = np.ascontiguousarray(compliance[np.ix_(unknowns, unknowns)])
    arguments = (offset[usable], friction[usable], start[usable])
    found[usable] = relaxed(among, *(np.ascontiguousarray(one) for one in arguments))
    return found


def off_law(offset: Floats, force: Floats, friction: Floats, stiffness: float) -> float:
    """How far [m] forces [N] (v, 3) and gaps and slips [m] (v, 3) are from meeting Coulomb's law.

    Forces that meet it are their own projection on its cone once they are corrected by the gaps and
    slips times any `stiffness` [N/m]; what is missing, over that stiffness. An infinite gap bears
    none, and an infinite friction holds.
    """
    held = np.isinf(friction)
    usable = np.isfinite(offset[:, 0])
    shown = np.where(usable[:, None], offset, 0.0)
    trial = force - stiffness * shown
    normal = np.where(usable, np.maximum(trial[:, 0], 0.0), 0.0)
    drag = np.hypot(trial[:, 1], trial[:, 2])
    limit = np.where(held, 0.0, friction) * np.maximum(force[:, 0], 0.0)
    share = np.minimum(1.0, limit / np.maximum(drag, 1e-300))
    wanted = np.column_stack([normal, share[:, None] * trial[:, 1:]])
    off = np.where(held[:, None], stiffness * shown, force - wanted)
    return float(np.linalg.norm(off, axis=1).max(initial=0.0)) / stiffness
