"""The error of a lattice by its spacing: what a coarser one, or several, tell of it.

Points of the surface stop at a tool where facets of the lattice are, and cells at the surface are
cut: the force on a tool converges at first order. A motion of the coarser lattice costs a sixteenth
of one of the finer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from study.problem.problem import Problem
from study.problem.trajectory import Trajectory
from study.results.records import SpacingErrors
from study.similarity.fields import relative_l2_of_curves

Floats = NDArray[np.float64]

COARSER = 2.0
"""Spacing of the lattice that tells the error, times that of the one whose error it is."""
ORDER = 1.0
"""Assumed of two lattices. Estimates so are 0.5 to 2.7 times the error: docs/tools.md."""
ORDERS = (0.5, 1.5)
"""Between which a fit seeks one: beyond, lattices are too coarse to show any."""
TINY = 1e-300


def spacing_errors(
    problem: Problem, spacing: float, coarse: Trajectory, fine: Trajectory
) -> SpacingErrors | None:
    """Errors of the finer of two lattices, of `spacing` [m] and COARSER times it.

    None where one of them did not finish.
    """
    if "diverged" in (coarse.status, fine.status):
        return None
    share = 1.0 / (COARSER**ORDER - 1.0)
    apart = relative_l2_of_curves(coarse.displacement - fine.displacement, fine.displacement)
    tools = [tool.name for tool in problem.rigid_tools]
    force = share * force_differences(problem, coarse.tool_force, fine.tool_force)
    return SpacingErrors(
        coarser_m=COARSER * spacing,
        order=ORDER,
        displacement=dict(zip(problem.probes, (share * apart).tolist(), strict=True)),
        tool_force=dict(zip(tools, force[0].tolist(), strict=True)),
        peak_force=dict(zip(tools, force[1].tolist(), strict=True)),
    )


def force_differences(problem: Problem, one: Floats, other: Floats) -> Floats:
    """Relative differences (2, tools) of forces [N] (samples, tools, 3) from others.

    In L2 over time, and of the largest along each tool's axis.
    """
    found = np.zeros((2, len(problem.rigid_tools)))
    for i, tool in enumerate(problem.rigid_tools):
        a, b = one[:, i], other[:, i]
        found[0, i] = np.linalg.norm(a - b) / max(float(np.linalg.norm(b)), TINY)
        most = np.abs(b @ tool.axis).max()
        found[1, i] = abs(np.abs(a @ tool.axis).max() - most) / max(float(most), TINY)
    return found


@dataclass(frozen=True)
class SpacingFit:
    """Errors C h^p of lattices of spacing h [m]; `spread` of those fitted, as a share.

    That is their standard deviation from the fit in logarithms.
    """

    constant: float
    order: float
    spread: float

    def error(self, spacing: float) -> float:
        """Of a lattice of a spacing [m]."""
        return float(self.constant * spacing**self.order)


def fitted_to_finest(
    spacings: Sequence[float], differences: Sequence[float], finest: float
) -> SpacingFit:
    """By least squares from differences C (h^p - h_f^p) from a lattice of the `finest` spacing [m].

    ValueError with fewer than three that differ, which do not tell an order.
    """
    pairs = zip(spacings, differences, strict=True)
    h, apart = np.array([(h, d) for h, d in pairs if d > 0.0 and h > finest]).reshape(-1, 2).T
    if len(h) < 3:
        raise ValueError(
            f"only {len(h)} lattices differ from the finest of {1e3 * finest:.3g} mm, and three "
            "tell an order of convergence; enlarge lattice.spacing"
        )

    def levels(order: float) -> Floats:
        return np.asarray(np.log(apart) - np.log(h**order - finest**order))

    found = minimize_scalar(lambda p: float(np.var(levels(p))), bounds=ORDERS, method="bounded")
    order = float(found.x)
    left = levels(order) - levels(order).mean()
    deviation = float(np.sqrt((left**2).sum() / max(len(h) - 2, 1)))
    return SpacingFit(float(np.exp(levels(order).mean())), order, deviation)
