"""Settings of the stiffness estimate: every open reading of the paper that is a parameter."""

from dataclasses import dataclass, field
from typing import Literal, get_args

from fuzzy.liver.knowledge import Placement, input_records
from fuzzy.liver.readings import reading_named
from fuzzy.liver.rules import Consequent
from fuzzy.liver.table1 import AETIOLOGIES
from fuzzy.systems.inference import InferenceOptions

FootprintKind = Literal["uncertain-mean", "uncertain-spread", "scaled"]
Absent = Literal["normal", "silent"]

CHOICES = {
    "consequent": get_args(Consequent),
    "placement": get_args(Placement),
    "footprint": get_args(FootprintKind),
    "absent": get_args(Absent),
}
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
    consequent: Consequent = "max"
    placement: Placement = "stage-mean"
    footprint: FootprintKind = "uncertain-mean"
    footprint_factor: float = 1.0
    absent: Absent = "normal"
    options: InferenceOptions = field(default_factory=InferenceOptions)

    def __post_init__(self) -> None:
        for key, allowed in CHOICES.items():
            if getattr(self, key) not in allowed:
                raise ValueError(f"{key} = {getattr(self, key)!r}: use one of {', '.join(allowed)}")
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
