"""Derivation of the knowledge bases that follow the reading.

    python -m fuzzy.liver.derivation

writes `partition.csv` and `combination.csv` into `fuzzy/liver/data`, the same on every run. The
objective of both bases is the relative squared error of the estimate, with equal weights for
Mamdani, Sugeno and type-2.

*freed*: as many sets as readings can resolve. Their centres divide the instrument's scale evenly in
ln kPa, at least LEAST_DISTANCE standard deviations of the reading noise apart, so that a reading at
one centre rarely falls to the next set. Least squares determine the consequents over virtual
patients of all aetiologies and livers uniform in ln kPa, half each, all with reading noise: the
expected stiffness for a reading.

*paper-count*: the sets of reading R1 of Table I, two per aetiology and three for HBV. Least squares
from several start values determine centres, crossings and consequents over readings of virtual
patients of that aetiology and readings uniform in ln kPa, half each.

Both: for the sets found, shift and power of the combinations of several diseases are fitted to
equal readings. With four or more readings, the sets of *freed* have a core. Of cores of 0, 0.1, 0.2
and 0.3 of the distance to the crossing, 0.2 minimises the decrease of the estimate as one reading
increases, without a larger error.
"""

import csv
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares, minimize

from fuzzy.liver.bases import KNOWLEDGE
from fuzzy.liver.knowledge import parameters
from fuzzy.liver.partition import (
    Combination,
    PlacedSet,
    Placement,
    following_system,
    reading_noise,
)
from fuzzy.liver.population import PA_PER_KPA, cohort, noisy_readings
from fuzzy.liver.readings import READINGS
from fuzzy.liver.settings import LiverSettings
from fuzzy.liver.table1 import AETIOLOGIES
from fuzzy.systems.inference import infer
from fuzzy.systems.kinds import SYSTEMS
from fuzzy.systems.sets import Array

SEED = 12
LEAST_DISTANCE = 5.0
"""Least distance of neighbouring centres of *freed*, in standard deviations of one reading."""
OUTERMOST = (2.6, 70.0)
"""Centres [kPa] of the lowest and the highest set of *freed*, a little inside the scale."""
NAMES = {
    2: ("low", "high"),
    3: ("low", "medium", "high"),
    7: ("lowest", "very-low", "low", "medium", "high", "very-high", "highest"),
}
PARTITION = ("knowledge", "aetiology", "set", "centre_kpa", "crossing_kpa", "consequent_kpa")
COMBINATION = ("knowledge", "diseases", "shift", "power", "core")
JUDGED = np.geomspace(4.0, 40.0, 60)
"""Readings [kPa] over which a base should follow the reading, and two sets can."""
TAUGHT = 600
"""Number of virtual patients, and of livers uniform in ln kPa, to which *freed* is fitted."""
STARTS = 6
POLISHED = 800
"""Iterations of the final simplex search of *paper-count*."""
UNCOMBINED = {size: Combination(0.0, 1.0) for size in (1, 2, 3, 4, 5)}
CELLS = {size: AETIOLOGIES[:size] for size in (2, 3, 4, 5)}
"""Number of cells to which combinations are fitted."""
CORES = {"freed": {4: 0.2, 5: 0.2}}
"""Cores by number of readings; none for other numbers."""


class TrainingData(NamedTuple):
    """Training data: readings [kPa] (N,), and the true stiffness [kPa] (N,) of each."""

    readings: Array
    expected: Array


def residuals(
    placed: Placement, present: Sequence[str], judged: TrainingData, knowledge: str
) -> Array:
    """Relative error of every estimate, for all systems in turn."""
    settings = LiverSettings(knowledge=knowledge)
    system = following_system(placed, settings, tuple(present))
    X = np.full((judged.readings.size, len(AETIOLOGIES)), parameters()["normal_liver"])
    X[:, [AETIOLOGIES.index(name) for name in present]] = judged.readings[:, None]
    found = [infer(system, X, kind, settings.options).value for kind in SYSTEMS]
    return np.concatenate([value / judged.expected - 1.0 for value in found])


