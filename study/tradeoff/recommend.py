"""The configuration that meets a demand on this machine: chosen by a fit, then run and timed.

Chosen from is the lattice stepped explicitly, with the volume term where the tissue's Poisson ratio
asks for it, by its spacing and precision. Its error is run at a few coarse spacings and fitted by
C h^p; what single precision adds is measured at the finest of them; its cost is timed at all. For a
rate alone the most accurate that keeps up is recommended, for an error the cheapest that promises
it. A promise is the fit with its spread, the reference's own error and what the precision adds; the
recommended configuration is then run and timed afresh, and the next one taken where it does not
keep up after all.

Where the place of the load is known beforehand, what follows it there only is chosen from too:
Ritz vectors, graded lattices, and lattices of either kind corrected by finite elements. There are
few, and each promises what a run of it was off by, or the reference's own error if that is more.
All are then judged by the reference with large displacements, `study.tradeoff.geometry`.

Where tools are moved the error is that of their force over time. Against the finest lattice of the
same springs every spacing is run, for errors by contact jump with how cells lie; each promises what
its run was off by, and the finest's own error on top.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from study.models.spacing_error import force_differences
from study.models.tissue import FRACTION, lacks_poisson_ratio
from study.progress import Progress
from study.run.stated import Stated
from study.scene import Scene
from study.scene.file import write_scene
from study.similarity.fields import relative_l2
from study.sweep.canonical import restored
from study.sweep.runner import How, Outcome
from study.sweep.store import Store
from study.tradeoff import study
from study.tradeoff.chosen import DOUBLE, in_words, scene_with
from study.tradeoff.demand import Demand
from study.tradeoff.errors import Errors, errors
from study.tradeoff.geometry import with_large_displacements
from study.tradeoff.judge import Judge
from study.tradeoff.lineup import Configuration, fraction, may_be_single
from study.tradeoff.observation import Observed
from study.tradeoff.problem import tidy
from study.tradeoff.rates import SLOW, Frame, frame
from study.tradeoff.reference import Truth
from study.tradeoff.table import Cost, is_beaten
from study.tradeoff.timing import QUICK_REPEATS

FITTED = (2.5, 2.0, 1.75, 1.5, 1.25, 1.0)
FINER = (0.9, 0.8, 0.7, 0.6, 0.5)
"""Spacings, times that of the scene: those whose errors are fitted, and those left to the fit."""
ELEMENTS = 0.5
"""Element size of the reference chosen by, times that of the scene, in place of its accuracy.

On the built-in liver 0.75 has an error of the field of 4 %, 0.6 of 2 %, this of 0.4 %, in 30, 61
and 71 s of processor time for all of `recommend`.
"""
SPREAD = 2.8
"""Standard deviations that a promise allows for: Student's t at 95 % of a fit to six points."""
FEWEST = 3
SINGLE = "single"
BESIDE = (2.0, 1.5, 1.0)
"""Spacings of corrected lattices, times that of the scene."""
SMALL_CELLS, REACHES = 0.5, (1.0, 1.5)
"""Of graded lattices: edge of their finest cells, times the spacing of the scene, and how far these
reach from the tool, in its radii."""
VECTORS = 16


@dataclass(frozen=True)
class Promise:
    """A relative error and how far from it the measured one may lie, either way."""

    error: float
    bar: float

    @property
    def most(self) -> float:
        """Its upper end."""
        return self.error + self.bar

    def rounded(self, more: float) -> Promise:
        """With at most so much more by rounding."""
        return replace(self, bar=self.bar + more)

    def holds(self, measured: float) -> bool:
        """Whether a measured error lies within."""
        return abs(measured - self.error) <= self.bar


@dataclass(frozen=True)
class Candidate:
    """A configuration and what it is expected to give; `frame`: at the rate, if one is demanded."""

    configuration: Configuration
    promise: Promise
    cost: Cost
    frame: Frame | None

    @property
    def wall_per_second(self) -> float:
        """Wall per simulated second."""
        return self.cost.timing.step[1] / self.cost.step

    def meets(self, wanted: Demand) -> bool:
        """Whether rate and error are promised."""
        in_time = self.frame is None or self.frame.in_time
        return in_time and (wanted.error is None or self.promise.most <= wanted.error)


