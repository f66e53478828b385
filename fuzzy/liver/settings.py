"""Settings of the stiffness estimate: every open reading of the paper that is a parameter."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from typing import NamedTuple

from fuzzy.liver.bases import KNOWLEDGE, STAGES_ONLY, KnowledgeBase
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

AS_KNOWLEDGE = "auto"
NO_READING = "no aetiology has a reading: give one, or set absent to normal"

ABSENT: dict[str, Absent | None] = {
    AS_KNOWLEDGE: None,
    "normal": Absent(
        False,
        "the normal liver's {normal:g} kPa taken",
        "is given the normal liver's {normal:g} kPa (fung2013)",
    ),
    "silent": Absent(
        True,
        "rules on a disease without one are left out",
        "takes every rule that names it out of the rule base",
    ),
}
"""What a missing reading does; `auto` is what the knowledge base has for it."""

CHOICES: dict[str, Mapping[str, object]] = {
    "knowledge": KNOWLEDGE,
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

    `knowledge` is a name of KNOWLEDGE. Of a base of stages, `reading` is a name of READINGS,
    `consequent` says what a combination concludes, and `placement` puts the centres of HCV's and
    HBV's sets on the mean of a stage or on the cut-off that diagnoses it. `footprint` is what is
    uncertain about every set, by `footprint_factor` times the published spread; 0 turns type-2
    into type-1. `absent`: an aetiology without a reading has a normal liver's, or (`silent`) the
    rules that name it are left out; `auto` is as the knowledge base has it.
    """

    knowledge: str = "freed"
    reading: str = "R1"
    consequent: str = "max"
    placement: str = "stage-mean"
    footprint: str = "uncertain-mean"
    footprint_factor: float = 1.0
    absent: str = AS_KNOWLEDGE
    options: InferenceOptions = field(default_factory=InferenceOptions)

    def __post_init__(self) -> None:
        require_choices(self, CHOICES)
        if not 0 <= self.footprint_factor <= LARGEST_FACTOR:
            raise ValueError(
                f"footprint_factor = {self.footprint_factor!r}: give a number from 0 to "
                f"{LARGEST_FACTOR:g}; 1 is the published spread"
            )
        counts = reading_named(self.reading).counts
        if self.base.follows:
            _require_untouched(self)
            return
        for aetiology, count in zip(AETIOLOGIES, counts, strict=True):
            try:
                input_records(aetiology, count, self.placement)
            except ValueError as error:
                raise ValueError(f"reading = {self.reading!r}: {error}") from error

    @property
    def base(self) -> KnowledgeBase:
        """The knowledge base in force."""
        return KNOWLEDGE[self.knowledge]

    @property
    def absence(self) -> str:
        """The key of ABSENT in force: `normal` or `silent`."""
        return self.base.absent if self.absent == AS_KNOWLEDGE else self.absent

    @property
    def missing(self) -> Absent:
        """What an aetiology without a reading does."""
        found = ABSENT[self.absence]
        if found is None:
            raise ValueError(f"absent = {self.absence!r}: gives a missing reading no meaning")
        return found


def _require_untouched(settings: LiverSettings) -> None:
    """ValueError if a setting is given that the knowledge base has no use for."""
    usual = {one.name: one.default for one in fields(LiverSettings)}
    for key in STAGES_ONLY:
        if getattr(settings, key) != usual[key]:
            raise ValueError(
                f"{key} = {getattr(settings, key)!r}: shapes the knowledge base severity only; "
                f"leave it out with knowledge {settings.knowledge}"
            )
