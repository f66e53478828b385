"""The discretisation error of the finite elements, from solutions on several meshes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fem_reference import model as fem
from fem_reference.elasticity import Body, Outline
from fem_reference.elements import ELEMENTS
from fem_reference.error_estimate import ErrorEstimate, discretisation_error, graded_error
from fem_reference.observation import carried
from fem_reference.superposition import CurveChange
from study.organ.geometry import Level
from study.problem.problem import Problem
from study.results.records import CurveErrors, CurveOrders, DiscretisationError

Floats = NDArray[np.float64]

LARGEST_JUMP = 0.6
"""Largest step between element sizes: sizes far apart do not show the order."""
LINEAR_LOCKING = 0.4
"""Poisson ratio above which linear elements lock on any mesh that is practical here."""


@dataclass(frozen=True)
class MeshSolution:
    """The reference on one mesh; `body` has no matrices once a finer mesh is to be solved."""

    level: Level
    body: Body | Outline
    found: fem.Solution

    @property
    def outlined(self) -> MeshSolution:
        """The solution without the matrices of its body."""
        return replace(self, body=self.body.outline) if isinstance(self.body, Body) else self

    def near(self, body: Body) -> Floats | None:
        """Starting vectors (n, k) for a superposition on another mesh; None for time steps."""
        superposed = self.found.superposed
        return None if superposed is None else carried(superposed.subspace.vectors, self.body, body)


def mesh_error(
    problem: Problem, solved: Sequence[MeshSolution], *, graded: bool = False
) -> DiscretisationError | None:
    """Errors of the finest mesh by those before it; none of one mesh, or of elements that lock.

    Nor are there any of a motion that ended early.

    `graded`: the meshes are refined where the error is, not everywhere alike. Locked elements
    approach a wrong solution for long, and seem to have converged. A subspace's truncation is added
    in squares to the errors of curves.
    """
    runs = [one.found.trajectory for one in solved]
    diverged = any(run.status != "finished" for run in runs)
    if len(solved) < 2 or locks(problem, solved[-1]) or diverged:
        return None
    weights = problem.volume_rule.weights
    field = _estimate(solved, [run.volume_field[0] for run in runs], weights, graded=graded)
    by_probe, orders = {}, {}
    for i, probe in enumerate(problem.probes):
        u = _estimate(solved, [run.displacement[:, i] for run in runs], graded=graded)
        v = _estimate(solved, [run.velocity[:, i] for run in runs], graded=graded)
        left = _truncation(solved[-1])
        by_probe[probe] = CurveErrors(
            displacement=math.hypot(u.error, left.displacement),
            velocity=math.hypot(v.error, left.velocity),
        )
        orders[probe] = CurveOrders(displacement=u.observed, velocity=v.observed)
    return DiscretisationError(
        field_peak=field.error,
        field_order=field.observed,
        formal_order=formal_order(solved[-1]),
        by_probe=by_probe,
        order_by_probe=orders,
    )


def _estimate(
    solved: Sequence[MeshSolution],
    results: Sequence[Floats],
    weights: Floats | None = None,
    *,
    graded: bool,
) -> ErrorEstimate:
    sizes, order = [one.level.size for one in solved], formal_order(solved[-1])
    if graded:
        return graded_error(results, sizes, order, weights)
    return discretisation_error(results, sizes, order, weights)


def formal_order(solved: MeshSolution) -> float:
    """The elements' formal order of convergence."""
    return ELEMENTS[solved.found.element].formal_order


def _truncation(solved: MeshSolution) -> CurveChange:
    return solved.found.truncation or CurveChange(0.0, 0.0)


def locks(problem: Problem, solved: MeshSolution) -> bool:
    """Whether the elements lock at the tissue's Poisson ratio."""
    return solved.found.element == "p1" and problem.tissue.poisson_ratio > LINEAR_LOCKING


def is_too_coarse(accuracy: float | None, error: DiscretisationError | None) -> bool:
    """Whether a requested accuracy is missed, or not known to be reached."""
    return accuracy is not None and (error is None or error.worst.displacement > accuracy)


def next_size(accuracy: float | None, error: DiscretisationError | None) -> float:
    """Element size at which the accuracy is expected, over the last one."""
    if error is None or accuracy is None:
        return 1.0
    excess = error.worst.displacement / accuracy
    highest = max(one.formal_order for one in ELEMENTS.values())
    return float(max(excess ** (-1.0 / highest), LARGEST_JUMP))


def why_unknown(problem: Problem, solved: MeshSolution) -> str:
    """Why the error cannot be estimated."""
    if locks(problem, solved):
        return (
            "linear elements lock at this Poisson ratio and seem to have converged when they have "
            "not; leave reference.element out"
        )
    if solved.found.trajectory.status != "finished":
        return "its motion was not found to the end"
    return "it has no other mesh of this organ to compare with"
