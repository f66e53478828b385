"""A scene of which only the state at rest is required, solved under the full load."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem_reference.elasticity import Body
from fem_reference.elements import ELEMENTS
from fem_reference.error_estimate import discretisation_error
from fem_reference.observation import at_points, evaluation
from fem_reference.solvers import solve_static
from study.mesh.kinds import TetrahedralMesh
from study.models.finite_elements import reference_of
from study.plan.look import LatticeLook, lattice_at_rest, on_lattice
from study.plan.prediction import NONLINEAR_ORDER
from study.problem.problem import Problem
from study.results.rest import RestRow
from study.scene import Scene
from study.scene.problem import problem_of
from study.system.progress import Progress

Floats = NDArray[np.float64]

LEVELS = (-2, -1, 0)
"""Mesh levels, the last one the scene's own; the coarser ones, where they exist, give its error."""
COARSE = 2.0
"""Spacing of the lattice that gives the error of the nonlinear part, over that of the scene."""


@dataclass(frozen=True)
class AtRest:
    """The control points at rest, and the linear displacement [m] (n, 3) of a mesh's vertices."""

    rows: tuple[RestRow, ...]
    mesh: TetrahedralMesh
    displacement: Floats


@dataclass(frozen=True)
class _Solved:
    """Finite elements at rest: element sizes, coarse to fine, and displacements [m] (p, 3)."""

    body: Body
    u: Floats
    sizes: tuple[float, ...]
    probes: tuple[Floats, ...]


def rest_of(scene: Scene, progress: Progress, *, large: bool) -> AtRest:
    """Solve a scene at rest, with large displacements (`large`) or linear.

    ValueError for a support or tool that misses the organ, or a lattice that has no rest state.
    """
    with progress.stage("organ"):
        problem = problem_of(scene)
    with progress.stage("finite elements at rest"):
        solved = _solved(scene, problem)
    with progress.stage("lattices at rest"):
        coarse, fine = (
            lattice_at_rest(on_lattice(scene, problem, times)) for times in (COARSE, 1.0)
        )
    change, left = _large_displacements(coarse, fine, large=large)
    rows = tuple(_rows(problem, solved, change, left))
    vertices = at_points(evaluation(solved.body, solved.body.mesh.points), solved.u)
    return AtRest(rows, solved.body.mesh, vertices)


def _solved(scene: Scene, problem: Problem) -> _Solved:
    probes, sizes, body, u = [], [], None, np.zeros(0)
    for k in LEVELS:
        level = problem.geometry.level(k)
        if level is None:
            continue
        body = reference_of(scene).prepare(problem).body(level)
        u = solve_static(body)
        probes.append(at_points(evaluation(body, problem.observation.probes), u))
        sizes.append(level.size)
    assert body is not None  # noqa: S101 - the organ has the mesh of level 0
    return _Solved(body, u, tuple(sizes), tuple(probes))


def _large_displacements(
    coarse: LatticeLook, fine: LatticeLook, *, large: bool
) -> tuple[Floats, Floats]:
    """Effect of large displacements [m] (p, 3), and the error [m] (p,) that remains."""
    if coarse.nonlinear is None or fine.nonlinear is None:
        raise ValueError(
            "the lattice finds no equilibrium under the full load; reduce tool.force or enlarge "
            "tool.radius"
        )
    before, change = (
        one.probes - linear.probes
        for one, linear in ((coarse.nonlinear, coarse.linear), (fine.nonlinear, fine.linear))
    )
    left = np.linalg.norm(change - before, axis=1) / (COARSE**NONLINEAR_ORDER - 1.0)
    if large:
        return change, left
    return np.zeros_like(change), np.linalg.norm(change, axis=1) + left


def _rows(problem: Problem, solved: _Solved, change: Floats, left: Floats) -> Iterator[RestRow]:
    formal = ELEMENTS[solved.body.element].formal_order
    found = solved.probes[-1] + change
    for i, name in enumerate(problem.probes):
        mesh = None
        if len(solved.sizes) > 1:
            results = [probes[[i]] for probes in solved.probes]
            mesh = discretisation_error(results, solved.sizes, formal).error
        size = float(np.linalg.norm(found[i]))
        x, y, z = map(float, found[i])
        push = float(found[i] @ problem.tool.direction)
        yield RestRow(name, x, y, z, push, mesh, float(left[i]) / size)
