"""The configuration that meets a demand on this machine: chosen by a fit, then run and timed.

Chosen from is the lattice stepped explicitly, with the volume term where the tissue's Poisson ratio
asks for it, by its spacing. Its error is run at a few coarse spacings and fitted by C h^p; its cost
is timed at all. For a rate alone the most accurate that keeps up is recommended, for an error the
cheapest that promises it. A promise is the fit with its spread and the reference's own error; the
recommended configuration is then run and timed afresh, and the next coarser one taken where it does
not keep up after all.

Where the place of the load is known beforehand, corrected lattices are chosen from too. There are
few, and each promises what a run of it was off by, or the reference's own error if that is more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from study.models.lattice import LatticeModel
from study.progress import Progress
from study.scene import Scene
from study.scene.file import write_scene
from study.sweep.runner import How
from study.sweep.store import Store
from study.tradeoff import reference, study
from study.tradeoff.demand import Demand
from study.tradeoff.errors import Errors, errors
from study.tradeoff.lineup import FRACTION, Configuration, lacks_poisson_ratio
from study.tradeoff.problem import Stated, arguments, stated, tidy
from study.tradeoff.rates import Frame, frame
from study.tradeoff.reference import Truth
from study.tradeoff.table import Cost
from study.tradeoff.timing import QUICK_REPEATS

FITTED = (2.5, 2.0, 1.75, 1.5, 1.25, 1.0)
FINER = (0.9, 0.8, 0.7, 0.6, 0.5)
"""Spacings, times that of the scene: those whose errors are fitted, and those left to the fit."""
ELEMENTS = 0.75
"""Element size of the reference chosen by, times that of the scene, in place of its accuracy."""
SPREAD = 2.8
"""Standard deviations that a promise allows for: Student's t at 95 % of a fit to six points."""
FEWEST = 3
BESIDE = (2.0, 1.5, 1.0)
"""Spacings of corrected lattices, times that of the scene."""


@dataclass(frozen=True)
class Promise:
    """A relative error of the field and how far from it the measured one may lie, either way."""

    error: float
    bar: float

    @property
    def most(self) -> float:
        """Its upper end."""
        return self.error + self.bar

    def holds(self, measured: float) -> bool:
        """Whether a measured error lies within."""
        return abs(measured - self.error) <= self.bar


@dataclass(frozen=True)
class Candidate:
    """A spacing [m] with what it is expected to give; `frame`: at the rate, if one is demanded.

    `corrected`: whether it is that of a corrected lattice, which follows one place of the load.
    """

    spacing: float
    promise: Promise
    cost: Cost
    frame: Frame | None
    corrected: bool = False

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
    """A candidate, whether it meets the demand, and what it was measured to give."""

    candidate: Candidate
    met: bool
    measured: Errors
    frame: Frame | None
    wall_per_second: float


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
    spacings = [tidy(times * scene.lattice.spacing) for times in FITTED]
    outcomes = study.solved(coarser, [_configuration(scene, h) for h in spacings], store, how)
    given = stated(**arguments(coarser))
    known = reference.truth(outcomes[0].value or {}, given)
    found = [errors(outcome, known, given) for outcome in outcomes[1:]]
    kept = [(h, e.field) for h, e in zip(spacings, found, strict=True) if e.field is not None]
    curve = fitted([h for h, _ in kept], [e for _, e in kept], known.field_error)
    every = [*spacings, *(tidy(times * scene.lattice.spacing) for times in FINER)]
    candidates = _candidates(given, every, curve, wanted, progress)
    if known_place:
        candidates += _corrected(given, known, wanted, store, how, progress)
    return _verified(given, known, candidates, wanted, store, how, progress)


def judged_by(scene: Scene) -> Scene:
    """The scene with a reference that takes seconds and states a larger error."""
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


def _configuration(scene: Scene, spacing: float, *, corrected: bool = False) -> Configuration:
    if corrected:
        return Configuration("corrected", {"spacing": spacing, "step_fraction": FRACTION})
    lacks = lacks_poisson_ratio(scene)
    name = "volume-springs" if lacks else "springs"
    settings = {"spacing": spacing, "volume_term": lacks, "step_fraction": FRACTION}
    return Configuration(name, settings)


def _candidates(
    given: Stated, spacings: Sequence[float], fit: Fit, wanted: Demand, progress: Progress
) -> list[Candidate]:
    """All spacings, timed in turns."""
    costs = _costs(given, spacings, progress)
    return [
        Candidate(h, fit.promise(h), cost, _frame(cost, wanted))
        for h, cost in zip(spacings, costs, strict=True)
    ]


