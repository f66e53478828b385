"""How far a linear reference can be trusted: the same body at large strain."""

from __future__ import annotations

from fem_reference.elasticity import Body
from fem_reference.newton import solve
from fem_reference.observation import at_points, evaluation
from fem_reference.solvers import solve_static
from study.problem.problem import Problem
from study.results.records import LargeStrain
from study.similarity.fields import relative_l2


def compare(problem: Problem, body: Body, law: str) -> LargeStrain | str:
    """What finite strain changes at rest under the full load, or why that is not known.

    What the mesh costs either solution is not estimated: near a small tool the difference still
    grows as the mesh is refined. Elements with a pressure of their own keep it.
    """
    try:
        path = solve(body, problem.tissue, law)
    except ValueError as error:
        return str(error)
    if not path.converged:
        return f"{path.failure} (reached {100 * path.reached:.0f} % of the load)"
    state, seen = path.states[-1], evaluation(body, problem.observation.volume_points)
    linear, finite = (at_points(seen, u) for u in (solve_static(body), state.displacement))
    return LargeStrain(
        law=law,
        field_difference=relative_l2(linear, finite, problem.volume_rule.weights),
        largest_strain=state.largest_strain,
        unknowns=body.unknowns,
    )