@dataclass(frozen=True)
class Recommended:
    """A candidate, whether it meets the demand, and what it was measured to give.

    `others`: those that it was chosen from. `against`: what errors are against, where that is not
    the converged reference.
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
    how: How,
    progress: Progress,
    *,
    known_place: bool = False,
) -> Recommended:
    """The best candidate for a scene of `study.tradeoff.problem.sampled`, verified.

    With `known_place` also among the lattices that follow one place of the load.
    """
    coarser = judged_by(scene)
    every = [tidy(times * scene.lattice.spacing) for times in (*FITTED, *FINER)]
    spacings = every[: len(FITTED)] if study.has_reference(scene) else every
    tried = [_configuration(scene, h) for h in spacings]
    single = [_configuration(scene, spacings[-1], SINGLE)] if may_be_single(scene) else []
    judge, outcomes = study.judged(coarser, [*tried, *single], store, how)
    given, followed = judge.given, None
    if known_place and judge.reference is not None:
        followed = _followed(given, judge.reference, store, how)
        judge = replace(judge, reference=followed.known)
    added = {DOUBLE: 0.0, **_added_by_single(outcomes[len(spacings) - 1 :], given)}
    promises = _promises(judge, tried, outcomes, every)
    candidates = _candidates(given, promises, added, wanted, progress)
    if followed is not None:
        candidates += _bound(given, followed, wanted, progress)
    found = _verified(judge, candidates, wanted, store, how, progress)
    return replace(found, against=judge.words if judge.finest else "")


def judged_by(scene: Scene) -> Scene:
    """The scene with a reference of elements half as large, whatever accuracy it asks for."""
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
        """The error at a spacing [m]."""
        error = self.constant * spacing**self.order
        return Promise(error, self.reference_error + self.spread * error)


def _promises(
    judge: Judge,
    tried: Sequence[Configuration],
    outcomes: Sequence[Outcome],
    every: Sequence[float],
) -> dict[float, Promise]:
    """What a spacing [m] promises, in double precision."""
    spacings = [float(one.settings["spacing"]) for one in tried]
    if judge.reference is None:
        return dict(_measured_promises(judge, tried, outcomes))
    known = judge.reference
    found = [errors(one, known, judge.given) for one in outcomes[: len(tried)]]
    kept = [(h, e.judged) for h, e in zip(spacings, found, strict=True) if e.judged is not None]
    own = known.field_error if known.force_bar is None else known.force_bar
    curve = fitted([h for h, _ in kept], [error for _, error in kept], own)
    return {h: curve.promise(h) for h in every}


def _measured_promises(
    judge: Judge, tried: Sequence[Configuration], outcomes: Sequence[Outcome]
) -> Iterator[tuple[float, Promise]]:
    """What each run was off the finest lattice by, and the own error of that."""
    for one, outcome in zip(tried, outcomes, strict=False):
        known = judge.truth(one)
        alike = replace(known, force_errors=np.zeros_like(known.force_errors))
        found = errors(outcome, alike, judge.given)
        if found.status in {"resolved", "not resolved"}:
            promise = Promise(found.force or 0.0, known.force_bar or 0.0)
            yield float(one.settings["spacing"]), promise


def fitted(spacings: Sequence[float], found: Sequence[float], reference_error: float) -> Fit:
    """By least squares in logarithms. ValueError if too few errors are resolved."""
    if len(found) < FEWEST:
        raise ValueError(
            f"only {len(found)} of the spacings have an error above the reference's own "
            f"{100 * reference_error:.2g} %; enlarge lattice.spacing or refine "
            "reference.element_size"
        )
    order, level = np.polyfit(np.log(spacings), np.log(found), 1)
    left = np.log(found) - np.polyval([order, level], np.log(spacings))
    deviation = float(np.sqrt((left**2).sum() / (len(found) - 2)))
    return Fit(
        float(np.exp(level)), float(order), float(np.expm1(SPREAD * deviation)), reference_error
    )


def _configuration(scene: Scene, spacing: float, precision: str = DOUBLE) -> Configuration:
    lacks = lacks_poisson_ratio(scene)
    settings = {"spacing": spacing, "volume_term": lacks, "step_fraction": fraction(scene)}
    if precision == SINGLE:
        return Configuration("single-precision", settings | {"precision": SINGLE})
    return Configuration("volume-springs" if lacks else "springs", settings)


def _added_by_single(outcomes: Sequence[Outcome], given: Stated) -> dict[str, float]:
    """What single precision changes of the field or the force, of a run in double and in single.

    Relative L2; nothing where there is no such run, or it was not whole.
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
    given: Stated,
    promises: Mapping[float, Promise],
    added: Mapping[str, float],
    wanted: Demand,
    progress: Progress,
) -> list[Candidate]:
    """All spacings in each precision, which adds so much to the error, timed in turns."""
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
    """What follows one place of the load only, run; `known`: what all are then judged by."""

    chosen: tuple[Configuration, ...]
    outcomes: tuple[Outcome, ...]
    known: Truth


