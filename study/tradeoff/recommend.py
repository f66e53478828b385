"""The configuration that meets a demand on this machine: predicted by a fit, then run and timed.

Candidates are explicit lattices by spacing and precision, with the volume term where the tissue's
Poisson ratio needs it. Errors are computed at a few coarse spacings and fitted by C h^p; the error
added by single precision is measured at the finest of them; every candidate is timed. For a rate
alone the most accurate real-time candidate is recommended, for an error the cheapest whose
predicted error is small enough. A prediction includes the spread of the fit, the reference's own
error and the error of the precision. The recommended configuration is then run and timed anew, and
the next one is taken if it does not keep up after all.

Where the place of the load, or its path, is known beforehand, models that depend on it are
candidates too: Ritz vectors of a single load, graded lattices, and lattices of either kind
corrected by finite elements. There are few of them, and the predicted error of each is that of a
run of it, or the reference's own error if that is larger. All are then compared with the reference
with large displacements, `study.tradeoff.large_displacements`.

Under moved tools the criterion is the error of their force over time. Against the finest lattice of
the same springs every spacing is run, since contact errors vary irregularly with the placement of
cells; the predicted error is the measured one plus that of the finest lattice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from study.scene import Scene
from study.tradeoff import study
from study.tradeoff.candidates import (
    Candidate,
    best,
    frame_at,
    lattice_candidates,
    lattice_configuration,
    place_dependent_candidates,
    place_dependent_runs,
    timed,
)
from study.tradeoff.comparison import Comparison
from study.tradeoff.contenders import may_be_single
from study.tradeoff.demand import Demand
from study.tradeoff.prediction import added_by_single, predictions
from study.tradeoff.problem import tidy
from study.tradeoff.recommendation import Recommended
from study.tradeoff.selection import DOUBLE, SINGLE
from study.tradeoff.study import Execution

FITTED = (2.5, 2.0, 1.75, 1.5, 1.25, 1.0)
FINER = (0.9, 0.8, 0.7, 0.6, 0.5)
"""Spacings, times that of the scene: those whose errors are fitted, and those left to the fit."""
ELEMENTS = 0.5
"""Element size of the reference used for the choice, over the scene's; replaces its accuracy.

On the built-in liver 0.75 has a field error of 4 %, 0.6 of 2 %, this of 0.4 %, in 30, 61 and 71 s
of processor time for all of `recommend`.
"""


def recommend(
    scene: Scene, wanted: Demand, execution: Execution, *, known_place: bool = False
) -> Recommended:
    """The best candidate for a scene of `study.tradeoff.problem.sampled`, verified by a run.

    With `known_place` also among models that depend on the place of the load.
    """
    judged_scene = with_finer_reference(scene)
    every = [tidy(times * scene.lattice.spacing) for times in (*FITTED, *FINER)]
    spacings = every[: len(FITTED)] if study.has_reference(scene) else every
    tried = [lattice_configuration(scene, h) for h in spacings]
    single = [lattice_configuration(scene, spacings[-1], SINGLE)] if may_be_single(scene) else []
    comparison, outcomes = execution.judged(judged_scene, [*tried, *single])
    given, progress = comparison.given, execution.progress
    dependent = None
    if known_place and comparison.reference is not None:
        dependent = place_dependent_runs(given, comparison.reference, execution)
        comparison = replace(comparison, reference=dependent.reference)
    added = {DOUBLE: 0.0, **added_by_single(outcomes[len(spacings) - 1 :], given)}
    expected = predictions(comparison, tried, outcomes, every)
    candidates = lattice_candidates(given, expected, added, wanted, progress)
    if dependent is not None:
        candidates += place_dependent_candidates(given, dependent, wanted, progress)
    found = _verified(comparison, candidates, wanted, execution)
    return replace(found, against=comparison.words if comparison.finest else "")


def with_finer_reference(scene: Scene) -> Scene:
    """The scene with a reference of elements half as large, whatever accuracy it requests."""
    chosen = scene.reference
    size = tidy(ELEMENTS * chosen.element_size)
    return replace(scene, reference=replace(chosen, element_size=size, accuracy=None))


def _verified(
    comparison: Comparison,
    candidates: Sequence[Candidate],
    wanted: Demand,
    execution: Execution,
) -> Recommended:
    """The best candidate run and timed anew, or the best of the others if it fails."""
    given, chosen = comparison.given, best(candidates, wanted)
    _, (outcome,) = execution.judged(given.scene, [chosen.configuration])
    measured = comparison.errors(chosen.configuration, outcome)
    (cost,) = timed(given, [chosen.configuration], execution.progress)
    if outcome.value is not None:
        cost = replace(cost, step=min(cost.step, study.step_of(outcome)))
    again = frame_at(cost, wanted)
    met = chosen.meets(wanted) and measured.status in {"resolved", "not resolved"}
    met = met and (again is None or again.in_time)
    met = met and (wanted.error is None or (measured.judged or 0.0) <= wanted.error)
    others = [one for one in candidates if one is not chosen]
    if not met and chosen.meets(wanted) and others:
        return _verified(comparison, others, wanted, execution)
    wall = cost.timing.step[1] / cost.step
    return Recommended(chosen, met, measured, again, wall, tuple(candidates))
