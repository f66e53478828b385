"""Iterative solvers beside factors of the same matrix."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fem_reference.direct import factorised
from fem_reference.elasticity import discretise
from fem_reference.elements import ElementName
from fem_reference.iterative import iterative
from fem_reference.solvers import TOLERANCE
from study.known.verification.finding import Finding
from study.organ.block import block_mesh
from study.problem.contact import Foundation, ToolPatch
from study.problem.tissue import Tissue

SIZE = (0.06, 0.05, 0.04)
LIMIT = 1e-9
"""A residual of 1e-10 of the load, and some ten times that in the displacement."""
CASES: tuple[tuple[str, ElementName, float], ...] = (
    ("two-level conjugate gradients", "p2", 0.45),
    ("minimal residuals", "taylor-hood", 0.45),
    ("minimal residuals", "taylor-hood", 0.4999),
)


def findings() -> Iterator[Finding]:
    """Relative difference of all displacements."""
    down = np.array([0.0, 0.0, -1.0])
    tool = ToolPatch(np.array([0.03, 0.025, 0.04]), down, 0.02, 0.1)
    support = Foundation(down, 0.0, 1e-3, 1e6)
    for method, name, nu in CASES:
        tissue = Tissue(poisson_ratio=nu)
        body = discretise(block_mesh(SIZE, 0.01), tissue, support, tool, name)
        system, size = body.stiffness.system(), body.stiffness.size
        load = np.concatenate([body.load, np.zeros(body.unknowns - size)])
        exact = factorised(system)(load)[:size]
        off = np.linalg.norm(iterative(body, TOLERANCE)(body.load) - exact)
        error = float(off / np.linalg.norm(exact))
        yield Finding(f"displacement, {method}, {name}, nu {nu:g}", error, LIMIT)
