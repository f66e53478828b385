"""Solution of K u = f, the way that suits the size of the system and how often it is solved."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fem_reference.direct import IMBALANCE, Solve, factorised
from fem_reference.elasticity import Body
from fem_reference.iterative import Solver, iterative
from fem_reference.memory import factors_fit

Floats = NDArray[np.float64]

FACTORED_BELOW = 6_000
"""Unknowns for which factors are cheaper than iterations, even for one solution."""
TOLERANCE = 1e-10


def solver(body: Body, tolerance: float = TOLERANCE) -> Solver:
    """Solution of K u = f to a residual of `tolerance` times f, or of rounding.

    Each solution may have a tolerance of its own, and a start near it; factors need neither.
    """
    if body.unknowns > FACTORED_BELOW:
        return _factored_at_need(body, iterative(body, tolerance))
    solve = by_factors(body)
    return lambda load, *_, **__: solve(load)


def by_factors(body: Body) -> Solve:
    """Solution of K u = f by factors; the pressures are left out."""
    solve, size = factorised(body.stiffness.system()), body.stiffness.size
    padding = np.zeros(body.unknowns - size)
    return lambda load: solve(np.concatenate([load, padding]))[:size]


def _factored_at_need(body: Body, iterations: Solver) -> Solver:
    """By iterations, or by factors from where these fail, if the memory holds them.

    A support that is far stiffer than the tissue, beside a pressure, leaves minimal residuals short
    of a balance that factors reach. A body that nothing holds is in balance by neither.
    """
    factors: list[Solve] = []

    def solve(load: Floats, tolerance: float | None = None, start: Floats | None = None) -> Floats:
        if not factors:
            try:
                return iterations(load, tolerance, start)
            except ValueError:
                if not factors_fit(body.unknowns, body.element):
                    raise
                factors.append(by_factors(body))
        found = factors[0](load)
        _check_balance(body, found, load)
        return found

    return solve


def solve_static(body: Body, tolerance: float = TOLERANCE, start: Floats | None = None) -> Floats:
    """Displacement [m] (n,) at rest under all loads in full, sought from a `start` near it.

    ValueError if it is not in balance.
    """
    load = body.whole_load
    found = solver(body, tolerance)(load, start=start)
    _check_balance(body, found, load)
    return found


def _check_balance(body: Body, found: Floats, load: Floats) -> None:
    """ValueError if a body is not at rest under a load."""
    imbalance = np.linalg.norm(body.stiffness @ found - load) / np.linalg.norm(load)
    if not imbalance < IMBALANCE:
        raise ValueError(
            f"static solution out of balance by {imbalance:.1e} of the load: the support does not "
            "hold the body; enlarge support.depth"
        )
