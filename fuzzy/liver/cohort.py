"""Accuracy of each knowledge base and kind of system on virtual patients.

All contenders are evaluated on the same patients of `fuzzy.liver.population`: fuzzy systems of
every knowledge base, learned consequents, and baselines without fuzzy logic. Learned contenders are
cross-validated: patients are split into FOLDS, and each fold is estimated after training on the
others.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fuzzy.liver.bases import KNOWLEDGE
from fuzzy.liver.knowledge import input_records
from fuzzy.liver.population import PA_PER_KPA, Cohort, cohort
from fuzzy.liver.settings import LiverSettings
from fuzzy.liver.stiffness import NORMAL_LIVER
from fuzzy.liver.system import liver_system
from fuzzy.liver.table1 import AETIOLOGIES
from fuzzy.systems.compiled import compiled
from fuzzy.systems.kinds import SYSTEMS
from fuzzy.systems.sets import Array, membership
from fuzzy.systems.sugeno import constants
from fuzzy.systems.system import FuzzySystem, firing_strengths

MOST_PATIENTS = 10_000_000
FOLDS = 5
NORMAL_95 = 1.959964
NOMINAL = 0.9
"""Nominal coverage of the type-2 interval of a base that follows the reading."""
FOLLOWED = np.geomspace(4.0, 40.0, 200) * PA_PER_KPA
"""Readings [Pa] over which an estimate should increase, one aetiology at a time."""
RIDGE = 3.0
"""Weight, in patients, of the prior consequent in ridge regression."""

Displacement = Callable[[Array], Array]
"""Displacement [m] of the tool, up to a factor, as a function of stiffness [Pa]."""


class Answers(NamedTuple):
    """Estimates [Pa] (N,) of one contender, and the type-2 interval [Pa] (N, 2) or None."""

    value: Array
    interval: Array | None = None


class CohortRow(NamedTuple):
    """Errors of one contender over one group of patients; stiffness in Pa.

    `aetiology`, `stage` and `readings` (1, 2 or more) define the group, `all` for no selection.
    Relative errors are over the true stiffness; `relative_rms_low` and `_high` are the 95 %
    confidence interval of `relative_rms` by the sampling of patients. `displacement_rms`: relative
    rms error of the displacement, NaN if not requested. `coverage`: share of patients in the type-2
    interval; `width`: mean width over the true stiffness; NaN for other systems. `largest_fall`:
    largest relative decrease of the estimate as the reading of the aetiology alone increases from 4
    to 40 kPa in steps of 1.2 %, NaN for other groups.
    """

    contender: str
    aetiology: str
    stage: str
    readings: str
    patients: int
    bias: float
    rms: float
    relative_bias: float
    relative_rms: float
    relative_rms_low: float
    relative_rms_high: float
    displacement_rms: float
    coverage: float
    width: float
    largest_fall: float


class Comparison(NamedTuple):
    """Relative rms error of the best fuzzy system minus that of a baseline, with 95 % interval.

    The errors are paired by patient. Negative values favour the fuzzy system.
    """

    readings: str
    fuzzy: str
    baseline: str
    difference: float
    low: float
    high: float

    @property
    def verdict(self) -> str:
        """The better of the two, in a word."""
        if self.high < 0:
            return "better"
        return "worse" if self.low > 0 else "undecided"


Contender = Callable[[Cohort], Answers]

PLAIN = {
    "1": ("baseline: reading",),
    "2 or more": ("baseline: reading", "baseline: mean of readings"),
}
"""Baselines without training, by number of readings."""


def contenders() -> dict[str, Contender]:
    """All contenders by name, the fuzzy ones first."""
    return {**fuzzy_contenders(), **LEARNT, **BASELINES}


def fuzzy_contenders() -> dict[str, Contender]:
    """Every kind of system on every knowledge base, by name."""
    return {
        f"{knowledge} {kind}": partial(by_system, kind, LiverSettings(knowledge=knowledge))
        for knowledge in KNOWLEDGE
        for kind in SYSTEMS
    }


def by_system(kind: str, settings: LiverSettings, patients: Cohort) -> Answers:
    """Estimates of one kind of system, in groups with readings of the same aetiologies."""
    value = np.empty(patients.stiffness.size)
    interval = np.empty((value.size, 2)) if kind == "interval-type-2" else None
    for present, chosen in patterns(patients.readings):
        heard = present if settings.missing.silences else AETIOLOGIES
        system = liver_system(settings, heard)
        rows = filled(patients.readings[chosen]) / PA_PER_KPA
        found = compiled(system, kind, settings.options, pruned=False).evaluate(rows)
        value[chosen] = found.value * PA_PER_KPA
        if interval is not None and found.interval is not None:
            interval[chosen] = found.interval * PA_PER_KPA
    return Answers(value, interval)


def patterns(readings: Array) -> Iterator[tuple[tuple[str, ...], NDArray[np.intp]]]:
    """Sets of aetiologies with readings, and the rows of patients with exactly these."""
    codes = np.isfinite(readings) @ (1 << np.arange(len(AETIOLOGIES)))
    for code in np.unique(codes):
        present = tuple(name for i, name in enumerate(AETIOLOGIES) if int(code) >> i & 1)
        yield present, np.flatnonzero(codes == code)


def filled(readings: Array) -> Array:
    """The readings [Pa], with that of a normal liver for missing ones."""
    return np.where(np.isfinite(readings), readings, NORMAL_LIVER)


# --- learnt consequents ------------------------------------------------------------------------


def learnt(teach: Callable[[Array, Array, Array], Array], patients: Cohort) -> Answers:
    """Cross-validated Sugeno estimates of the freed base with learned consequents.

    `teach` computes consequents (R,) of normalised strengths (N, R), true stiffness (N,) and the
    consequents of the base, all in kPa.
    """
    settings = LiverSettings(knowledge="freed")
    value = np.empty(patients.stiffness.size)
    folds = _folds(patients)
    for present, chosen in patterns(patients.readings):
        system = liver_system(settings, present)
        shares = _shares_of_rules(system, filled(patients.readings[chosen]) / PA_PER_KPA)
        base = _consequents(system, settings)
        truth = patients.stiffness[chosen] / PA_PER_KPA
        for fold in range(FOLDS):
            held = folds[chosen] == fold
            taught = teach(shares[~held], truth[~held], base)
            value[chosen[held]] = shares[held] @ taught * PA_PER_KPA
    return Answers(value)


def _folds(patients: Cohort) -> NDArray[np.intp]:
    """Fold of every patient, stratified by main aetiology."""
    return np.arange(patients.main.size) // len(AETIOLOGIES) % FOLDS


def _shares_of_rules(system: FuzzySystem, X: Array) -> Array:
    # Rows are taken in parts, as strengths of all rules and patients at once fill the memory.
    parts = np.array_split(X, max(1, X.shape[0] * len(system.rules) // 4_000_000))
    strengths = np.concatenate([firing_strengths(system, x, membership) for x in parts], axis=1).T
    return np.asarray(strengths / strengths.sum(axis=1, keepdims=True))


def _consequents(system: FuzzySystem, settings: LiverSettings) -> Array:
    by_set = constants(system, settings.options.sampling, settings.options.samples)
    return by_set[[rule.consequent for rule in system.rules]]


def wang_mendel(shares: Array, truth: Array, base: Array) -> Array:
    """Wang and Mendel's method: the mean of the patients whose strongest rule it is.

    Patients are weighted by strength. A rule that is the strongest for no patient keeps its
    consequent.
    """
    strongest = shares.argmax(axis=1)
    weights = shares[np.arange(len(shares)), strongest]
    total = np.bincount(strongest, weights, base.size)
    moment = np.bincount(strongest, weights * truth, base.size)
    return np.where(total > 0, moment / np.where(total > 0, total, 1.0), base)


def least_squares(shares: Array, truth: Array, base: Array) -> Array:
    """Ridge regression of the consequents by relative squared error, towards those of the base."""
    scaled = shares * base / truth[:, None]  # acts on consequents over the base's
    missed = 1.0 - scaled.sum(axis=1)
    if len(scaled) < base.size:  # the same by fewer unknowns: one a patient
        gram = scaled @ scaled.T + RIDGE * np.eye(len(scaled))
        return np.asarray(base * (1.0 + scaled.T @ np.linalg.solve(gram, missed)))
    normal = scaled.T @ scaled + RIDGE * np.eye(base.size)
    return np.asarray(base * (1.0 + np.linalg.solve(normal, scaled.T @ missed)))


LEARNT: dict[str, Contender] = {
    "learnt: Wang-Mendel": partial(learnt, wang_mendel),
    "learnt: least squares": partial(learnt, least_squares),
}


# --- baselines ---------------------------------------------------------------------------------


def main_reading(patients: Cohort) -> Answers:
    """The reading of the main aetiology."""
    return Answers(patients.readings[np.arange(patients.main.size), patients.main])


def mean_reading(patients: Cohort) -> Answers:
    """The mean of a patient's readings."""
    return Answers(np.asarray(np.nanmean(patients.readings, axis=1)))


