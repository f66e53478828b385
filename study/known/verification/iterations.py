"""Iterative solvers compared with a factorisation of the same matrix."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fem_reference.direct import factorised
from fem_reference.elements import ElementName
from fem_reference.iterative import iterative
from fem_reference.solvers import TOLERANCE
from study.known.finding import Finding, error_of
from study.known.pressed import block
from study.problem.tissue import Tissue

LIMIT = 1e-9
"""The residual is 1e-10 of the load, the error of the displacement about ten times that."""
CASES: tuple[tuple[str, ElementName, float], ...] = (
    ("two-level conjugate gradients", "p2", 0.45),
    ("minimal residuals", "taylor-hood", 0.45),
    ("minimal residuals", "taylor-hood", 0.4999),
)


def findings() -> Iterator[Finding]:
    """Displacements by iterative solvers compared with those by factorisation."""
    for method, name, nu in CASES:
        body = block(Tissue(poisson_ratio=nu), name, 0.01)
        system, size = body.stiffness.system(), body.stiffness.size
        load = np.concatenate([body.load, np.zeros(body.unknowns - size)])
        exact = factorised(system)(load)[:size]
        off = np.linalg.norm(iterative(body, TOLERANCE)(body.load) - exact)
        error = float(off / np.linalg.norm(exact))
        yield error_of(f"displacement, {method}, {name}, nu {nu:g}", error, LIMIT)
