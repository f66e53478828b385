"""Rows of the tables of the robustness study."""

from __future__ import annotations

from typing import NamedTuple


class Nearest(NamedTuple):
    """Share of draws in which a system has the highest score by a measure.

    `low`, `high`: its 95 % interval by Wilson's formula. `tied`: share of all draws in which the
    two highest scores differ by less than TIE, which count for no system.
    """

    curve: str
    measure: str
    system: str
    share: float
    low: float
    high: float
    tied: float
    draws: int


class Difference(NamedTuple):
    """Distribution of the score of one system minus that of another over the draws.

    Percentiles; then the share of draws in which the difference does not exceed the paper's own,
    and the share in which it has the paper's sign.
    """

    curve: str
    measure: str
    system: str
    other: str
    p05: float
    p25: float
    p50: float
    p75: float
    p95: float
    paper: float
    within_paper: float
    paper_sign: float


class TableThree(NamedTuple):
    """How closely draws reproduce all three scores of Table III at once, by a measure.

    `nearest`: largest deviation of the best draw, whose number is `draw`; then counts of draws
    whose largest deviation is at most what the name says, and how many of the last have the paper's
    order.
    """

    curve: str
    measure: str
    nearest: float
    draw: int
    within_rounding: int
    within_0005: int
    within_005: int
    in_order_of_those: int
    draws: int


class Index(NamedTuple):
    """First-order and total Sobol index of an output for an unknown, with 95 % intervals."""

    curve: str
    measure: str
    output: str
    unknown: str
    first: float
    first_low: float
    first_high: float
    total: float
    total_low: float
    total_high: float


class Drawn(NamedTuple):
    """A value of an unknown in the draw that comes nearest to Table III by a measure."""

    curve: str
    measure: str
    draw: int
    unknown: str
    value: str


class AtSpacing(NamedTuple):
    """Score of a system at a reference spacing [m], with both moduli [Pa] at small strain."""

    spacing_m: float
    benchmark_pa: float
    system: str
    estimate_pa: float
    curve: str
    measure: str
    score: float


class Finer(NamedTuple):
    """Changes on finer lattices, by a measure, over draws repeated on them.

    `changed`: share of the draws in which another contender is nearest, without ties on either
    side, with its 95 % interval; `lead` and `moved`: medians of the lead of the nearest, and of the
    largest change of any contender's score.
    """

    curve: str
    measure: str
    times: float
    draws: int
    changed: float
    low: float
    high: float
    lead: float
    moved: float
