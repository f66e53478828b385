"""Solution of K u = f, the way that suits the size of the system and how often it is solved."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fem_reference.direct import IMBALANCE, factorised
from fem_reference.elasticity import Body
from fem_reference.iterative import Solver, iterative

Floats = NDArray[np.float64]

FACTORED_BELOW = 6_000
"""Unknowns for which factors are cheaper than iterations, even for one solution."""
TOLERANCE = 1e-10


def solver(body: Body, tolerance: float = TOLERANCE) -> Solver:
    """Solution of K u = f to a residual of `tolerance` times f, or of rounding.

    Each solution may have a tolerance of its own, and a start near it; factors need neither.
    """
    if body.unknowns > FACTORED_BELOW:
        return iterative(body, tolerance)
    solve, size = factorised(body.stiffness.system()), body.stiffness.size
    padding = np.zeros(body.unknowns - size)
    return lambda load, *_, **__: solve(np.concatenate([load, padding]))[:size]


def solve_static(body: Body, tolerance: float = TOLERANCE, start: Floats | None = None) -> Floats:
    """Displacement [m] (n,) at rest under the full load, sought from a `start` near it.

    ValueError if it is not in balance.
    """
    found = solver(body, tolerance)(body.load, start=start)
    imbalance = np.linalg.norm(body.stiffness @ found - body.load) / np.linalg.norm(body.load)
    if not imbalance < IMBALANCE:
        raise ValueError(
            f"static solution out of balance by {imbalance:.1e} of the load: the support does not "
            "hold the body; enlarge support.depth"
        )
    return found
