"""How far a linear reference can be trusted: the same body at large strain."""

from __future__ import annotations

from typing import Any

from fem_reference.elasticity import Body
from fem_reference.elements import LOCKING
from fem_reference.newton import solve
from fem_reference.observation import at_points, evaluation
from fem_reference.solvers import solve_static
from study.problem.problem import Problem
from study.progress import Progress
from study.run.outcome import ROTATION_LIMIT, STRAIN_LIMIT, Outcome
from study.scene import Scene
from study.similarity.fields import relative_l2


def compare_large_strain(
    scene: Scene,
    posed: Problem,
    body: Body,
    outcome: Outcome,
    record: dict[str, Any],
    progress: Progress,
) -> None:
    """Record what finite strain changes at rest under the full load, where strains are large.

    Linear and hyperelastic solution are taken on the scene's own mesh. What that mesh costs them is
    not estimated: near a small tool the difference still grows as the mesh is refined.
    """
    law = scene.reference.large_strain
    small = record["largest_strain"] <= STRAIN_LIMIT
    if law == "none" or (small and record["largest_rotation"] <= ROTATION_LIMIT):
        return
    with progress.stage(f"fem: {law}"):
        found = _difference(scene, posed, body, law)
    if isinstance(found, str):
        outcome.notes.append(f"No {law} solution at the peak load: {found}.")
    else:
        record["hyperelastic"] = found


def _difference(scene: Scene, posed: Problem, body: Body, law: str) -> dict[str, Any] | str:
    """The comparison, or why there is none."""
    if body.element == "taylor-hood":
        return f"elements without a pressure lock at a Poisson ratio above {LOCKING:g}"
    try:
        path = solve(body, scene.tissue, law)
    except ValueError as error:
        return str(error)
    if not path.converged:
        return f"{path.failure} (reached {100 * path.reached:.0f} % of the load)"
    state, seen = path.states[-1], evaluation(body, posed.observation.volume_points)
    linear, finite = (at_points(seen, u) for u in (solve_static(body), state.displacement))
    return {
        "law": law,
        "field_difference": relative_l2(linear, finite, posed.volume_rule.weights),
        "largest_strain": state.largest_strain,
        "unknowns": body.unknowns,
    }
