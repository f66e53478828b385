"""Candidates of a recommendation: configurations with their predicted error and measured cost."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from study.models.tissue import FRACTION, lacks_poisson_ratio
from study.run.scene_problem import SceneProblem
from study.scene import Scene
from study.sweep.runner import Outcome
from study.system.progress import Progress
from study.tradeoff import study
from study.tradeoff.contenders import Configuration, contender, fraction
from study.tradeoff.demand import Demand
from study.tradeoff.errors import Errors, errors
from study.tradeoff.large_displacements import with_large_displacements
from study.tradeoff.prediction import Prediction
from study.tradeoff.problem import tidy
from study.tradeoff.rates import Frame, frame
from study.tradeoff.reference import ReferenceSolution
from study.tradeoff.selection import DOUBLE, SINGLE
from study.tradeoff.study import Execution
from study.tradeoff.table import Cost
from study.tradeoff.timing import QUICK_REPEATS

CORRECTED = (2.0, 1.5, 1.0)
"""Spacings of corrected lattices, over that of the scene."""
SMALL_CELLS, REACHES = 0.5, (1.0, 1.5)
"""Of graded lattices: edge of their finest cells, times the spacing of the scene, and how far these
reach from the tool, in its radii."""
VECTORS = 16


@dataclass(frozen=True)
class Candidate:
    """A configuration with its prediction; `frame`: at the demanded rate, if there is one."""

    configuration: Configuration
    prediction: Prediction
    cost: Cost
    frame: Frame | None

    @property
    def wall_per_second(self) -> float:
        """Wall time per simulated second."""
        return self.cost.timing.step[1] / self.cost.step

    def meets(self, wanted: Demand) -> bool:
        """Whether rate and error are predicted to meet the demand."""
        in_time = self.frame is None or self.frame.in_time
        return in_time and (wanted.error is None or self.prediction.upper <= wanted.error)


def lattice_configuration(scene: Scene, spacing: float, precision: str = DOUBLE) -> Configuration:
    """An explicit lattice, with the volume term where the tissue's Poisson ratio needs it."""
    lacks = lacks_poisson_ratio(scene)
    settings = {"spacing": spacing, "volume_term": lacks, "step_fraction": fraction(scene)}
    if precision == SINGLE:
        return Configuration("single-precision", settings | {"precision": SINGLE})
    return Configuration("volume-springs" if lacks else "springs", settings)


def lattice_candidates(
    given: SceneProblem,
    expected: Mapping[float, Prediction],
    rounding: Mapping[str, float],
    wanted: Demand,
    progress: Progress,
) -> list[Candidate]:
    """All spacings [m] in each precision, with its rounding error, timed in turns."""
    pairs = [(h, precision) for h in expected for precision in rounding]
    chosen = [lattice_configuration(given.scene, *pair) for pair in pairs]
    sums = [expected[h].with_rounding(rounding[precision]) for h, precision in pairs]
    costs = timed(given, chosen, progress)
    return [
        Candidate(one, prediction, cost, frame_at(cost, wanted))
        for one, prediction, cost in zip(chosen, sums, costs, strict=True)
    ]


@dataclass(frozen=True)
class PlaceDependentRuns:
    """Runs of models that depend on the place of the load, and the `reference` of their errors."""

    chosen: tuple[Configuration, ...]
    outcomes: tuple[Outcome, ...]
    reference: ReferenceSolution


def place_dependent_runs(
    given: SceneProblem, reference: ReferenceSolution, execution: Execution
) -> PlaceDependentRuns:
    """Runs on the mesh of the scene's reference, with large displacements in the reference.

    Without runs that show the effect of large displacements, models of small displacements are left
    out. So are the linear elements alone where `superposition` does not support the scene: they are
    no contender there.
    """
    chosen = list(place_dependent(given.scene))
    _, outcomes = execution.judged(given.scene, chosen)
    graded = [k for k, one in enumerate(chosen) if one.contender == "corrected-graded"]
    near, far = outcomes[graded[0]], outcomes[graded[-1]]
    whole = with_large_displacements(reference, outcomes[0], near, far, given)
    first = 0 if whole is not None and chosen[0].contender == "superposition" else 1
    return PlaceDependentRuns(tuple(chosen[first:]), tuple(outcomes[first:]), whole or reference)


def place_dependent_candidates(
    given: SceneProblem, dependent: PlaceDependentRuns, wanted: Demand, progress: Progress
) -> list[Candidate]:
    """Candidates among those that were run, timed in turns."""
    reference = dependent.reference
    found = [errors(one, reference, given) for one in dependent.outcomes]
    costed = timed(given, dependent.chosen, progress)
    return [
        Candidate(one, _as_measured(error, reference.field_error), cost, frame_at(cost, wanted))
        for one, error, cost in zip(dependent.chosen, found, costed, strict=True)
        if error.status in {"resolved", "not resolved"}
    ]


def place_dependent(scene: Scene) -> Iterator[Configuration]:
    """Models that depend on the place of the load, or its path: graded and corrected lattices.

    First linear elements alone: a subspace, or as many vectors as several loads need.
    """
    if contender("superposition").lacks(scene):
        yield Configuration("fem", {"method": "ritz-vectors", "level": 0})
    else:
        yield Configuration("superposition", {"vectors": "ritz", "count": VECTORS, "level": 0})
    step = {"step_fraction": FRACTION}
    for times in CORRECTED:
        h = tidy(times * scene.lattice.spacing)
        yield Configuration("corrected", {"spacing": h, **step})
    finest, term = tidy(SMALL_CELLS * scene.lattice.spacing), lacks_poisson_ratio(scene)
    for times in REACHES:
        graded = {"spacing": finest, "radius": tidy(times * scene.tool.radius), **step}
        yield Configuration("corrected-graded", graded)
        yield Configuration("region", {**graded, "volume_term": term})


def _as_measured(found: Errors, own: float) -> Prediction:
    """The measured error with the reference's own error; the latter alone if it is larger."""
    return Prediction(found.field or 0.0, own)


def timed(given: SceneProblem, chosen: Sequence[Configuration], progress: Progress) -> list[Cost]:
    """Cost and memory of configurations, timed in turns, at the steps that they take at rest."""
    longest = [float("inf")] * len(chosen)  # that at rest is less
    return study.costs(given, chosen, longest, QUICK_REPEATS, progress, sized=True)


def frame_at(cost: Cost, wanted: Demand) -> Frame | None:
    """A frame at the demanded rate, None without one."""
    return None if wanted.rate is None else frame(wanted.rate, cost.step, cost.timing.walls)


def best(candidates: Sequence[Candidate], wanted: Demand) -> Candidate:
    """The best candidate, or the nearest where none meets the demand.

    Nearest is the most accurate that keeps up; where none does, the fastest.
    """
    able = [one for one in candidates if one.meets(wanted)]
    if able and wanted.error is not None:
        return min(able, key=lambda one: one.wall_per_second)
    quick = [one for one in candidates if one.frame is None or one.frame.in_time]
    if quick:
        return min(quick, key=lambda one: one.prediction.error)
    return min(candidates, key=lambda one: one.frame.wall if one.frame else 0.0)
