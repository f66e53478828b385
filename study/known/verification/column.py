"""A column on an elastic foundation under uniform pressure p: its displacement is linear.

Over a foundation of k [Pa/m] the base sinks by p / k (Winkler, 1867), and above it the strain is
p over the modulus: Young's if the sides are free and nu = 0, lambda + 2 mu between smooth walls.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fem_reference.elasticity import Body, discretise
from fem_reference.elements import ELEMENTS, ElementName
from fem_reference.solvers import solve_static
from study.known.verification.finding import Finding
from study.known.verification.moduli import oedometric, rounding
from study.known.verification.solid import at_rest, free_everywhere, largest_error
from study.organ.block import block_mesh
from study.problem.contact import Foundation, ToolPatch
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]

SIZE = (0.04, 0.04, 0.06)
FOUNDATION = 5e5
"""[Pa/m]"""
PRESSURE = 200.0
"""[Pa]"""
DOWN = np.array([0.0, 0.0, -1.0])
RATIOS = (0.3, 0.4999)
ITERATED = 1e-9
"""A residual of 1e-10 of the load, and some ten times that in the displacement."""
WIDE = 1e6
"""Radius [m] of a tool whose pressure is uniform over the column, to rounding."""


def walled() -> Iterator[Finding]:
    """Between walls, by factors."""
    for name in ELEMENTS:
        for nu in RATIOS:
            tissue = Tissue(poisson_ratio=nu)
            body = _body(name, tissue, 0.02)
            x = body.points
            walls = ((x < 1e-9) | (x > np.array(SIZE) - 1e-9)) & [True, True, False]
            prescribed = np.where(walls, 0.0, free_everywhere(x))
            u = at_rest(body.stiffness, body.load, prescribed)
            error = largest_error(u, _exact(x, oedometric(tissue)))
            yield Finding(f"displacement, {name}, nu {nu:g}", error, rounding(tissue))


def free() -> Iterator[Finding]:
    """With free sides, as a scene is solved: factors, conjugate gradients, and multigrid."""
    tissue = Tissue(poisson_ratio=0.0)
    cases: tuple[tuple[ElementName, float], ...] = (("p2", 0.02), ("p2", 0.008), ("p1", 0.002))
    for name, cell in cases:
        body = _body(name, tissue, cell)
        error = largest_error(solve_static(body), _exact(body.points, tissue.youngs_modulus))
        yield Finding(f"displacement, {name}, nu 0, {body.unknowns} unknowns", error, ITERATED)


def _body(name: ElementName, tissue: Tissue, cell: float) -> Body:
    force = PRESSURE * SIZE[0] * SIZE[1]
    tool = ToolPatch(np.array(SIZE), DOWN, WIDE, force)
    support = Foundation(DOWN, 0.0, 1e-3, FOUNDATION)
    return discretise(block_mesh(SIZE, cell), tissue, support, tool, name)


def _exact(x: Floats, modulus: float) -> Floats:
    sunk = PRESSURE / FOUNDATION + PRESSURE / modulus * x[:, 2:]
    return np.asarray(sunk * DOWN)
