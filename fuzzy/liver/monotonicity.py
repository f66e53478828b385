"""Violations of monotonicity: decreases of an estimate as one of several readings increases.

For random patients, one reading increases over the whole scale in fine steps with the others fixed.
There are two kinds of patients: readings anywhere on the scale, which no liver has, and readings of
one liver with the noise of exams and operators.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from fuzzy.liver.knowledge import parameters
from fuzzy.liver.partition import reading_noise
from fuzzy.liver.settings import LiverSettings
from fuzzy.liver.system import liver_system
from fuzzy.liver.table1 import AETIOLOGIES
from fuzzy.systems.compiled import compiled
from fuzzy.systems.sets import Array

POINTS = 121
"""Points on the scale, in steps of 3 %."""
PATIENTS = 60
LIVERS = (3.0, 50.0)
"""Range of true stiffness [kPa] of the livers, uniform in ln kPa."""
ABOUT = 0.35
"""Half-width in ln kPa of the increase of a reading of one liver: three SDs of its noise."""


class Fall(NamedTuple):
    """Largest decrease of an estimate, relative to the largest value before it, and its place.

    `anywhere`: for readings over the whole scale; `of_one_liver`: for readings of one liver.
    """

    readings: int
    anywhere: float
    of_one_liver: float


def falls(kind: str, settings: LiverSettings) -> Iterator[Fall]:
    """Largest decrease of one kind of system, by number of readings."""
    for number in range(1, len(AETIOLOGIES) + 1):
        found = [largest_fall(kind, settings, some) for some in combinations(AETIOLOGIES, number)]
        anywhere, of_one_liver = (max(part) for part in list(zip(*found, strict=True))[1:])
        yield Fall(number, anywhere, of_one_liver)


def largest_fall(
    kind: str, settings: LiverSettings, present: Sequence[str], patients: int = PATIENTS
) -> Fall:
    """Largest decrease of one kind of system with readings of the aetiologies `present`."""
    low, high = parameters()["input_low"], parameters()["input_high"]
    scale, rng = np.geomspace(low, high, POINTS), np.random.default_rng(len(present))
    drawn = low * (high / low) ** rng.random((patients, len(present)))
    liver = LIVERS[0] * (LIVERS[1] / LIVERS[0]) ** rng.random((patients, 1))
    close = liver * np.exp(reading_noise() * rng.standard_normal(drawn.shape))
    about = np.exp(np.linspace(-ABOUT, ABOUT, POINTS))
    rising = rng.integers(len(present), size=patients)
    anywhere = [_raised(row, i, scale) for row, i in zip(drawn, rising, strict=True)]
    of_one = [_raised(row, i, row[i] * about) for row, i in zip(close, rising, strict=True)]
    return Fall(
        len(present),
        _fall(kind, settings, present, np.array(anywhere)),
        _fall(kind, settings, present, np.clip(of_one, low, high)),
    )


def _raised(row: Array, column: int, values: Array) -> Array:
    """Readings (P, n) in which one takes the values (P,)."""
    found = np.tile(row, (len(values), 1))
    found[:, column] = values
    return found


def _fall(kind: str, settings: LiverSettings, present: Sequence[str], lines: Array) -> float:
    """Largest decrease along any series of readings (patients, P, n) [kPa]."""
    X = np.full((*lines.shape[:2], len(AETIOLOGIES)), parameters()["normal_liver"])
    X[..., [AETIOLOGIES.index(name) for name in present]] = lines
    system = liver_system(settings, tuple(present))
    answers = compiled(system, kind, settings.options, pruned=False)
    found = answers.evaluate(X.reshape(-1, len(AETIOLOGIES))).value.reshape(lines.shape[:2])
    highest = np.maximum.accumulate(found, axis=1)
    return float((1.0 - found / highest).max())
