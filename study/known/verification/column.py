"""A column on an elastic foundation under uniform pressure, between walls and with free sides."""

from __future__ import annotations

from collections.abc import Iterator

from fem_reference.elements import ELEMENTS, ElementName
from fem_reference.solvers import solve_static
from study.known.finding import Finding, error_of
from study.known.pressed import COLUMN, between_walls, column, exact_column
from study.known.verification.moduli import oedometric, rounding
from study.known.verification.solid import largest_error
from study.organ.block import block_mesh
from study.problem.tissue import Tissue

RATIOS = (0.3, 0.4999)
ITERATED = 1e-9
"""A residual of 1e-10 of the load, and some ten times that in the displacement."""


def walled() -> Iterator[Finding]:
    """Displacement between walls, by factors."""
    for name in ELEMENTS:
        for nu in RATIOS:
            tissue = Tissue(poisson_ratio=nu)
            body = column(block_mesh(COLUMN, 0.02), tissue, name)
            exact = exact_column(body.points, oedometric(tissue))
            error = largest_error(between_walls(body).ravel(), exact)
            yield error_of(f"displacement, {name}, nu {nu:g}", error, rounding(tissue))


def free() -> Iterator[Finding]:
    """Displacement with free sides, as scenes are solved: factors, two iterative solvers."""
    tissue = Tissue(poisson_ratio=0.0)
    cases: tuple[tuple[ElementName, float], ...] = (("p2", 0.02), ("p2", 0.008), ("p1", 0.002))
    for name, cell in cases:
        body = column(block_mesh(COLUMN, cell), tissue, name)
        exact = exact_column(body.points, tissue.youngs_modulus)
        error = largest_error(solve_static(body), exact)
        yield error_of(f"displacement, {name}, nu 0, {body.unknowns} unknowns", error, ITERATED)
