"""Choice of a direct or an iterative solver of K u = f."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fem_reference.direct import IMBALANCE, Solve, factorised
from fem_reference.elasticity import Body, without_fixed
from fem_reference.iterative import Solver, iterative
from fem_reference.memory import factors_fit

Floats = NDArray[np.float64]

FACTORED_BELOW = 6_000
"""Unknowns below which factors are cheaper than iterations, even for one solution."""
TOLERANCE = 1e-10


def solver(body: Body, tolerance: float = TOLERANCE) -> Solver:
    """Solver of K u = f to a residual of `tolerance` times f, or to rounding.

    Each call of an iterative solver may give its own tolerance and start vector. Forces on
    constrained unknowns are left to the support.
    """
    if body.unknowns <= FACTORED_BELOW:
        direct = by_factors(body)
        return lambda load, *_, **__: direct(load)
    solve = _with_direct_fallback(body, iterative(body, tolerance))

    def of_free(
        load: Floats, tolerance: float | None = None, start: Floats | None = None
    ) -> Floats:
        return solve(without_fixed(load, body.fixed), tolerance, start)

    return of_free


def by_factors(body: Body) -> Solve:
    """Direct solver of K u = f; the pressures are not returned.

    Forces on constrained unknowns are left to the support.
    """
    solve, size = factorised(body.stiffness.system()), body.stiffness.size
    padding = np.zeros(body.unknowns - size)
    return lambda load: solve(np.concatenate([without_fixed(load, body.fixed), padding]))[:size]


def _with_direct_fallback(body: Body, iterations: Solver) -> Solver:
    """Iterative solver, with a direct one after its first failure if memory allows.

    With mixed elements and a support far stiffer than the tissue, MINRES stagnates where factors
    reach equilibrium. Neither solves a body that is not held.
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
    """Static displacement [m] (n,) under all loads in full, from an approximate `start`.

    ValueError if it is not in equilibrium.
    """
    load = body.whole_load
    found = solver(body, tolerance)(load, start=start)
    _check_balance(body, found, load)
    return found


def _check_balance(body: Body, found: Floats, load: Floats) -> None:
    """ValueError if a displacement is not in equilibrium with a load."""
    imbalance = np.linalg.norm(body.stiffness @ found - load) / np.linalg.norm(load)
    if not imbalance < IMBALANCE:
        raise ValueError(
            f"static solution out of balance by {imbalance:.1e} of the load: the support does not "
            "hold the body; enlarge support.depth"
        )
