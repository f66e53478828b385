"""Settings of the stiffness estimate: every open reading of the paper that is a parameter."""

from dataclasses import dataclass, field
from typing import get_args

from fuzzy.knowledge import parameters
from fuzzy.rules import Consequent, Duplicates, OddCell
from fuzzy.system import Merge

CHOICES = {
    "sugeno_aggregation": get_args(Merge),
    "odd_cell": get_args(OddCell),
    "duplicates": get_args(Duplicates),
    "consequent": get_args(Consequent),
}


@dataclass(frozen=True)
class Settings:
    """How the rule base is read and evaluated.

    `samples` points carry the output universe (101 is MATLAB's default). `footprint` is the
    half-width of every set's uncertain centre over that centre; 0 turns type-2 into type-1.
    """

    samples: int = 101
    footprint: float = field(default_factory=lambda: parameters()["footprint"])
    sugeno_aggregation: Merge = "sum"
    odd_cell: OddCell = "missing-triple"
    duplicates: Duplicates = "keep"
    consequent: Consequent = "max"

    def __post_init__(self) -> None:
        if not isinstance(self.samples, int) or self.samples < 11:
            raise ValueError(f"samples = {self.samples!r}: give a whole number of at least 11")
        if not 0 <= self.footprint <= 0.5:
            raise ValueError(f"footprint = {self.footprint!r}: give a fraction from 0 to 0.5")
        for key, allowed in CHOICES.items():
            if getattr(self, key) not in allowed:
                raise ValueError(f"{key} = {getattr(self, key)!r}: use one of {', '.join(allowed)}")
