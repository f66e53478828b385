"""Options of inference: how answers are computed, and what becomes of odd readings."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from fuzzy.systems.quadrature import SAMPLINGS
from fuzzy.systems.system import MERGES
from fuzzy.systems.type_reduction import REDUCERS


class OutOfRange(NamedTuple):
    """What is done with a reading outside its universe; `done` says it in a note.

    `clamps` takes the nearest end, `refuses` is an error. `middle`: where no rule fires the answer
    is the middle of the output's universe, otherwise an error.
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
"""Options that are chosen by name, with the tables that implement them."""


def require_choices(chosen: object, choices: Mapping[str, Mapping[str, object]]) -> None:
    """ValueError, naming the attribute and its choices, if one of `chosen` is not in its table."""
    for key, allowed in choices.items():
        if getattr(chosen, key) not in allowed:
            raise ValueError(f"{key} = {getattr(chosen, key)!r}: use one of {', '.join(allowed)}")


@dataclass(frozen=True)
class InferenceOptions:
    """How a fuzzy system is evaluated, whatever its subject.

    `samples` points carry the output's universe (101 is MATLAB's default); `exact` sampling takes
    none and finds the ends of type-2 intervals by itself, so that `eiasc` changes nothing there.
    `out_of_range`: `clamp` takes the nearest end of the universe and says so, `raise` refuses,
    `matlab` evaluates as it is, and where nothing fires answers with the middle of the universe,
    and says so; the first two refuse readings for which no rule fires.
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
        """Words for how the output curve is integrated."""
        return SAMPLINGS[self.sampling].words.format(samples=self.samples)