def _corrected(
    given: Stated, known: Truth, wanted: Demand, store: Store, how: How, progress: Progress
) -> list[Candidate]:
    """Corrected lattices on the mesh of the scene that is judged by, run and timed in turns."""
    spacings = [tidy(times * given.scene.lattice.spacing) for times in BESIDE]
    chosen = [_configuration(given.scene, h, corrected=True) for h in spacings]
    _, *outcomes = study.solved(given.scene, chosen, store, how)
    costs = _costs(given, spacings, progress, corrected=True)
    return [
        Candidate(h, _as_measured(found, known.field_error), cost, _frame(cost, wanted), True)
        for h, found, cost in zip(
            spacings, (errors(one, known, given) for one in outcomes), costs, strict=True
        )
        if found.status in {"resolved", "not resolved"}
    ]


def _as_measured(found: Errors, own: float) -> Promise:
    """What a run was off by, with the reference's own error; that alone if it hides the other."""
    return Promise(found.field or 0.0, own)


def _costs(
    given: Stated, spacings: Sequence[float], progress: Progress, *, corrected: bool = False
) -> list[Cost]:
    chosen = [_configuration(given.scene, h, corrected=corrected) for h in spacings]
    longest = [float("inf")] * len(chosen)  # that at rest is less
    return study.costs(given, chosen, longest, QUICK_REPEATS, progress)


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
    given: Stated,
    known: Truth,
    candidates: Sequence[Candidate],
    wanted: Demand,
    store: Store,
    how: How,
    progress: Progress,
) -> Recommended:
    """The best candidate run and timed afresh, or the best of the others if it fails that."""
    chosen = best(candidates, wanted)
    kind = chosen.corrected
    configuration = _configuration(given.scene, chosen.spacing, corrected=kind)
    (_, outcome) = study.solved(given.scene, [configuration], store, how)
    measured = errors(outcome, known, given)
    (cost,) = _costs(given, [chosen.spacing], progress, corrected=kind)
    if outcome.value is not None:
        cost = replace(cost, step=min(cost.step, study.step_of(outcome)))
    again = _frame(cost, wanted)
    met = chosen.meets(wanted) and measured.status in {"resolved", "not resolved"}
    met = met and (again is None or again.in_time)
    met = met and (wanted.error is None or (measured.field or 0.0) <= wanted.error)
    others = [one for one in candidates if one is not chosen]
    if not met and chosen.meets(wanted) and others:
        return _verified(given, known, others, wanted, store, how, progress)
    return Recommended(chosen, met, measured, again, cost.timing.step[1] / cost.step)


def recommended_scene(scene: Scene, found: Recommended) -> str:
    """TOML text of the scene with the recommended lattice, promise and measurement above it.

    It names the model that was measured, springs of the tissue's own modulus, and the reference.
    """
    head = "".join(f"# {line}\n" for line in lines(found))
    if found.candidate.corrected:
        return head + "\n" + write_scene(_with_corrected(scene, found.candidate.spacing))
    chosen = _configuration(scene, found.candidate.spacing).model(scene)
    assert isinstance(chosen, LatticeModel)  # noqa: S101 - lattices only are recommended
    models = tuple(dict.fromkeys(("fem", *scene.models, "tissue")))
    return head + "\n" + write_scene(replace(scene, models=models, lattice=chosen.lattice))


def _with_corrected(scene: Scene, spacing: float) -> Scene:
    """The scene with a corrected lattice of a spacing [m]; the elements are its reference's."""
    own = replace(scene.lattice, step_fraction=FRACTION, time_step=None, step_rate=None)
    models = tuple(dict.fromkeys(("fem", *scene.models, "corrected")))
    corrected = replace(scene.corrected, spacing=spacing)
    return replace(scene, models=models, lattice=own, corrected=corrected)


def lines(found: Recommended) -> list[str]:
    """What is recommended, promised and measured, for a person."""
    one, measured = found.candidate, found.measured
    promise = one.promise
    error = (
        f"{100 * measured.field:.1f} %"
        if measured.field is not None
        else f"{measured.status}, below the reference's own error"
        if measured.status == "not resolved"
        else f"none: {measured.status} {measured.message}"
    )
    verdict = ""
    if measured.field is not None:
        verdict = ", as promised" if promise.holds(measured.field) else ", not as promised"
    text = [
        f"{'corrected ' * one.corrected}lattice of {1e3 * one.spacing:.3g} mm, explicit, "
        f"{FRACTION:g} of the critical step",
        f"field error promised {100 * promise.error:.1f} +- {100 * promise.bar:.1f} %, measured "
        f"{error}" + verdict,
    ]
    if found.frame is not None:
        slow = found.frame.slow
        text.append(
            f"frame: {found.frame.substeps} steps in {1e3 * found.frame.wall:.3g} ms"
            + ("" if slow is None else f", 95 % of them within {1e3 * slow:.3g} ms")
        )
    text.append(f"{found.wall_per_second:.3g} s of wall per simulated second on this machine")
    if one.corrected:
        text.append(
            "It follows this place of the load only. The error is that against linear elements: "
            "what geometry changes, which the model has, counts as error."
        )
    text.append(
        "The promise is for springs of the tissue's own modulus, tissue.youngs_modulus; those of a "
        "fuzzy estimate have its error on top."
    )
    return text