def freed_sets() -> Placement:
    """The sets of *freed*, the same for every aetiology, with the consequents of each alone."""
    low, high = np.log(OUTERMOST)
    gaps = int((high - low) / (LEAST_DISTANCE * reading_noise()))
    centres = np.geomspace(*OUTERMOST, gaps + 1)
    crossings = np.sqrt(centres[:-1] * centres[1:])
    judged = all_training_data()

    def placed(consequents: Array) -> Placement:
        found = _placed_sets(centres, crossings, np.exp(consequents))
        return Placement(dict.fromkeys(AETIOLOGIES, found), UNCOMBINED)

    start = np.log(centres)
    return placed(
        _fitted(
            lambda x: residuals(placed(x), AETIOLOGIES[:1], judged, "freed"),
            start,
            (start - 0.4, start + 0.2),
        )
    )


def all_training_data() -> TrainingData:
    """Virtual patients of all aetiologies, and livers uniform in ln kPa, with one exam each."""
    rng = np.random.default_rng(SEED)
    patients = cohort(TAUGHT, SEED).stiffness / PA_PER_KPA
    livers = np.concatenate([patients, np.geomspace(*OUTERMOST, TAUGHT)])
    return TrainingData(noisy_readings(livers, 1, rng)[:, 0], livers)


def paper_count_sets() -> Placement:
    """The sets of *paper-count*, by aetiology."""
    counts = READINGS["R1"].counts
    return Placement(
        {name: _optimised(name, count) for name, count in zip(AETIOLOGIES, counts, strict=True)},
        UNCOMBINED,
    )


def aetiology_training_data(name: str) -> TrainingData:
    """Quantiles of the readings of virtual patients, and readings uniform in ln kPa, half each."""
    drawn = cohort(20_000, SEED)
    chosen = drawn.main == AETIOLOGIES.index(name)
    levels = np.quantile(drawn.readings[chosen, AETIOLOGIES.index(name)], QUANTILES) / PA_PER_KPA
    readings = np.concatenate([levels, JUDGED])
    return TrainingData(readings, readings)


QUANTILES = (np.arange(JUDGED.size) + 0.5) / JUDGED.size


def _optimised(name: str, count: int) -> tuple[PlacedSet, ...]:
    judged = aetiology_training_data(name)
    rng = np.random.default_rng(SEED)
    found = [_searched(name, judged, start) for start in _starts(count, rng)]

    def loss_at(x: Array) -> float:
        return loss(name, sets_from_unknowns(x, count), judged)

    best = min(found, key=loss_at)
    # Consequents are rounded, and a simplex steps over the stairs that this makes.
    polished = minimize(
        loss_at,
        best,
        method="Nelder-Mead",
        bounds=np.transpose(_bounds(count)),
        options={"maxfev": POLISHED},
    )
    return sets_from_unknowns(np.asarray(polished.x), count)


def loss(name: str, sets: tuple[PlacedSet, ...], judged: TrainingData) -> float:
    """Mean square of the residuals of one aetiology's sets."""
    placed = Placement(dict.fromkeys(AETIOLOGIES, sets), UNCOMBINED)
    return float(np.mean(residuals(placed, (name,), judged, "paper-count") ** 2))


def _starts(count: int, rng: np.random.Generator) -> Iterable[Array]:
    """Start values: ln of the first centre, of the gaps, and of the consequents."""
    for _ in range(STARTS):
        centres = np.sort(rng.uniform(np.log(3.0), np.log(50.0), count))
        gaps = np.maximum(np.diff(centres), 0.3)
        yield np.concatenate([centres[:1], np.log(gaps), np.zeros(count - 1), centres])


def _searched(name: str, judged: TrainingData, start: Array) -> Array:
    """Least-squares solution from a start value."""
    count = (start.size + 1) // 3

    def misfit(x: Array) -> Array:
        placed = Placement(dict.fromkeys(AETIOLOGIES, sets_from_unknowns(x, count)), UNCOMBINED)
        return residuals(placed, (name,), judged, "paper-count")

    low, high = _bounds(count)
    return _fitted(misfit, np.clip(start, low + 1e-6, high - 1e-6), (low, high))


