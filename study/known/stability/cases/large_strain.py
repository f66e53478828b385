"""Large strain at rest: a compressed column in closed form, up to the instability of the law.

At Poisson ratio 0 there is no lateral motion, and the nominal stress P of a column between smooth
walls depends on its stretch L alone: (E / 2) (L - 1 / L) for the neo-Hookean law, (E / 2) (L^2 - 1)
L for St. Venant and Kirchhoff's, which has its maximum at E / (3 sqrt 3).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.sparse import csc_array, diags_array

from fem_reference.elasticity import Body
from fem_reference.hyperelasticity import solid
from fem_reference.newton import INCREMENTS, TOLERANCE, solve
from study.known import pressed
from study.known.case import Case, Family
from study.known.finding import Finding, value
from study.organ.block import block_mesh
from study.problem.contact import ToolPatch
from study.problem.tissue import Tissue

EDGE, CELL = 0.04, 0.02
FOUNDATION = 1e9
"""[Pa/m], so stiff that the base hardly moves."""
TISSUE = Tissue(youngs_modulus=5e3, poisson_ratio=0.0)
STABILITY_LIMIT = 1.0 / (3.0 * np.sqrt(3.0))
"""Largest pressure over E that St. Venant and Kirchhoff's law can carry."""
SOLVED = 1e-5
"""Error of the displacement: TOLERANCE, amplified by the softened tangent stiffness."""
FAMILY = Family("large strain", __name__)


def cases() -> Iterator[Case]:
    """Cases of a column by pressure over E, negative for tension, and of inadmissible loads."""
    for pressure in (1e-6, 0.1, 0.5, 2.0, 10.0, -0.5, -2.0):
        settings = {"law": "neo-hookean", "pressure": pressure}
        yield FAMILY.case(
            f"stretch at {pressure:g} E: neo-hookean", "stretch", settings, SOLVED, quick=True
        )
    for pressure in (0.1, 0.19, -0.5):
        settings = {"law": "st-venant-kirchhoff", "pressure": pressure}
        yield FAMILY.case(
            f"stretch at {pressure:g} E: st-venant-kirchhoff",
            "stretch",
            settings,
            SOLVED,
            quick=True,
        )
    for pressure in (0.2, 0.3, 1.0):
        title = f"load at loss of stability, {pressure:g} E asked: st-venant-kirchhoff"
        resolved = INCREMENTS.smallest * pressure / STABILITY_LIMIT
        yield FAMILY.case(title, "loss_of_stability", {"pressure": pressure}, resolved, quick=True)
    for force in (0.1, 1.0, 10.0, 30.0):
        yield FAMILY.case(
            f"equilibrium under a tool of {force:g} N", "equilibrium", {"force": force}, TOLERANCE
        )
    refused: tuple[tuple[str, dict[str, Any], str], ...] = (
        ("a load factor of zero", {"factors": [0.0]}, "load_factors"),
        ("a load factor that is not a number", {"factors": [None]}, "load_factors"),
        ("an unknown law", {"law": "rubber"}, "law: 'rubber'"),
        (
            "another law on elements with a pressure",
            {"element": "taylor-hood", "nu": 0.49, "law": "st-venant-kirchhoff"},
            "give neo-hookean",
        ),
    )
    for title, settings, says in refused:
        yield FAMILY.case(title, "asked", settings, says)


def stretch(law: str, pressure: float) -> Finding:
    """Stretch of the column under a pressure over E, or at the last stable state before it."""
    body = _column(pressure)
    path = solve(body, TISSUE, law)
    message = path.failure and f"{path.failure}; compared at {path.reached:g} of it"
    if not path.converged:
        path = solve(body, TISSUE, law, (path.reached,))
    # Mean height of the top minus mean height of the base.
    u = path.states[-1].displacement.reshape(-1, 3)
    top, base = (np.abs(body.points[:, 2] - z) < 1e-9 for z in (EDGE, 0.0))
    found = 1.0 + (u[top, 2].mean() - u[base, 2].mean()) / EDGE
    return value(_exact(law, pressure * path.reached), float(found), message)


def loss_of_stability(pressure: float) -> Finding:
    """Pressure over E at the last stable state, on the path to an inadmissible one."""
    path = solve(_column(pressure), TISSUE, "st-venant-kirchhoff")
    if path.converged:
        return Finding("error", message="an equilibrium beyond the largest pressure")
    return value(float(STABILITY_LIMIT), path.reached * pressure, path.failure)


def equilibrium(force: float) -> Finding:
    """Residual force over the load, at the last state under a small tool."""
    tool = ToolPatch(np.array([0.5 * EDGE, 0.5 * EDGE, EDGE]), pressed.DOWN, 0.02, force)
    tissue = Tissue(youngs_modulus=5e3, poisson_ratio=0.45)
    body = pressed.on_base(block_mesh((EDGE, EDGE, EDGE), CELL), tissue, "p2", 1e7, tool)
    path = solve(body, tissue, "neo-hookean")
    failure = path.failure
    if not path.converged:
        path = solve(body, tissue, "neo-hookean", (path.reached,))
    last = path.states[-1]
    inner = solid(body, tissue).internal_force(last.displacement)
    off = np.linalg.norm(inner - last.load_factor * body.load) / np.linalg.norm(body.load)
    message = f"at {last.load_factor:g} of the load, strain {last.largest_strain:.2g}; {failure}"
    return value(0.0, float(off) / last.load_factor, message)


def asked(
    factors: list[float | None] = [1.0],  # noqa: B006 - read only
    law: str = "neo-hookean",
    element: str = "p2",
    nu: float = 0.0,
) -> Finding:
    """A path of large strain that cannot be started."""
    tissue = replace(TISSUE, poisson_ratio=nu)
    given = tuple(float("nan") if factor is None else factor for factor in factors)
    path = solve(_column(0.1, element, tissue), tissue, law, given)
    return value(0.0, path.reached)


def _column(pressure: float, element: str = "p2", tissue: Tissue = TISSUE) -> Body:
    """A cube between smooth walls, by stiff springs that its exact solution does not strain."""
    load = pressure * TISSUE.youngs_modulus
    body = pressed.column(block_mesh((EDGE, EDGE, EDGE), CELL), tissue, element, FOUNDATION, load)
    held = np.where(pressed.walls(body.points), TISSUE.youngs_modulus * EDGE, 0.0)
    springs = diags_array(held.ravel())
    return replace(body, support=csc_array(body.support + springs))


def _exact(law: str, pressure: float) -> float:
    def excess(stretch: float) -> float:
        if law == "neo-hookean":
            return 0.5 * (stretch - 1.0 / stretch) + pressure
        return 0.5 * (stretch**2 - 1.0) * stretch + pressure

    shortest = 0.01 if law == "neo-hookean" else 1.0 / np.sqrt(3.0)
    return float(brentq(excess, shortest, 10.0, xtol=1e-15))
