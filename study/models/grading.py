"""Meshes of the reference, refined where the error of the control points originates."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from fem_reference.elasticity import Body
from fem_reference.elements import ELEMENTS
from fem_reference.observation import at_points, evaluation
from fem_reference.recovery import goal_errors
from fem_reference.solvers import solver
from study.models.in_contact import contact_errors
from study.organ.geometry import MAX_TETRAHEDRA, Level
from study.organ.grading import graded
from study.problem.problem import Problem
from study.scene import Reference

Floats = NDArray[np.float64]

GROWTHS = (2.0, 2.8, 4.0)
"""Possible numbers of elements of a mesh over that of the previous one."""
GROWTH_IN_CONTACT = 2.0
"""Number of elements of a mesh over that of the previous one under moved tools.

Smaller, since the first mesh is already fine there.
"""
RESERVE = 1.25
"""Factor on the elements expected to suffice; one more mesh costs more than these."""
LEAST_GROWTH = 1.4
"""Smallest growth for which the difference of two meshes shows the error."""
STEERING = 1e-7
"""Residual of the solutions that locate the error.

Multigrid begins its set-up with random numbers, and the same elements should be chosen again.
"""


def is_graded(reference: Reference, problem: Problem) -> bool:
    """Whether meshes are refined where the error originates.

    `auto` refines so for organs from a mesh file, and under moved tools, which need small elements.
    """
    if reference.refinement == "auto":
        return problem.geometry.is_file or bool(problem.rigid_tools)
    return reference.refinement == "graded"


def growth_for(excess: float) -> float:
    """Least growth expected to reduce the stated error by the factor `excess`, or the largest.

    The error of the estimate falls with the order of the elements, 3, in the cube root of their
    number: as their number.
    """
    return next((one for one in GROWTHS if one >= RESERVE * excess), GROWTHS[-1])


def next_graded(
    problem: Problem, level: Level, body: Body, growth: float = GROWTHS[-1]
) -> Level | None:
    """A mesh with more elements, where the control points at rest need them; None if too large."""
    return next(next_graded_by(problem, level, body, (growth,)))


def next_graded_by(
    problem: Problem, level: Level, body: Body, growths: Sequence[float]
) -> Iterator[Level | None]:
    """The meshes of `next_graded` for several growths, whose errors are located once."""
    count = len(level.mesh.tetrahedra)
    largest = 0.9 * MAX_TETRAHEDRA / count
    if largest < LEAST_GROWTH:
        yield None
        return
    errors = (contact_errors if problem.rigid_tools else probe_errors)(problem, body)
    order = 2.0 * (ELEMENTS[body.element].formal_order - 1.0)
    for growth in (GROWTH_IN_CONTACT,) if problem.rigid_tools else growths:
        yield graded(problem.geometry, level, errors, order, min(growth, largest))


def probe_errors(problem: Problem, body: Body) -> Floats:
    """Contribution of each cell (cells,) to the relative errors of all control points at rest."""
    solve = solver(body, STEERING)
    u = solve(body.whole_load)
    at_probes = evaluation(body, problem.observation.probes)
    goals = [
        np.outer(row.toarray().ravel(), moved / np.linalg.norm(moved)).ravel()
        for row, moved in zip(at_probes, at_points(at_probes, u), strict=True)
        if moved.any()
    ]
    return goal_errors(body, problem.tissue, solve, u, goals, problem.geometry.project)
