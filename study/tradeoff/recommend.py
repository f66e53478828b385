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

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from study.models.spacing_error import force_differences
from study.models.tissue import FRACTION, lacks_poisson_ratio
from study.run.scene_problem import SceneProblem
from study.scene import Scene
from study.scene.file import write_scene
from study.similarity.fields import relative_l2
from study.sweep.canonical import restored
from study.sweep.runner import Backend, Outcome
from study.sweep.store import Store
from study.system.progress import Progress
from study.tradeoff import study
from study.tradeoff.comparison import Comparison
from study.tradeoff.contenders import Configuration, contender, fraction, may_be_single
from study.tradeoff.demand import Demand
from study.tradeoff.errors import Errors, errors
from study.tradeoff.large_displacements import with_large_displacements
from study.tradeoff.observation import Observed
from study.tradeoff.problem import tidy
from study.tradeoff.rates import SLOW, Frame, frame
from study.tradeoff.reference import ReferenceSolution
from study.tradeoff.selection import DOUBLE, described, scene_with
from study.tradeoff.table import Cost, is_beaten
from study.tradeoff.timing import QUICK_REPEATS

FITTED = (2.5, 2.0, 1.75, 1.5, 1.25, 1.0)
FINER = (0.9, 0.8, 0.7, 0.6, 0.5)
"""Spacings, times that of the scene: those whose errors are fitted, and those left to the fit."""
ELEMENTS = 0.5
"""Element size of the reference used for the choice, over the scene's; replaces its accuracy.

On the built-in liver 0.75 has a field error of 4 %, 0.6 of 2 %, this of 0.4 %, in 30, 61 and 71 s
of processor time for all of `recommend`.
"""
LEVEL = 0.95
"""Share of fits whose spread includes the error, by Student's t for their number of points."""
FEWEST = 3
SINGLE = "single"
BESIDE = (2.0, 1.5, 1.0)
"""Spacings of corrected lattices, over that of the scene."""
SMALL_CELLS, REACHES = 0.5, (1.0, 1.5)
"""Of graded lattices: edge of their finest cells, times the spacing of the scene, and how far these
reach from the tool, in its radii."""
VECTORS = 16


@dataclass(frozen=True)
class Promise:
    """A predicted relative error, and how far the measured one may deviate either way."""

    error: float
    bar: float

    @property
    def most(self) -> float:
        """The upper end of the prediction."""
        return self.error + self.bar

    def rounded(self, more: float) -> Promise:
        """The prediction with an additional rounding error."""
        return replace(self, bar=self.bar + more)

    def holds(self, measured: float) -> bool:
        """Whether a measured error lies within the prediction."""
        return abs(measured - self.error) <= self.bar


@dataclass(frozen=True)
class Candidate:
    """A configuration with its prediction; `frame`: at the demanded rate, if there is one."""

    configuration: Configuration
    promise: Promise
    cost: Cost
    frame: Frame | None

    @property
    def wall_per_second(self) -> float:
        """Wall time per simulated second."""
        return self.cost.timing.step[1] / self.cost.step

    def meets(self, wanted: Demand) -> bool:
        """Whether rate and error are predicted to meet the demand."""
        in_time = self.frame is None or self.frame.in_time
        return in_time and (wanted.error is None or self.promise.most <= wanted.error)


@dataclass(frozen=True)
class Recommended:
    """A candidate, whether it meets the demand, and its measured error and cost.

    `others`: the candidates. `against`: the reference of the errors, if it is not the converged
    one.
    """

    candidate: Candidate
    met: bool
    measured: Errors
    frame: Frame | None
    wall_per_second: float
    others: tuple[Candidate, ...] = ()
    against: str = ""


def recommend(
    scene: Scene,
    wanted: Demand,
    store: Store,
    backend: Backend,
    progress: Progress,
    *,
    known_place: bool = False,
) -> Recommended:
    """The best candidate for a scene of `study.tradeoff.problem.sampled`, verified by a run.

    With `known_place` also among models that depend on the place of the load.
    """
    coarser = judged_by(scene)
    every = [tidy(times * scene.lattice.spacing) for times in (*FITTED, *FINER)]
    spacings = every[: len(FITTED)] if study.has_reference(scene) else every
    tried = [_configuration(scene, h) for h in spacings]
    single = [_configuration(scene, spacings[-1], SINGLE)] if may_be_single(scene) else []
    comparison, outcomes = study.judged(coarser, [*tried, *single], store, backend)
    given, followed = comparison.given, None
    if known_place and comparison.reference is not None:
        followed = _followed(given, comparison.reference, store, backend)
        comparison = replace(comparison, reference=followed.known)
    added = {DOUBLE: 0.0, **_added_by_single(outcomes[len(spacings) - 1 :], given)}
    promises = _promises(comparison, tried, outcomes, every)
    candidates = _candidates(given, promises, added, wanted, progress)
    if followed is not None:
        candidates += _bound(given, followed, wanted, progress)
    found = _verified(comparison, candidates, wanted, store, backend, progress)
    return replace(found, against=comparison.words if comparison.finest else "")


