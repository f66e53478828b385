"""How far an estimate falls where one of several readings rises, which it never should.

From drawn patients, one reading rises over the whole scale in fine steps while the others stay. Two
kinds of patients are drawn: readings anywhere on the scale, which no liver has, and readings of one
liver with the noise of exams and operators.
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
"""Of the scale, steps of 3 %."""
PATIENTS = 60
LIVERS = (3.0, 50.0)
"""From which true stiffness [kPa] livers are drawn, even in ln kPa."""
ABOUT = 0.35
"""Of ln kPa, half the way over which a reading of one liver rises: three SDs of its noise."""


class Fall(NamedTuple):
    """The largest fall of an estimate, relative to the highest before it, and where it is.

    `anywhere` is for readings drawn over the whole scale, `of_one_liver` for readings that one
    liver could have.
    """

    readings: int
    anywhere: float
    of_one_liver: float


def falls(kind: str, settings: LiverSettings) -> Iterator[Fall]:
    """The largest fall of one kind of system by the number of readings, whichever they are."""
    for number in range(1, len(AETIOLOGIES) + 1):
        found = [largest_fall(kind, settings, some) for some in combinations(AETIOLOGIES, number)]
        anywhere, of_one_liver = (max(part) for part in list(zip(*found, strict=True))[1:])
        yield Fall(number, anywhere, of_one_liver)


def largest_fall(
    kind: str, settings: LiverSettings, present: Sequence[str], patients: int = PATIENTS
) -> Fall:
    """The largest fall of one kind of system with readings of the aetiologies `present`."""
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
    """Readings (P, n) with one of them through values (P,)."""
    found = np.tile(row, (len(values), 1))
    found[:, column] = values
    return found


def _fall(kind: str, settings: LiverSettings, present: Sequence[str], lines: Array) -> float:
    """The largest fall along any of readings (patients, P, n) [kPa]."""
    X = np.full((*lines.shape[:2], len(AETIOLOGIES)), parameters()["normal_liver"])
    X[..., [AETIOLOGIES.index(name) for name in present]] = lines
    system = liver_system(settings, tuple(present))
    answers = compiled(system, kind, settings.options, pruned=False)
    found = answers.evaluate(X.reshape(-1, len(AETIOLOGIES))).value.reshape(lines.shape[:2])
    highest = np.maximum.accumulate(found, axis=1)
    return float((1.0 - found / highest).max())
