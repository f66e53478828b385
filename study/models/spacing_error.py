"""Discretisation error of a lattice, from the same motion on a coarser one.

Contact is enforced at the facets of the lattice, and cells at the surface are cut, so the force on
a tool converges at first order. The coarser motion costs a sixteenth of the finer one. The order is
assumed and not observed, so the grid convergence index has the safety factor of 3: Roache (1994),
J. Fluids Eng. 116:405.

Under a tool as small as a cell the coarser force is two or three times the finer one, and an index
of their difference would be several times the force itself. A force has a sign and a lattice
multiplies it, so the same extrapolation is applied to its logarithm: with a coarser force 1 + d
times the finer one, the limit is (1 + d)^-1 times that, and with the safety factor (1 + d)^-3. For
small d this is the index of the difference.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from study.problem.problem import Problem
from study.problem.trajectory import Trajectory
from study.results.records import SpacingErrors
from study.similarity.fields import relative_l2_of_curves

Floats = NDArray[np.float64]

COARSER = 2.0
"""Spacing of the coarser lattice over that of the lattice whose error is estimated."""
ORDER = 1.0
"""Assumed order of convergence."""
CHANGE = 1.0 / (COARSER**ORDER - 1.0)
"""Richardson's estimate of the error over the change from the coarser lattice."""
SAFETY = 3.0
INDEX = SAFETY * CHANGE
"""Grid convergence index over that change. `reports/data/planned_tools.csv` shows how often it
covers the error."""
ESTIMATE = 1.5
"""Estimated error over Richardson's, where an error is compared with a requirement.

95 % of the errors are within twice the estimate that a plan makes of three lattices. It was chosen
by a random half of the scenes in `reports/data/planned_tools.csv`; the others check it.
"""
TINY = 1e-300


def spacing_errors(
    problem: Problem, spacing: float, coarse: Trajectory, fine: Trajectory
) -> SpacingErrors | None:
    """Errors of the finer of two lattices, of `spacing` [m] and COARSER times it.

    None where one of them did not finish.
    """
    if "diverged" in (coarse.status, fine.status):
        return None
    apart = relative_l2_of_curves(coarse.displacement - fine.displacement, fine.displacement)
    tools = [tool.name for tool in problem.rigid_tools]
    apart_force = force_differences(problem, coarse.tool_force, fine.tool_force)
    force = force_index(apart_force, _growth(problem, coarse.tool_force, fine.tool_force))
    peak = force.max(axis=0)  # two lattices may meet in a single number by chance
    return SpacingErrors(
        coarser_m=COARSER * spacing,
        order=ORDER,
        safety_factor=SAFETY,
        displacement=dict(zip(problem.probes, (INDEX * apart).tolist(), strict=True)),
        tool_force=dict(zip(tools, force[0].tolist(), strict=True)),
        peak_force=dict(zip(tools, peak.tolist(), strict=True)),
    )


def force_index(difference: Floats, growth: Floats) -> Floats:
    """Estimated error of forces, relative to the finer one, from their relative differences d.

    `growth`: share of the finer force that the coarser one exceeds it by. Where it is positive, the
    error is 1 - (1 + d)^-3, which is less than the whole force; where the force rises with
    refinement, no such bound exists, and it is 3 d.
    """
    falling = -np.expm1(-INDEX * np.log1p(difference))
    return np.asarray(np.where(growth > 0.0, falling, INDEX * difference))


def _growth(problem: Problem, coarse: Floats, fine: Floats) -> Floats:
    """Relative growth (2, tools) of forces [N] (samples, tools, 3) with coarsening.

    Of their component along the finer force over time, and of the largest force along the axis.
    """
    found = np.zeros((2, len(problem.rigid_tools)))
    for i, tool in enumerate(problem.rigid_tools):
        a, b = coarse[:, i], fine[:, i]
        found[0, i] = float((a * b).sum()) / max(float((b * b).sum()), TINY) - 1.0
        most = float(np.abs(b @ tool.axis).max())
        found[1, i] = (float(np.abs(a @ tool.axis).max()) - most) / max(most, TINY)
    return found


def force_differences(problem: Problem, one: Floats, other: Floats) -> Floats:
    """Relative differences (2, tools) of forces [N] (samples, tools, 3).

    In L2 over time, and of the largest force along each tool's axis.
    """
    found = np.zeros((2, len(problem.rigid_tools)))
    for i, tool in enumerate(problem.rigid_tools):
        a, b = one[:, i], other[:, i]
        found[0, i] = np.linalg.norm(a - b) / max(float(np.linalg.norm(b)), TINY)
        most = np.abs(b @ tool.axis).max()
        found[1, i] = abs(np.abs(a @ tool.axis).max() - most) / max(float(most), TINY)
    return found