def judged_by(scene: Scene) -> Scene:
    """The scene with a reference of elements half as large, whatever accuracy it requests."""
    chosen = scene.reference
    size = tidy(ELEMENTS * chosen.element_size)
    return replace(scene, reference=replace(chosen, element_size=size, accuracy=None))


@dataclass(frozen=True)
class Fit:
    """An error C h^p of the spacing h, its spread as a share, and the reference's own error."""

    constant: float
    order: float
    spread: float
    reference_error: float

    def promise(self, spacing: float) -> Promise:
        """The predicted error at a spacing [m]."""
        error = self.constant * spacing**self.order
        return Promise(error, self.reference_error + self.spread * error)


def _promises(
    comparison: Comparison,
    tried: Sequence[Configuration],
    outcomes: Sequence[Outcome],
    every: Sequence[float],
) -> dict[float, Promise]:
    """The prediction for each spacing [m], in double precision."""
    spacings = [float(one.settings["spacing"]) for one in tried]
    if comparison.reference is None:
        return dict(_measured_promises(comparison, tried, outcomes))
    known = comparison.reference
    found = [errors(one, known, comparison.given) for one in outcomes[: len(tried)]]
    kept = [(h, e.judged) for h, e in zip(spacings, found, strict=True) if e.judged is not None]
    own = known.field_error if known.force_bar is None else known.force_bar
    curve = fitted([h for h, _ in kept], [error for _, error in kept], own)
    return {h: curve.promise(h) for h in every}


def _measured_promises(
    comparison: Comparison, tried: Sequence[Configuration], outcomes: Sequence[Outcome]
) -> Iterator[tuple[float, Promise]]:
    """The measured error of each run, plus the own error of the finest lattice."""
    for one, outcome in zip(tried, outcomes, strict=False):
        known = comparison.truth(one)
        alike = replace(known, force_errors=np.zeros_like(known.force_errors))
        found = errors(outcome, alike, comparison.given)
        if found.status in {"resolved", "not resolved"}:
            promise = Promise(found.force or 0.0, known.force_bar or 0.0)
            yield float(one.settings["spacing"]), promise


def fitted(spacings: Sequence[float], found: Sequence[float], reference_error: float) -> Fit:
    """Least squares in logarithms. ValueError if too few errors are resolved."""
    from scipy.special import stdtrit

    if len(found) < FEWEST:
        raise ValueError(
            f"only {len(found)} of the spacings have an error above the reference's own "
            f"{100 * reference_error:.2g} %; enlarge lattice.spacing or refine "
            "reference.element_size"
        )
    order, level = np.polyfit(np.log(spacings), np.log(found), 1)
    left, free = np.log(found) - np.polyval([order, level], np.log(spacings)), len(found) - 2
    deviation = np.sqrt((left**2).sum() / free)
    spread = np.expm1(stdtrit(free, 0.5 * (1.0 + LEVEL)) * deviation)
    return Fit(float(np.exp(level)), float(order), float(spread), reference_error)


def _configuration(scene: Scene, spacing: float, precision: str = DOUBLE) -> Configuration:
    lacks = lacks_poisson_ratio(scene)
    settings = {"spacing": spacing, "volume_term": lacks, "step_fraction": fraction(scene)}
    if precision == SINGLE:
        return Configuration("single-precision", settings | {"precision": SINGLE})
    return Configuration("volume-springs" if lacks else "springs", settings)


def _added_by_single(outcomes: Sequence[Outcome], given: SceneProblem) -> dict[str, float]:
    """Change of the field or the force by single precision, from runs in both precisions.

    Relative L2; empty where such a run is missing or did not finish.
    """
    seen = [restored(Observed, one.value) for one in outcomes[:2] if one.value is not None]
    whole = [one for one in seen if one.field is not None]
    if len(whole) < 2:
        return {}
    double, single = whole
    if given.problem.rigid_tools:
        shape = len(given.problem.observation.times), len(given.problem.rigid_tools), 3
        of = [np.reshape(one.force or [], shape) for one in (single, double)]
        return {SINGLE: float(force_differences(given.problem, *of)[0].max())}
    in_single, in_double = (np.reshape(one.field or [], (-1, 3)) for one in (single, double))
    return {SINGLE: relative_l2(in_single, in_double, given.problem.volume_rule.weights)}


