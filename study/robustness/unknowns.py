"""Unknowns with ranges and reasons, and those that the paper leaves open of its control point."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fuzzy.liver.bases import KNOWLEDGE
from fuzzy.liver.readings import READINGS
from fuzzy.liver.settings import CHOICES, LiverSettings
from fuzzy.liver.system import liver_system
from fuzzy.liver.table1 import AETIOLOGIES
from fuzzy.systems.options import CHOICES as OPTIONS

Floats = NDArray[np.float64]

STAGES = "severity"
"""The knowledge base that a reading of Table I, a placement and a consequent shape."""


@dataclass(frozen=True)
class Range:
    """A number between two bounds in SI units, each share of it (or of its logarithm) as likely.

    Unknowns of one `group` change together in sensitivity indices; without, each is its own.
    """

    name: str
    low: float
    high: float
    unit: str
    why: str
    log: bool = True
    group: str = ""

    def at(self, u: Floats) -> list[float]:
        """Values at shares (n,) of the range."""
        if self.log:
            return [float(x) for x in self.low * (self.high / self.low) ** u]
        return [float(x) for x in self.low + (self.high - self.low) * u]

    @property
    def extent(self) -> str:
        """The range as text, for the table of the unknowns."""
        return f"{self.low:g} to {self.high:g} {self.unit}".rstrip()


@dataclass(frozen=True)
class OneOf:
    """One of some values, each as likely; `group` as of a Range."""

    name: str
    values: tuple[Any, ...]
    why: str
    group: str = ""

    def at(self, u: Floats) -> list[Any]:
        """Values at shares (n,) of the list."""
        count = len(self.values)
        return [self.values[min(int(x * count), count - 1)] for x in u]

    @property
    def extent(self) -> str:
        """The range as text, for the table of the unknowns."""
        if len(self.values) > 6:
            return f"{len(self.values)} alternatives"
        return ", ".join(
            "+".join(map(str, v)) if isinstance(v, tuple) else str(v) for v in self.values
        )


Unknown = Range | OneOf


def groups(unknowns: Sequence[Unknown]) -> dict[str, list[int]]:
    """Places of the unknowns of each group, in the order of their first ones."""
    found: dict[str, list[int]] = {}
    for place, one in enumerate(unknowns):
        found.setdefault(one.group or one.name, []).append(place)
    return found


class Placed(NamedTuple):
    """A reading of Table I by name, and where its sets are placed on the data."""

    reading: str
    placement: str


class Sampled(NamedTuple):
    """How the output's universe is sampled, and by how many points."""

    sampling: str
    samples: int


class Draw(NamedTuple):
    """A value of every unknown, in SI units; see UNKNOWNS."""

    rest_length: float
    mass: float
    strain: float
    history: str
    span: float
    start: float
    conversion: float
    stiffness: float
    disagreement: float
    aetiologies: tuple[str, ...]
    knowledge: str
    placed: Placed
    consequent: str
    absent: str
    footprint: str
    footprint_factor: float
    sampled: Sampled
    sugeno_aggregation: str
    reducer: str


def _placed() -> Iterator[Placed]:
    """Every reading of Table I with every placement that the data have for it.

    One without rules on a single disease is left out: it has no answer for most patients.
    """
    for reading in READINGS:
        for placement in CHOICES["placement"]:
            try:
                settings = LiverSettings(
                    knowledge=STAGES, reading=reading, placement=placement, absent="silent"
                )
                for name in AETIOLOGIES:
                    liver_system(settings, (name,))
            except ValueError:
                continue
            yield Placed(reading, placement)


def _patients() -> tuple[tuple[str, ...], ...]:
    """Every set of one or more aetiologies."""
    sizes = range(1, len(AETIOLOGIES) + 1)
    return tuple(names for size in sizes for names in combinations(AETIOLOGIES, size))


UNKNOWNS: tuple[Unknown, ...] = (
    Range(
        "rest_length",
        3e-3,
        10e-3,
        "m",
        "of the spring, where Table II holds: the benchmark's modulus is 2.5 K_1 / h_0^2",
    ),
    Range(
        "mass",
        1e-4,
        0.1,
        "kg",
        "from that of a lattice's node to that for which eq. (2) meets gamma_0",
    ),
    Range(
        "strain",
        0.01,
        0.5,
        "",
        "largest force over K_1: the strain of a linear spring of the benchmark",
    ),
    OneOf("history", ("step", "ramp-hold-release", "sinusoid"), "of the force"),
    Range("span", 0.3, 10.0, "s", "of time that is compared; load histories are scaled to it"),
    Range("start", -0.1, 0.1, "", "strain from which the point is let go", log=False),
    Range(
        "conversion",
        0.4,
        1.0,
        "",
        "k / (E L_0), from a spring of the lattice to a column of tissue",
        log=False,
    ),
    Range(
        "stiffness",
        3e3,
        40e3,
        "Pa",
        "that the readings scatter about, from a normal liver to cirrhosis",
    ),
    Range(
        "disagreement", 1.0, 1.5, "", "of readings: every other one is so much larger, or smaller"
    ),
    OneOf("aetiologies", _patients(), "that have a reading"),
    OneOf("knowledge", tuple(KNOWLEDGE), "base: sets and rules, as the study has them"),
    OneOf(
        "placed",
        tuple(_placed()),
        "reading of Table I and placement of the sets on the data, of the base severity",
    ),
    OneOf(
        "consequent",
        tuple(CHOICES["consequent"]),
        "of a combination of diseases, of the base severity",
    ),
    OneOf("absent", ("normal", "silent"), "aetiology without a reading, of the base severity"),
    OneOf("footprint", tuple(CHOICES["footprint"]), "of uncertainty: what is uncertain of a set"),
    OneOf("footprint_factor", (0.25, 0.5, 1.0, 2.0), "on the published spread"),
    OneOf(
        "sampled",
        (Sampled("matlab", 101), Sampled("octave", 101), Sampled("matlab", 1001)),
        "quadrature of the output",
    ),
    OneOf(
        "sugeno_aggregation",
        tuple(OPTIONS["sugeno_aggregation"]),
        "of Sugeno's rules with one consequent",
    ),
    OneOf("reducer", tuple(OPTIONS["reducer"]), "of interval type-2 sets"),
)
"""The damping ratio of eq. (2) is none: the paper prints 0.9."""


def draws(shares: Floats) -> list[Draw]:
    """Draws at shares (n, unknowns) of their ranges, in the order of UNKNOWNS."""
    columns: Sequence[list[Any]] = [unknown.at(shares[:, i]) for i, unknown in enumerate(UNKNOWNS)]
    return [Draw(*values) for values in zip(*columns, strict=True)]
