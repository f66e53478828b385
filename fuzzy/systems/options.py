"""Options of inference: sampling, type reduction, and readings out of range."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from fuzzy.systems.quadrature import SAMPLINGS
from fuzzy.systems.system import MERGES
from fuzzy.systems.type_reduction import REDUCERS


class OutOfRange(NamedTuple):
    """Policy for a reading outside its universe; `done` is its wording in a note.

    `clamps`: the nearest end is used; `refuses`: it is an error; `middle`: where no rule fires, the
    output is the middle of its universe instead of an error.
    """

    done: str
    clamps: bool = False
    refuses: bool = False
    middle: bool = False


OUT_OF_RANGE: dict[str, OutOfRange] = {
    "clamp": OutOfRange("clamped to it", clamps=True),
    "raise": OutOfRange("correct it, or let out_of_range clamp it", refuses=True),
    "matlab": OutOfRange("taken as it is", middle=True),
}

FEWEST, MOST = 11, 1_000_000
"""Samples of an output's universe."""
CHOICES: dict[str, Mapping[str, object]] = {
    "sampling": SAMPLINGS,
    "sugeno_aggregation": MERGES,
    "reducer": REDUCERS,
    "out_of_range": OUT_OF_RANGE,
}
"""Options with named choices, and the tables that implement them."""


def require_choices(chosen: object, choices: Mapping[str, Mapping[str, object]]) -> None:
    """ValueError, with attribute and choices, if a chosen name is not in its table."""
    for key, allowed in choices.items():
        if getattr(chosen, key) not in allowed:
            raise ValueError(f"{key} = {getattr(chosen, key)!r}: use one of {', '.join(allowed)}")


@dataclass(frozen=True)
class InferenceOptions:
    """Options of the evaluation of any fuzzy system.

    `samples`: number of sample points of the output's universe (101 is MATLAB's default); `exact`
    sampling uses adaptive quadrature instead and has its own type reduction, so that `eiasc` has no
    effect. `out_of_range`: `clamp` uses the nearest end of the universe, with a note; `raise`
    refuses; `matlab` evaluates the reading as it is and, where no rule fires, returns the middle of
    the universe with a note. The first two refuse readings for which no rule fires.
    """

    sampling: str = "matlab"
    samples: int = 101
    sugeno_aggregation: str = "sum"
    reducer: str = "karnik-mendel"
    out_of_range: str = "clamp"

    def __post_init__(self) -> None:
        if not isinstance(self.samples, int) or not FEWEST <= self.samples <= MOST:
            raise ValueError(
                f"samples = {self.samples!r}: give a whole number from {FEWEST} to {MOST}"
            )
        require_choices(self, CHOICES)

    @property
    def points(self) -> str:
        """Description of the integration of the output curve."""
        return SAMPLINGS[self.sampling].words.format(samples=self.samples)