def stage_mean(patients: Cohort) -> Answers:
    """Mean stiffness of training patients of the same main aetiology and stage by cut-offs."""
    reading = main_reading(patients).value
    groups = np.array([_between_cut_offs(name, reading) for name in AETIOLOGIES])
    group = groups[patients.main, np.arange(reading.size)] + 4 * patients.main
    return _cross_validated(
        patients,
        lambda taught, asked: _group_means(group[taught], patients.stiffness[taught])[group[asked]],
    )


def _between_cut_offs(name: str, reading: Array) -> NDArray[np.intp]:
    cut_offs = [one.centre * PA_PER_KPA for one in input_records(name, 3, "cut-off")]
    return np.searchsorted(cut_offs, reading, side="right")


def _group_means(group: NDArray[np.intp], stiffness: Array) -> Array:
    number = 4 * len(AETIOLOGIES)
    counts = np.bincount(group, minlength=number)
    sums = np.bincount(group, stiffness, number)
    return np.where(counts > 0, sums / np.maximum(counts, 1), stiffness.mean())


def linear_regression(patients: Cohort) -> Answers:
    """Linear regression on the mean of the readings, by relative squared error."""
    x = mean_reading(patients).value

    def fitted(taught: NDArray[np.intp], asked: NDArray[np.intp]) -> Array:
        truth = patients.stiffness[taught]
        basis = np.stack([np.ones_like(truth), x[taught]], axis=1) / truth[:, None]
        (intercept, slope), *_ = np.linalg.lstsq(basis, np.ones_like(truth))
        return np.asarray(intercept + slope * x[asked])

    return _cross_validated(patients, fitted)