def _candidates(
    given: SceneProblem,
    promises: Mapping[float, Promise],
    added: Mapping[str, float],
    wanted: Demand,
    progress: Progress,
) -> list[Candidate]:
    """All spacings in each precision with its rounding error, timed in turns."""
    pairs = [(h, precision) for h in promises for precision in added]
    chosen = [_configuration(given.scene, *pair) for pair in pairs]
    return [
        Candidate(one, promises[h].rounded(added[precision]), cost, _frame(cost, wanted))
        for one, (h, precision), cost in zip(
            chosen, pairs, _costs(given, chosen, progress), strict=True
        )
    ]


@dataclass(frozen=True)
class Followers:
    """Runs of models that depend on the place of the load; `known`: their reference."""

    chosen: tuple[Configuration, ...]
    outcomes: tuple[Outcome, ...]
    known: ReferenceSolution


def _followed(
    given: SceneProblem, known: ReferenceSolution, store: Store, backend: Backend
) -> Followers:
    """Their elements on the mesh of the scene that is judged by.

    Without runs that show the effect of large displacements, models of small displacements are left
    out. So are the linear elements alone where `superposition` does not support the scene: they are
    no contender there.
    """
    chosen = list(bound(given.scene))
    _, outcomes = study.judged(given.scene, chosen, store, backend)
    graded = [k for k, one in enumerate(chosen) if one.contender == "corrected-graded"]
    near, far = outcomes[graded[0]], outcomes[graded[-1]]
    whole = with_large_displacements(known, outcomes[0], near, far, given)
    first = 0 if whole is not None and chosen[0].contender == "superposition" else 1
    return Followers(tuple(chosen[first:]), tuple(outcomes[first:]), whole or known)


def _bound(
    given: SceneProblem, followed: Followers, wanted: Demand, progress: Progress
) -> list[Candidate]:
    """Candidates among those that were run, timed in turns."""
    known = followed.known
    found = [errors(one, known, given) for one in followed.outcomes]
    costed = _costs(given, followed.chosen, progress)
    return [
        Candidate(one, _as_measured(error, known.field_error), cost, _frame(cost, wanted))
        for one, error, cost in zip(followed.chosen, found, costed, strict=True)
        if error.status in {"resolved", "not resolved"}
    ]


def bound(scene: Scene) -> Iterator[Configuration]:
    """Models that depend on the place of the load, or its path: graded and corrected lattices.

    First linear elements alone: a subspace, or as many vectors as several loads need.
    """
    if contender("superposition").lacks(scene):
        yield Configuration("fem", {"method": "ritz-vectors", "level": 0})
    else:
        yield Configuration("superposition", {"vectors": "ritz", "count": VECTORS, "level": 0})
    step = {"step_fraction": FRACTION}
    for times in BESIDE:
        h = tidy(times * scene.lattice.spacing)
        yield Configuration("corrected", {"spacing": h, **step})
    finest, term = tidy(SMALL_CELLS * scene.lattice.spacing), lacks_poisson_ratio(scene)
    for times in REACHES:
        graded = {"spacing": finest, "radius": tidy(times * scene.tool.radius), **step}
        yield Configuration("corrected-graded", graded)
        yield Configuration("region", {**graded, "volume_term": term})


def _as_measured(found: Errors, own: float) -> Promise:
    """The measured error with the reference's own error; the latter alone if it is larger."""
    return Promise(found.field or 0.0, own)


def _costs(given: SceneProblem, chosen: Sequence[Configuration], progress: Progress) -> list[Cost]:
    longest = [float("inf")] * len(chosen)  # that at rest is less
    return study.costs(given, chosen, longest, QUICK_REPEATS, progress, sized=True)


def _frame(cost: Cost, wanted: Demand) -> Frame | None:
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
        return min(quick, key=lambda one: one.promise.error)
    return min(candidates, key=lambda one: one.frame.wall if one.frame else 0.0)


def _verified(
    comparison: Comparison,
    candidates: Sequence[Candidate],
    wanted: Demand,
    store: Store,
    backend: Backend,
    progress: Progress,
) -> Recommended:
    """The best candidate run and timed anew, or the best of the others if it fails."""
    given, chosen = comparison.given, best(candidates, wanted)
    _, (outcome,) = study.judged(given.scene, [chosen.configuration], store, backend)
    measured = comparison.errors(chosen.configuration, outcome)
    (cost,) = _costs(given, [chosen.configuration], progress)
    if outcome.value is not None:
        cost = replace(cost, step=min(cost.step, study.step_of(outcome)))
    again = _frame(cost, wanted)
    met = chosen.meets(wanted) and measured.status in {"resolved", "not resolved"}
    met = met and (again is None or again.in_time)
    met = met and (wanted.error is None or (measured.judged or 0.0) <= wanted.error)
    others = [one for one in candidates if one is not chosen]
    if not met and chosen.meets(wanted) and others:
        return _verified(comparison, others, wanted, store, backend, progress)
    wall = cost.timing.step[1] / cost.step
    return Recommended(chosen, met, measured, again, wall, tuple(candidates))