def _bounds(count: int) -> tuple[Array, Array]:
    """Bounds of the unknowns: first centre, gaps, logits of crossings, consequents."""
    p = parameters()
    ends = np.log([[p["input_low"], 20.0], [p["concluded_low"], p["concluded_high"]]])
    parts = [ends[:1], *[[(-2.0, 1.2)]] * (count - 1), *[[(-2.5, 2.5)]] * (count - 1)]
    low, high = np.concatenate([*parts, np.repeat(ends[1:], count, axis=0)]).T
    return low, high


def sets_from_unknowns(x: Array, count: int) -> tuple[PlacedSet, ...]:
    """The sets for given unknowns; a crossing divides its gap by a logistic fraction."""
    gaps = np.exp(x[1:count])
    centres = x[0] + np.concatenate([[0.0], np.cumsum(gaps)])
    shares = 1.0 / (1.0 + np.exp(-x[count : 2 * count - 1]))
    consequents = np.sort(np.exp(x[2 * count - 1 :]))
    return _placed_sets(np.exp(centres), np.exp(centres[:-1] + shares * gaps), consequents)


def _placed_sets(centres: Array, crossings: Array, consequents: Array) -> tuple[PlacedSet, ...]:
    names = NAMES[centres.size]
    ends = [*crossings, np.inf]
    return tuple(
        PlacedSet(*row)
        for row in zip(
            names, map(float, centres), map(float, ends), map(float, consequents), strict=True
        )
    )


def with_combinations(
    placed: Placement, knowledge: str, sizes: Sequence[int] | None = None
) -> Placement:
    """The sets with fitted shift and power of combinations of the given numbers of diseases.

    By default, all numbers for which the knowledge base has cells.
    """
    judged = TrainingData(JUDGED[::2], JUDGED[::2])
    cores = CORES.get(knowledge, {})
    wanted = sizes or [size for size in CELLS if size < 5 or KNOWLEDGE[knowledge].completed]

    def fitted(size: int) -> Combination:
        def combined(x: Array) -> Combination:
            return Combination(float(x[0]), float(x[1]), cores.get(size, 0.0))

        def misfit(x: Array) -> Array:
            tried = Placement(placed.sets, {**UNCOMBINED, size: combined(x)})
            return residuals(tried, CELLS[size], judged, knowledge)

        found = _fitted(misfit, np.array([0.0, 1.0]), (np.array([-2.0, 0.5]), np.array([2.0, 2.0])))
        return combined(found)

    return Placement(placed.sets, {**UNCOMBINED, **{size: fitted(size) for size in wanted}})


def _fitted(misfit: Callable[[Array], Array], start: Array, bounds: tuple[Array, Array]) -> Array:
    # Unknowns are counted from 1, so that a relative step is an absolute one; consequents are
    # rounded to output sets, and it must be wider than their distance.
    low, high = (bound - start + 1.0 for bound in bounds)
    found = least_squares(
        lambda moved: misfit(moved + start - 1.0),
        np.ones(start.size),
        bounds=(low, high),
        diff_step=0.05,
        max_nfev=60,
    )
    return np.asarray(found.x + start - 1.0)


def derived() -> dict[str, Placement]:
    """Knowledge bases by name, derived from published data only."""
    sets = {"paper-count": paper_count_sets(), "freed": freed_sets()}
    return {name: with_combinations(placed, name) for name, placed in sets.items()}


def write(bases: Mapping[str, Placement], folder: Path) -> None:
    """Write both tables into a folder."""
    partition = [
        (
            knowledge,
            name,
            one.name,
            f"{one.centre:.5g}",
            f"{one.crossing:.5g}" if np.isfinite(one.crossing) else "",
            f"{one.consequent:.5g}",
        )
        for knowledge, placed in bases.items()
        for name in AETIOLOGIES
        for one in placed.sets[name]
    ]
    combination = [
        (knowledge, str(size), f"{one.shift:.4f}", f"{one.power:.4f}", f"{one.core:g}")
        for knowledge, placed in bases.items()
        for size, one in placed.combinations.items()
    ]
    for file, lines in (
        ("partition.csv", [PARTITION, *partition]),
        ("combination.csv", [COMBINATION, *combination]),
    ):
        with (folder / file).open("w", newline="", encoding="utf-8") as opened:
            csv.writer(opened, lineterminator="\n").writerows(lines)


if __name__ == "__main__":
    write(derived(), Path(str(files("fuzzy.liver") / "data")))