def isotonic_regression(patients: Cohort) -> Answers:
    """Isotonic regression on the mean of the readings, by relative squared error."""
    from scipy.optimize import isotonic_regression as fit

    x = mean_reading(patients).value

    def fitted(taught: NDArray[np.intp], asked: NDArray[np.intp]) -> Array:
        order = np.argsort(x[taught])
        truth = patients.stiffness[taught][order]
        found = fit(truth, weights=truth**-2.0).x
        return np.asarray(np.interp(x[asked], x[taught][order], found))

    return _cross_validated(patients, fitted)


def _cross_validated(
    patients: Cohort, fitted: Callable[[NDArray[np.intp], NDArray[np.intp]], Array]
) -> Answers:
    everyone, folds = np.arange(patients.stiffness.size), _folds(patients)
    value = np.empty(everyone.size)
    for fold in range(FOLDS):
        held = folds == fold
        value[held] = fitted(everyone[~held], everyone[held])
    return Answers(value)


BASELINES: dict[str, Contender] = {
    "baseline: reading": main_reading,
    "baseline: mean of readings": mean_reading,
    "baseline: stage mean": stage_mean,
    "baseline: linear": linear_regression,
    "baseline: isotonic": isotonic_regression,
}


# --- errors ------------------------------------------------------------------------------------


def judge(
    patients: Cohort,
    answers: Mapping[str, Answers],
    displacement: Displacement | None = None,
) -> tuple[CohortRow, ...]:
    """A row per contender and group: all, by number of readings, by aetiology, by stage."""
    return tuple(
        _row(name, group, patients, found, displacement)
        for name, found in answers.items()
        for group in _groups(patients)
        if group.rows.size
    )


class _Group(NamedTuple):
    aetiology: str
    stage: str
    readings: str
    rows: NDArray[np.intp]


def _groups(patients: Cohort) -> Iterator[_Group]:
    number = np.isfinite(patients.readings).sum(axis=1)
    yield _Group("all", "all", "all", np.arange(number.size))
    yield _Group("all", "all", "1", np.flatnonzero(number == 1))
    yield _Group("all", "all", "2 or more", np.flatnonzero(number > 1))
    for column, name in enumerate(AETIOLOGIES):
        own = patients.main == column
        yield _Group(name, "all", "all", np.flatnonzero(own))
        for stage in np.unique(patients.stage[own]):
            yield _Group(name, str(stage), "all", np.flatnonzero(own & (patients.stage == stage)))


