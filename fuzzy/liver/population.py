"""Virtual patients sampled from published distributions of liver stiffness, with readings.

A patient has one liver of one stiffness and a main aetiology. In hepatitis B and C a stage is drawn
by the numbers of patients published for it (F0 by those of carriers of hepatitis B without liver
disease, for both), and then a stiffness, log-normal with the mean and SD published for the stage.
In the others, for which no mean of a stage was found, the stiffness follows the percentiles of the
whole published group, linear in ln kPa over normal scores, and the stage is read off the cut-offs.
Published spreads include the reading noise, which is subtracted.

Co-morbidities are added independently, with the share of adults in a population survey who have
them; the main aetiology alone decides the stiffness. There is a reading for every aetiology: the
true stiffness times an error of the exam, which grows with stiffness, and one of the operator. That
several readings of one liver have independent errors, and that none has a bias, are assumptions.
"""

from functools import cache
from math import hypot, log, sqrt
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fuzzy.liver.knowledge import input_records, parameters, rows
from fuzzy.liver.table1 import AETIOLOGIES
from fuzzy.systems.sets import Array

PA_PER_KPA = 1e3
QUARTILES_TO_SD = 2.0 * NormalDist().inv_cdf(0.75)
MEDIAN_OF_TEN = sqrt(0.5 * np.pi / 10.0)
"""Standard error of the median of ten normal shots, over their SD."""
MIDDLE_STAGES = ("F0-F1", "F2", "F3", "F4")


class Cohort(NamedTuple):
    """Virtual patients: true `stiffness` [Pa] (N,), `readings` [Pa] (N, 5), NaN for none.

    Columns follow AETIOLOGIES. `main` (N,) is the column of the main aetiology, `stage` (N,) the
    stage of fibrosis by name.
    """

    stiffness: Array
    readings: Array
    main: NDArray[np.int64]
    stage: NDArray[np.str_]


def cohort(patients: int, seed: int) -> Cohort:
    """Virtual patients, equally many of each main aetiology. ValueError for fewer than 5."""
    if patients < len(AETIOLOGIES):
        raise ValueError(f"patients = {patients}: give at least {len(AETIOLOGIES)}")
    rng = np.random.default_rng(seed)
    main = np.arange(patients) % len(AETIOLOGIES)
    stiffness, stage = np.empty(patients), np.empty(patients, dtype="<U5")
    for column, name in enumerate(AETIOLOGIES):
        chosen = main == column
        stiffness[chosen], stage[chosen] = _livers(name, int(chosen.sum()), rng)
    present = rng.random((patients, len(AETIOLOGIES))) < _shares()
    present[np.arange(patients), main] = True
    readings = np.where(present, noisy_readings(stiffness, len(AETIOLOGIES), rng), np.nan)
    return Cohort(stiffness * PA_PER_KPA, readings * PA_PER_KPA, main, stage)


def noisy_readings(stiffness: Array, exams: int, rng: np.random.Generator) -> Array:
    """Readings (N, exams) of livers of this stiffness (N,), both in kPa."""
    noise = np.hypot(exam_noise(stiffness), parameters()["operator_noise"])
    errors = rng.standard_normal((stiffness.size, exams))
    p = parameters()
    return np.clip(
        stiffness[:, None] * np.exp(noise[:, None] * errors), p["input_low"], p["input_high"]
    )


def exam_noise(stiffness: Array) -> Array:
    """Relative standard error of the median of ten shots at these stiffnesses [kPa]."""
    found = rows("exam_noise.csv")
    ends = [float(row["to_kpa"]) for row in found[:-1]]
    spreads = np.array([float(row["iqr_over_median"]) for row in found])
    return np.asarray(spreads[np.searchsorted(ends, stiffness)] / QUARTILES_TO_SD * MEDIAN_OF_TEN)


def _livers(name: str, number: int, rng: np.random.Generator) -> tuple[Array, NDArray[np.str_]]:
    """Stiffness [kPa] and stage of `count` patients of a main aetiology."""
    staged = [row for row in rows("stages.csv") if row["aetiology"] == name]
    return _by_stage(staged, number, rng) if staged else _by_percentile(name, number, rng)


def _by_stage(
    staged: list[dict[str, str]], number: int, rng: np.random.Generator
) -> tuple[Array, NDArray[np.str_]]:
    counts = np.array([float(row["n"]) for row in staged])
    drawn = rng.choice(len(staged), size=number, p=counts / counts.sum())
    moments = np.array([_log_moments(row) for row in staged])
    centre, spread = moments[drawn].T
    stiffness = np.exp(centre + spread * rng.standard_normal(number))
    return _on_scale(stiffness), np.array([row["stage"] for row in staged])[drawn]


def _log_moments(row: dict[str, str]) -> tuple[float, float]:
    """Mean and SD of ln kPa of a stage, without reading noise."""
    mean, sd = float(row["mean_kpa"]), float(row["sd_kpa"])
    variance = log(1.0 + (sd / mean) ** 2)
    return log(mean) - 0.5 * variance, sqrt(max(variance - _noise_at(mean) ** 2, 0.0))


def _noise_at(stiffness: float) -> float:
    return hypot(float(exam_noise(np.array([stiffness]))[0]), parameters()["operator_noise"])


def _by_percentile(
    name: str, number: int, rng: np.random.Generator
) -> tuple[Array, NDArray[np.str_]]:
    scores, values = _percentiles(name)
    drawn = rng.standard_normal(number)
    inner = np.interp(drawn, scores, values)
    below = np.minimum(drawn - scores[0], 0.0) * (values[1] - values[0]) / (scores[1] - scores[0])
    above = np.maximum(drawn - scores[-1], 0.0) * (values[-1] - values[-2])
    stiffness = _on_scale(np.exp(inner + below + above / (scores[-1] - scores[-2])))
    cut_offs = [one.centre for one in input_records(name, 3, "cut-off")]
    return stiffness, np.array(MIDDLE_STAGES)[np.searchsorted(cut_offs, stiffness, side="right")]


def _percentiles(name: str) -> tuple[Array, Array]:
    """Normal scores and ln kPa of a group's percentiles, corrected for reading noise."""
    (row,) = (row for row in rows("groups.csv") if row["aetiology"] == name)
    known = {key: float(row[key]) for key in row if key.startswith("p") and row[key]}
    shares = [float(key[1:].replace("_", ".")) / 100.0 for key in known]
    middle, spread = known["p50"], log(known["p75"] / known["p25"]) / QUARTILES_TO_SD
    inwards = sqrt(max(1.0 - (_noise_at(middle) / spread) ** 2, 0.0))
    values = [log(middle) + inwards * log(value / middle) for value in known.values()]
    return np.array([NormalDist().inv_cdf(share) for share in shares]), np.array(values)


def _on_scale(stiffness: Array) -> Array:
    return np.clip(stiffness, parameters()["input_low"], parameters()["input_high"])


@cache
def _shares() -> tuple[float, ...]:
    """Share of adults with each aetiology, in the order of AETIOLOGIES."""
    found = {row["aetiology"]: float(row["share_of_adults"]) for row in rows("groups.csv")}
    return tuple(found[name] for name in AETIOLOGIES)