def recommended_scene(scene: Scene, found: Recommended) -> str:
    """TOML text of the scene with the recommended lattice, its prediction and measurement.

    It names the measured model, with springs of the tissue's own modulus, and the reference.
    """
    head = "".join(f"# {line}\n" for line in lines(found))
    return head + "\n" + write_scene(scene_with(scene, found.candidate.configuration))


def lines(found: Recommended) -> list[str]:
    """The recommendation, its prediction and measurement, for a reader."""
    one, measured = found.candidate, found.measured
    promise = one.promise
    error = (
        f"{100 * measured.judged:.1f} %"
        if measured.judged is not None
        else f"{measured.status}, below the error of the comparison"
        if measured.status == "not resolved" and measured.of_force
        else f"{measured.status}, below the error of the reference"
        if measured.status == "not resolved"
        else f"none: {measured.status} {measured.message}"
    )
    verdict = ""
    if measured.judged is not None:
        verdict = ", as expected" if promise.holds(measured.judged) else ", not as expected"
    text = [
        described(one.configuration),
        f"{_quantity(measured)} error expected {100 * promise.error:.1f} +- "
        f"{100 * promise.bar:.1f} %, measured {error}" + verdict,
    ]
    if measured.of_force:
        text += [f"errors are against {found.against}", *_beside_force(measured)]
    if found.frame is not None:
        slow = found.frame.slow
        text.append(
            f"frame: {found.frame.substeps} steps in {1e3 * found.frame.wall:.3g} ms"
            + ("" if slow is None else f", 95 % of them within {1e3 * slow:.3g} ms")
        )
    text.append(f"{found.wall_per_second:.3g} s of wall per simulated second on this machine")
    if one.cost.memory is not None:
        text.append(f"{_in_mb(one.cost.memory)} of memory during the steps, besides the program")
    if not one.configuration.any_load:
        text.append(
            "It is valid for this place or path of the load only. The error is that against linear "
            "elements with the correction of corrected lattices."
        )
    text.append(
        "The error is for springs with the modulus of the tissue, tissue.youngs_modulus; the error "
        "of a fuzzy estimate adds to it."
    )
    return [*text, *table_of(found.others, _quantity(measured), one)]


def _in_mb(count: float) -> str:
    """Bytes in MB, to a tenth below ten."""
    found = count / 1e6
    return f"{found:.0f} MB" if found >= 10.0 else f"{found:.1f} MB"


def _quantity(measured: Errors) -> str:
    return "force" if measured.of_force else "field"


def _beside_force(measured: Errors) -> Iterator[str]:
    """The other measured errors of a configuration whose criterion is the force over time."""
    told = {
        "the largest force": measured.peak_force,
        "the displacement at the control points": measured.worst,
        "the displacement over the organ": measured.field,
    }
    if measured.discretisation != measured.force:  # against a reference, and not the same again
        told["the force against the finest lattice of the same springs"] = measured.discretisation
    parts = [f"of {of} {100 * error:.1f} %" for of, error in told.items() if error is not None]
    if parts:
        yield f"other measured errors: {', '.join(parts)}"


def table_of(
    candidates: Sequence[Candidate], quantity: str = "field", taken: Candidate | None = None
) -> Iterator[str]:
    """The Pareto front of error and cost, and the candidate taken; the cheapest first.

    For a rate alone a lattice in double precision is taken where it keeps up, though single
    precision is cheaper with the same predicted error but for rounding.
    """
    places = [(one.promise.error, one.wall_per_second) for one in candidates]
    front = [
        one
        for one, at in zip(candidates, places, strict=True)
        if one is taken or not is_beaten(at, places)
    ]
    if not front:
        return
    framed = any(one.frame is not None for one in front)
    yield (
        f"candidates (wall time per simulated second, expected error of the {quantity}, memory"
        + (f", {SLOW:g} % of its frames):" if framed else "):")
    )
    for one in sorted(front, key=lambda one: one.wall_per_second):
        memory = "" if one.cost.memory is None else _in_mb(one.cost.memory)
        yield (
            f"{one.wall_per_second:>8.3g} s  {100 * one.promise.error:>5.1f} +- "
            f"{100 * one.promise.bar:.1f} %  {memory:>7}  {_frame_of(one)}"
            f"{described(one.configuration)}" + (" <- selected" if one is taken else "")
        )


def _frame_of(one: Candidate) -> str:
    """How long frames take at most, and whether they are late: why a candidate is not taken."""
    if one.frame is None:
        return ""
    within = one.frame.wall if one.frame.slow is None else one.frame.slow
    verdict = "in time" if one.frame.in_time else "late"
    return f"{1e3 * within:>7.3g} ms, {verdict:<7}  "