def _followed(given: Stated, known: Truth, store: Store, how: How) -> Followers:
    """Their elements on the mesh of the scene that is judged by.

    Without runs that tell what geometry changes, those of small displacements are left out.
    """
    chosen = list(bound(given.scene))
    _, outcomes = study.judged(given.scene, chosen, store, how)
    graded = [k for k, one in enumerate(chosen) if one.contender == "corrected-graded"]
    near, far = outcomes[graded[0]], outcomes[graded[-1]]
    whole = with_large_displacements(known, outcomes[0], near, far, given)
    first = 0 if whole is not None else 1
    return Followers(tuple(chosen[first:]), tuple(outcomes[first:]), whole or known)


def _bound(
    given: Stated, followed: Followers, wanted: Demand, progress: Progress
) -> list[Candidate]:
    """Candidates of those that were run, timed in turns."""
    known = followed.known
    found = [errors(one, known, given) for one in followed.outcomes]
    costed = _costs(given, followed.chosen, progress)
    return [
        Candidate(one, _as_measured(error, known.field_error), cost, _frame(cost, wanted))
        for one, error, cost in zip(followed.chosen, found, costed, strict=True)
        if error.status in {"resolved", "not resolved"}
    ]


def bound(scene: Scene) -> Iterator[Configuration]:
    """What follows one place of the load only: a subspace, graded and corrected lattices."""
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
    """What a run was off by, with the reference's own error; that alone if it hides the other."""
    return Promise(found.field or 0.0, own)


def _costs(given: Stated, chosen: Sequence[Configuration], progress: Progress) -> list[Cost]:
    longest = [float("inf")] * len(chosen)  # that at rest is less
    return study.costs(given, chosen, longest, QUICK_REPEATS, progress, sized=True)


def _frame(cost: Cost, wanted: Demand) -> Frame | None:
    return None if wanted.rate is None else frame(wanted.rate, cost.step, cost.timing.walls)