def _row(
    contender: str,
    group: _Group,
    patients: Cohort,
    found: Answers,
    displacement: Displacement | None,
) -> CohortRow:
    aetiology, stage, readings, rows = group
    truth, value = patients.stiffness[rows], found.value[rows]
    relative = value / truth - 1.0
    rms, half = _rms(relative)
    is_followed = stage == "all" and aetiology != "all"
    return CohortRow(
        contender,
        aetiology,
        stage,
        readings,
        patients=rows.size,
        bias=float(np.mean(value - truth)),
        rms=float(np.sqrt(np.mean((value - truth) ** 2))),
        relative_bias=float(np.mean(relative)),
        relative_rms=rms,
        relative_rms_low=rms - half,
        relative_rms_high=rms + half,
        displacement_rms=_displacement_rms(value, truth, displacement),
        **_interval(found.interval, truth, rows),
        largest_fall=_largest_fall(contender, aetiology) if is_followed else np.nan,
    )


def _rms(errors: Array) -> tuple[float, float]:
    """Root mean square, and half the width of its 95 % interval."""
    squares = errors**2
    rms = float(np.sqrt(squares.mean()))
    return rms, float(NORMAL_95 * squares.std() / np.sqrt(squares.size) / max(2.0 * rms, 1e-300))


def _displacement_rms(value: Array, truth: Array, displacement: Displacement | None) -> float:
    if displacement is None:
        return np.nan
    return _rms(displacement(value) / displacement(truth) - 1.0)[0]


def _interval(interval: Array | None, truth: Array, rows: NDArray[np.intp]) -> dict[str, float]:
    if interval is None:
        return {"coverage": np.nan, "width": np.nan}
    low, high = interval[rows].T
    return {
        "coverage": float(np.mean((low <= truth) & (truth <= high))),
        "width": float(np.mean((high - low) / truth)),
    }


def _largest_fall(contender: str, aetiology: str) -> float:
    """Largest relative decrease of a fuzzy estimate; NaN for other contenders."""
    evaluate = fuzzy_contenders().get(contender)
    if evaluate is None:
        return np.nan
    column = AETIOLOGIES.index(aetiology)
    readings = np.full((FOLLOWED.size, len(AETIOLOGIES)), np.nan)
    readings[:, column] = FOLLOWED
    main = np.full(FOLLOWED.size, column)
    value = evaluate(Cohort(FOLLOWED, readings, main, np.full(FOLLOWED.size, ""))).value
    return float(max(0.0, np.max(value[:-1] / value[1:] - 1.0)))


def compare(patients: Cohort, answers: Mapping[str, Answers]) -> tuple[Comparison, ...]:
    """The best fuzzy system against the plain and the best baseline, by number of readings."""
    return tuple(
        _compared(group, patients, answers, fuzzy, baseline)
        for group in list(_groups(patients))[1:3]
        for fuzzy in [_best(group, patients, answers, tuple(fuzzy_contenders()))]
        for baseline in dict.fromkeys(
            [*PLAIN[group.readings], _best(group, patients, answers, tuple(BASELINES))]
        )
    )


def _best(
    group: _Group, patients: Cohort, answers: Mapping[str, Answers], names: Sequence[str]
) -> str:
    return min(names, key=lambda name: _rms(_relative(group, patients, answers[name]))[0])


def _relative(group: _Group, patients: Cohort, found: Answers) -> Array:
    return np.asarray(found.value[group.rows] / patients.stiffness[group.rows] - 1.0)


def _compared(
    group: _Group, patients: Cohort, answers: Mapping[str, Answers], fuzzy: str, baseline: str
) -> Comparison:
    one, other = (_relative(group, patients, answers[name]) for name in (fuzzy, baseline))
    (first, _), (second, _) = _rms(one), _rms(other)
    # To first order each rms moves by the mean of the squares over twice itself.
    moves = one**2 / (2.0 * first) - other**2 / (2.0 * second)
    half = float(NORMAL_95 * moves.std() / np.sqrt(moves.size))
    change = first - second
    return Comparison(group.readings, fuzzy, baseline, change, change - half, change + half)


class CohortStudy(NamedTuple):
    """Rows by contender and group, and the comparisons with baselines."""

    rows: tuple[CohortRow, ...]
    comparisons: tuple[Comparison, ...]


def cohort_study(patients: int, seed: int, displacement: Displacement | None = None) -> CohortStudy:
    """Evaluate every contender on virtual patients. ValueError for too few or too many of them."""
    least = 100 * len(AETIOLOGIES)
    if not least <= patients <= MOST_PATIENTS:
        raise ValueError(
            f"patients = {patients}: give {least} to {MOST_PATIENTS}, for every group to have some "
            "and all to fit in memory"
        )
    drawn = cohort(patients, seed)
    answers = {name: evaluate(drawn) for name, evaluate in contenders().items()}
    return CohortStudy(judge(drawn, answers, displacement), compare(drawn, answers))
