"""Settings of the stiffness estimate: every open reading of the paper that is a parameter."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from fuzzy.liver.knowledge import PLACEMENTS, input_records
from fuzzy.liver.readings import reading_named
from fuzzy.liver.rules import CONSEQUENTS
from fuzzy.liver.table1 import AETIOLOGIES
from fuzzy.systems.options import InferenceOptions, require_choices
from fuzzy.systems.sets import Footprint


class FootprintKind(NamedTuple):
    """What is uncertain of a set: its footprint from a relative half-width and the centre."""

    footprint: Callable[[float, float], Footprint]
    words: str


class Absent(NamedTuple):
    """What an aetiology without a reading does.

    `silences`: the rules that name it are left out. `note` is put beside an answer, `words` into a
    report; {normal:g} in them is the normal liver's stiffness [kPa].
    """

    silences: bool
    note: str
    words: str


FOOTPRINTS: dict[str, FootprintKind] = {
    "uncertain-mean": FootprintKind(
        lambda relative, centre: Footprint(mean=relative * centre),
        "every centre, input and output, is uncertain by",
    ),
    "uncertain-spread": FootprintKind(
        lambda relative, _: Footprint(spread=relative),
        "the width of every set's flanks, input and output, is uncertain by the share that the "
        "sources give for centres (a transfer of this study),",
    ),
    "scaled": FootprintKind(
        lambda relative, _: Footprint(scale=1.0 - relative),
        "every lower membership, input and output, is lower than the upper one by the share that "
        "the sources give for centres (a transfer of this study),",
    ),
}

ABSENT: dict[str, Absent] = {
    "normal": Absent(
        False,
        "the normal liver's {normal:g} kPa taken",
        "is given the normal liver's {normal:g} kPa (fung2013)",
    ),
    "silent": Absent(
        True,
        "the rules that name it left out",
        "takes every rule that names it out of the rule base",
    ),
}

CHOICES: dict[str, Mapping[str, object]] = {
    "consequent": CONSEQUENTS,
    "placement": PLACEMENTS,
    "footprint": FOOTPRINTS,
    "absent": ABSENT,
}
"""Settings that are chosen by name, with the tables that implement them."""

LARGEST_FACTOR = 3.0
"""With it the widest relative footprint is 0.76; at 1 the lower membership would vanish."""


@dataclass(frozen=True)
class LiverSettings:
    """How the rule base is read, placed on the data and evaluated.

    `reading` is a name of READINGS. `placement` puts the centres of HCV's and HBV's sets on the
    mean of a stage or on the cut-off that diagnoses it. `footprint` is what is uncertain about
    every set, by `footprint_factor` times the published spread; 0 turns type-2 into type-1.
    `absent`: an aetiology without a reading has a normal liver's, or (`silent`) the rules that
    name it are left out.
    """

    reading: str = "R1"
    consequent: str = "max"
    placement: str = "stage-mean"
    footprint: str = "uncertain-mean"
    footprint_factor: float = 1.0
    absent: str = "normal"
    options: InferenceOptions = field(default_factory=InferenceOptions)

    def __post_init__(self) -> None:
        require_choices(self, CHOICES)
        if not 0 <= self.footprint_factor <= LARGEST_FACTOR:
            raise ValueError(
                f"footprint_factor = {self.footprint_factor!r}: give a number from 0 to "
                f"{LARGEST_FACTOR:g}; 1 is the published spread"
            )
        counts = reading_named(self.reading).counts
        for aetiology, count in zip(AETIOLOGIES, counts, strict=True):
            try:
                input_records(aetiology, count, self.placement)
            except ValueError as error:
                raise ValueError(f"reading = {self.reading!r}: {error}") from error
