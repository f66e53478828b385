"""What the reference does under tools that are moved: rest, where meshes are fine, force errors."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from fem_reference.contact.linear import ContactNotConvergedError
from fem_reference.contact.motion import at_peak
from fem_reference.dynamics import ORDER
from fem_reference.elasticity import Body
from fem_reference.error_estimate import discretisation_error, graded_error
from fem_reference.observation import at_points, evaluation
from fem_reference.recovery import goal_errors
from study.models.mesh_error import MeshSolution, formal_order
from study.organ.geometry import Level
from study.organ.grading import resolved
from study.problem.problem import Problem
from study.problem.rigid import PLATE, PUNCH
from study.problem.trajectory import Trajectory
from study.results.records import ContactRecord, ToolForceRecord

Floats = NDArray[np.float64]

TINY = 1e-300
ACROSS, ROUND = 1.4, 1.0
"""Longest edge under a tool over the radius of what it touches, and where that holds, likewise."""
PLACES = 33
HALF = 0.5
"""A tetrahedron reaches as far from its centre as this share of its longest edge, about."""


def resolving(problem: Problem, level: Level) -> Level:
    """A mesh fine enough to resolve the contact area, so that its error estimate is meaningful."""
    return resolved(problem.geometry, level, partial(_wanted, problem)) or level


def _wanted(problem: Problem, centres: Floats, longest: Floats) -> Floats:
    """Longest edge [m] (n,) of tetrahedra that have such centres (n, 3) and edges."""
    found = np.full(len(centres), np.inf)
    for tool in problem.rigid_tools:
        if tool.shape == PLATE:  # as wide as the body: its meshes show it
            continue
        times = problem.observation.times
        travel = tool.travel(times[:: max(1, len(times) // PLACES)])
        depth = max(float((travel @ tool.axis).max()), TINY)
        share = 1.0 if tool.shape == PUNCH else min(1.0, depth / tool.radius) ** 0.5
        radius = share * tool.radius
        away = _distance(centres, tool.tip + travel) - HALF * longest
        found = np.where(away < ROUND * radius, np.minimum(found, ACROSS * radius), found)
    return found


def _distance(points: Floats, places: Floats) -> Floats:
    """Distance [m] (n,) of points (n, 3) to the nearest of places (k, 3)."""
    return np.asarray(cKDTree(places).query(points)[0])


def rest_in_contact(problem: Problem, body: Body) -> Floats:
    """Displacement [m] (n,) with the tools where they are at the peak, and all loads in full."""
    return at_peak(body, problem.rigid_tools, problem.observation).displacement


def contact_errors(problem: Problem, body: Body) -> Floats:
    """Share of each cell (cells,) in the relative errors of forces and control points at rest.

    The forces under a tool are their own goal: their work is what the force does.
    """
    try:
        found = at_peak(body, problem.rigid_tools, problem.observation)
    except ContactNotConvergedError:  # the motion ends before, and what is fine makes no difference
        return np.asarray(body.nodes.dx.sum(axis=1))
    u = found.displacement
    seen = evaluation(body, problem.observation.probes)
    goals = [push for push in found.nodal_forces if abs(push @ u) > 0.0]
    goals += [
        np.outer(row.toarray().ravel(), moved / np.linalg.norm(moved)).ravel()
        for row, moved in zip(seen, at_points(seen, u), strict=True)
        if moved.any()
    ]
    if not goals:  # no tool touches anything at the peak
        return np.asarray(body.nodes.dx.sum(axis=1))
    project = problem.geometry.project
    return goal_errors(body, problem.tissue, found.solve, u, goals, project)


def contact_record(
    problem: Problem, solved: Sequence[MeshSolution], steps: Floats, *, graded: bool
) -> ContactRecord | None:
    """Record of the forces on the tools with their errors; None where no tool is moved.

    `steps` (tools,): relative L2 error of the forces by the steps.
    """
    outcome = solved[-1].found.contact
    if outcome is None:
        return None
    runs = [one.found.trajectory.tool_force for one in solved]
    estimate = graded_error if graded else discretisation_error
    sizes, order = [one.level.size for one in solved], formal_order(solved[-1])
    comparable = len(solved) > 1 and all(np.isfinite(run).all() for run in runs)
    forces = {}
    for i, tool in enumerate(problem.rigid_tools):
        histories = [run[:, i] for run in runs]
        touched = bool(np.nansum(np.abs(histories[-1])) > 0.0)
        forces[tool.name] = ToolForceRecord(
            peak_n=float(np.nanmax(np.linalg.norm(histories[-1], axis=1))),
            by_mesh=estimate(histories, sizes, order).error if comparable and touched else None,
            by_steps=float(steps[i]) if len(steps) else None,
            by_subspace=None if outcome.vectors is None else float(outcome.force_truncation[i]),
        )
    return ContactRecord(
        vertices=outcome.vertices, penetration_m=outcome.penetration, forces=forces
    )


def force_step_errors(whole: Trajectory, half: Trajectory) -> Floats:
    """Relative L2 errors of the tools' forces (tools,) by whole steps, none if either diverged."""
    if whole.status != "finished" or half.status != "finished":
        return np.zeros(0)
    share = 1.0 / (1.0 - 0.5**ORDER)
    size = np.maximum(np.linalg.norm(half.tool_force, axis=(0, 2)), TINY)
    off = np.linalg.norm(whole.tool_force - half.tool_force, axis=(0, 2))
    return np.asarray(share * off / size)