def best(candidates: Sequence[Candidate], wanted: Demand) -> Candidate:
    """The one to take, or the nearest where none meets the demand.

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
    judge: Judge,
    candidates: Sequence[Candidate],
    wanted: Demand,
    store: Store,
    how: How,
    progress: Progress,
) -> Recommended:
    """The best candidate run and timed afresh, or the best of the others if it fails that."""
    given, chosen = judge.given, best(candidates, wanted)
    _, (outcome,) = study.judged(given.scene, [chosen.configuration], store, how)
    measured = judge.errors(chosen.configuration, outcome)
    (cost,) = _costs(given, [chosen.configuration], progress)
    if outcome.value is not None:
        cost = replace(cost, step=min(cost.step, study.step_of(outcome)))
    again = _frame(cost, wanted)
    met = chosen.meets(wanted) and measured.status in {"resolved", "not resolved"}
    met = met and (again is None or again.in_time)
    met = met and (wanted.error is None or (measured.judged or 0.0) <= wanted.error)
    others = [one for one in candidates if one is not chosen]
    if not met and chosen.meets(wanted) and others:
        return _verified(judge, others, wanted, store, how, progress)
    wall = cost.timing.step[1] / cost.step
    return Recommended(chosen, met, measured, again, wall, tuple(candidates))


def recommended_scene(scene: Scene, found: Recommended) -> str:
    """TOML text of the scene with the recommended lattice, promise and measurement above it.

    It names the model that was measured, springs of the tissue's own modulus, and the reference.
    """
    head = "".join(f"# {line}\n" for line in lines(found))
    return head + "\n" + write_scene(scene_with(scene, found.candidate.configuration))


def lines(found: Recommended) -> list[str]:
    """What is recommended, promised and measured, for a person."""
    one, measured = found.candidate, found.measured
    promise = one.promise
    error = (
        f"{100 * measured.judged:.1f} %"
        if measured.judged is not None
        else f"{measured.status}, below the own error of what it is compared with"
        if measured.status == "not resolved" and measured.of_force
        else f"{measured.status}, below the reference's own error"
        if measured.status == "not resolved"
        else f"none: {measured.status} {measured.message}"
    )
    verdict = ""
    if measured.judged is not None:
        verdict = ", as promised" if promise.holds(measured.judged) else ", not as promised"
    text = [
        in_words(one.configuration),
        f"{_quantity(measured)} error promised {100 * promise.error:.1f} +- "
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
        text.append(f"{_in_mb(one.cost.memory)} kept while it steps, on top of the program's")
    if not one.configuration.any_load:
        text.append(
            "It follows this place of the load only. The error is that against linear elements "
            "and what corrected lattices add to them."
        )
    text.append(
        "The promise is for springs of the tissue's own modulus, tissue.youngs_modulus; those of a "
        "fuzzy estimate have its error on top."
    )
    return [*text, *table_of(found.others, _quantity(measured), one)]


def _in_mb(count: float) -> str:
    """Bytes in MB, to a tenth below ten."""
    found = count / 1e6
    return f"{found:.0f} MB" if found >= 10.0 else f"{found:.1f} MB"


def _quantity(measured: Errors) -> str:
    return "force" if measured.of_force else "field"


def _beside_force(measured: Errors) -> Iterator[str]:
    """What else was measured of a configuration that is judged by the force over time."""
    told = {
        "the largest force": measured.peak_force,
        "the displacement at the control points": measured.worst,
        "the displacement over the organ": measured.field,
    }
    if measured.discretisation != measured.force:  # against a reference, and not the same again
        told["the force against the finest lattice of the same springs"] = measured.discretisation
    parts = [f"of {of} {100 * error:.1f} %" for of, error in told.items() if error is not None]
    if parts:
        yield f"measured beside it: {', '.join(parts)}"


def table_of(
    candidates: Sequence[Candidate], quantity: str = "field", taken: Candidate | None = None
) -> Iterator[str]:
    """Those that none is both cheaper and more accurate than, and that taken; the cheapest first.

    For a rate alone a lattice in double precision is taken where it keeps up, though the same in
    single is cheaper and promises the same but for its rounding.
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
        f"chosen from (wall per simulated second, expected error of the {quantity}, memory"
        + (f", {SLOW:g} % of its frames):" if framed else "):")
    )
    for one in sorted(front, key=lambda one: one.wall_per_second):
        memory = "" if one.cost.memory is None else _in_mb(one.cost.memory)
        yield (
            f"{one.wall_per_second:>8.3g} s  {100 * one.promise.error:>5.1f} +- "
            f"{100 * one.promise.bar:.1f} %  {memory:>7}  {_frame_of(one)}"
            f"{in_words(one.configuration)}" + (" <- taken" if one is taken else "")
        )


def _frame_of(one: Candidate) -> str:
    """How long frames take at most, and whether they are late: why a candidate is not taken."""
    if one.frame is None:
        return ""
    within = one.frame.wall if one.frame.slow is None else one.frame.slow
    verdict = "in time" if one.frame.in_time else "late"
    return f"{1e3 * within:>7.3g} ms, {verdict:<7}  "
