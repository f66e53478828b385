"""Large strain at rest: a pressed column by its closed form, to where the law itself gives way.

At Poisson ratio 0 nothing moves sideways, and a column between smooth walls has the nominal stress
P of its stretch alone: (E / 2) (L - 1 / L) neo-Hookean, (E / 2) (L^2 - 1) L of St. Venant and
Kirchhoff, which falls beyond E / (3 sqrt 3).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.sparse import csc_array, diags_array

from fem_reference.elasticity import Body, discretise
from fem_reference.hyperelasticity import solid
from fem_reference.newton import SMALLEST_INCREMENT, TOLERANCE, solve
from study.known.stability.bodies import DOWN
from study.known.stability.case import Case
from study.known.stability.finding import Finding, value
from study.organ.block import block_mesh
from study.problem.contact import Foundation, ToolPatch
from study.problem.tissue import Tissue

EDGE, CELL = 0.04, 0.02
FOUNDATION, WIDE = 1e9, 1e6
"""[Pa/m], so stiff that the base hardly sinks; radius [m] of a tool of uniform pressure."""
TISSUE = Tissue(youngs_modulus=5e3, poisson_ratio=0.0)
GIVES_WAY = 1.0 / (3.0 * np.sqrt(3.0))
"""Largest pressure over E that St. Venant and Kirchhoff's law withstands."""
SOLVED = 1e-5
"""TOLERANCE times what a stiffness that has softened by the stretch makes of it."""
HERE = "study.known.stability.cases.large_strain"


def cases() -> Iterator[Case]:
    """Pressures over E, negative where the column is pulled; loads that cannot be."""
    for pressure in (1e-6, 0.1, 0.5, 2.0, 10.0, -0.5, -2.0):
        settings = {"law": "neo-hookean", "pressure": pressure}
        yield _case(f"stretch at {pressure:g} E: neo-hookean", "stretch", settings, SOLVED)
    for pressure in (0.1, 0.19, -0.5):
        settings = {"law": "st-venant-kirchhoff", "pressure": pressure}
        yield _case(f"stretch at {pressure:g} E: st-venant-kirchhoff", "stretch", settings, SOLVED)
    for pressure in (0.2, 0.3, 1.0):
        title = f"load at giving way, {pressure:g} E asked: st-venant-kirchhoff"
        resolved = SMALLEST_INCREMENT * pressure / GIVES_WAY
        yield _case(title, "gives_way", {"pressure": pressure}, resolved)
    for force in (0.1, 1.0, 10.0, 30.0):
        yield _case(f"balance under a tool of {force:g} N", "balance", {"force": force}, TOLERANCE)
    refused: tuple[tuple[str, dict[str, Any], str], ...] = (
        ("a load factor of zero", {"factors": [0.0]}, "load_factors"),
        ("a load factor that is not a number", {"factors": [None]}, "load_factors"),
        ("an unknown law", {"law": "rubber"}, "law: 'rubber'"),
        ("elements with a pressure", {"element": "taylor-hood", "nu": 0.49}, "element 'p2'"),
    )
    for title, settings, says in refused:
        yield Case(
            family="large strain",
            name=title,
            function=f"{HERE}:asked",
            arguments=settings,
            expected="refused",
            says=says,
            quick=True,
        )


def _case(title: str, function: str, settings: dict[str, Any], tolerance: float) -> Case:
    return Case(
        family="large strain",
        name=title,
        function=f"{HERE}:{function}",
        arguments=settings,
        tolerance=tolerance,
        quick="balance" not in title,
    )


def stretch(law: str, pressure: float) -> Finding:
    """Stretch of the column under a pressure over E, or at the last stable rest before it."""
    body = _column(pressure)
    path = solve(body, TISSUE, law)
    told = path.failure and f"{path.failure}; compared at {path.reached:g} of it"
    if not path.converged:
        path = solve(body, TISSUE, law, (path.reached,))
    # Height of the top over that of the base, both by their mean.
    u = path.states[-1].displacement.reshape(-1, 3)
    top, base = (np.abs(body.points[:, 2] - z) < 1e-9 for z in (EDGE, 0.0))
    found = 1.0 + (u[top, 2].mean() - u[base, 2].mean()) / EDGE
    return value(_exact(law, pressure * path.reached), float(found), told)


def gives_way(pressure: float) -> Finding:
    """Pressure over E at the last stable rest, on the way to one that cannot be."""
    path = solve(_column(pressure), TISSUE, "st-venant-kirchhoff")
    if path.converged:
        return Finding("error", message="a rest beyond the largest pressure")
    return value(float(GIVES_WAY), path.reached * pressure, path.failure)


def balance(force: float) -> Finding:
    """Unbalanced force over the load, at the last rest under a small tool."""
    tool = ToolPatch(np.array([0.5 * EDGE, 0.5 * EDGE, EDGE]), DOWN, 0.02, force)
    tissue = Tissue(youngs_modulus=5e3, poisson_ratio=0.45)
    support = Foundation(DOWN, 0.0, 1e-3, 1e7)
    body = discretise(block_mesh((EDGE, EDGE, EDGE), CELL), tissue, support, tool, "p2")
    path = solve(body, tissue, "neo-hookean")
    failure = path.failure
    if not path.converged:
        path = solve(body, tissue, "neo-hookean", (path.reached,))
    last = path.states[-1]
    inner = solid(body, tissue).internal_force(last.displacement)
    off = np.linalg.norm(inner - last.load_factor * body.load) / np.linalg.norm(body.load)
    told = f"at {last.load_factor:g} of the load, strain {last.largest_strain:.2g}; {failure}"
    return value(0.0, float(off) / last.load_factor, told)


def asked(
    factors: list[float | None] = [1.0],  # noqa: B006 - read only
    law: str = "neo-hookean",
    element: str = "p2",
    nu: float = 0.0,
) -> Finding:
    """A path that cannot be begun."""
    tissue = replace(TISSUE, poisson_ratio=nu)
    given = tuple(float("nan") if factor is None else factor for factor in factors)
    path = solve(_column(0.1, element, tissue), tissue, law, given)
    return value(0.0, path.reached)


def _column(pressure: float, element: str = "p2", tissue: Tissue = TISSUE) -> Body:
    """A cube between smooth walls, by stiff springs that its exact solution leaves alone."""
    tool = ToolPatch(np.full(3, EDGE), DOWN, WIDE, pressure * TISSUE.youngs_modulus * EDGE**2)
    support = Foundation(DOWN, 0.0, 1e-3, FOUNDATION)
    body = discretise(block_mesh((EDGE, EDGE, EDGE), CELL), tissue, support, tool, element)
    x = body.points
    walls = ((x < 1e-9) | (x > EDGE - 1e-9)) & [True, True, False]
    springs = diags_array(np.where(walls, TISSUE.youngs_modulus * EDGE, 0.0).ravel())
    return replace(body, support=csc_array(body.support + springs))


def _exact(law: str, pressure: float) -> float:
    def excess(stretch: float) -> float:
        if law == "neo-hookean":
            return 0.5 * (stretch - 1.0 / stretch) + pressure
        return 0.5 * (stretch**2 - 1.0) * stretch + pressure

    shortest = 0.01 if law == "neo-hookean" else 1.0 / np.sqrt(3.0)
    return float(brentq(excess, shortest, 10.0, xtol=1e-15))
