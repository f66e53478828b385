"""Large displacements added to the linear reference, from corrected lattices.

The displacement of a corrected lattice less that of the same elements alone is the effect of
geometric nonlinearity. Added to the reference it gives what all models are compared with where the
place of the load is known. Its error follows from a second lattice with a smaller fine region.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from study.run.scene_problem import SceneProblem
from study.similarity.fields import relative_l2, relative_l2_of_curves
from study.sweep.canonical import restored
from study.sweep.runner import Outcome
from study.tradeoff.observation import Observed
from study.tradeoff.reference import ReferenceSolution

Floats = NDArray[np.float64]


def with_large_displacements(
    known: ReferenceSolution, linear: Outcome, near: Outcome, far: Outcome, given: SceneProblem
) -> ReferenceSolution | None:
    """The reference with geometric nonlinearity, None where one of the runs did not finish.

    `linear`: elements alone; `near` and `far`: corrected by lattices, the second with a larger fine
    region.
    """
    seen = [_seen(one, known) for one in (linear, near, far)]
    if any(one is None for one in seen):
        return None
    (field, curves), (field_near, curves_near), (field_far, curves_far) = (
        one for one in seen if one is not None
    )
    whole, moved = known.field + field_far - field, known.curves + curves_far - curves
    volumes = given.problem.volume_rule.weights
    own = relative_l2(whole + field_near - field_far, whole, volumes)
    apart = relative_l2_of_curves(curves_near - curves_far, moved)
    return ReferenceSolution(whole, moved, known.field_error + own, known.curve_errors + apart)


def _seen(outcome: Outcome, known: ReferenceSolution) -> tuple[Floats, Floats] | None:
    """Field and curves of a run, None where it did not finish."""
    if outcome.value is None:
        return None
    found = restored(Observed, outcome.value)
    if found.field is None or found.curves is None:
        return None
    return np.reshape(found.field, (-1, 3)), np.reshape(found.curves, known.curves.shape)
