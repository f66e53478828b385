"""What a trade-off study answers: the accuracy to be had at a rate, and what more would cost."""

from __future__ import annotations

from collections.abc import Sequence

from reports.digits import DASH, Table, significant
from reports.tradeoff import (
    MeasuredConfiguration,
    best,
    is_better,
    next_better,
    rate_name,
    rates_of,
    share,
    timed,
)

TOLD = ("60hz", "1khz")
"""Rates of the trade-off that a sentence is written on."""


def sentences(found: Sequence[MeasuredConfiguration]) -> list[str]:
    """Sentences on what models that follow any load reach at the rates of the table."""
    free = [one for one in timed(found) if one.any_load]
    return [_sentence(found, free, rate) for rate in TOLD if rate in rates_of(free)]


def _sentence(
    found: Sequence[MeasuredConfiguration], free: list[MeasuredConfiguration], rate: str
) -> str:
    chosen = best(free, rate)
    if chosen is None:
        nearest = min(free, key=lambda one: share(one, rate))
        told = f"no configuration for any load is real time; the fastest is {_told(nearest, rate)}"
    else:
        told = (
            "the most accurate real-time configuration for any load, within the error of the "
            f"reference, is {_told(chosen, rate)}; {_next(free, rate, chosen)}"
        )
    return f"At {rate_name(rate)} {told}{_known_load(found, rate, chosen)}."


def _told(one: MeasuredConfiguration, rate: str) -> str:
    """A configuration, its error, and its share of a period."""
    taken = share(one, rate)
    part = f"{significant(taken, 2)} periods"
    if taken < 1.0:
        part = f"{significant(100.0 * taken, 2)} % of the period"
    return f"{one.name} (error {one.stated_error}, {part})"


def _next(free: list[MeasuredConfiguration], rate: str, chosen: MeasuredConfiguration) -> str:
    better = next_better(free, rate, chosen)
    if better is None:
        return "none is more accurate by more than the error of the reference"
    return f"the next more accurate is {_told(better, rate)}"


def _known_load(
    found: Sequence[MeasuredConfiguration], rate: str, chosen: MeasuredConfiguration | None
) -> str:
    """What a load whose place is known beforehand allows beyond that."""
    bound = best([one for one in found if not one.any_load], rate)
    if bound is None or (chosen and not is_better(bound, chosen)):
        return ""
    setup = significant(bound.timing.setup, 2)
    return (
        f"; if the place of the load is known beforehand, it is {_told(bound, rate)}, with "
        f"{setup} s of set-up"
    )


def answers(found: Sequence[MeasuredConfiguration]) -> Table:
    """Answers by rate and load's place: the most accurate in time, error, share, set-up [s]."""
    measured = timed(found)
    groups = (("any", True), ("known beforehand", False))
    return [
        [rate_name(rate), load, *_answer([o for o in measured if o.any_load == any_load], rate)]
        for load, any_load in groups
        for rate in rates_of(measured)
    ]


def _answer(group: list[MeasuredConfiguration], rate: str) -> list[str]:
    chosen = best(group, rate)
    if chosen is None:
        return ["none", DASH, DASH, DASH]
    return [
        chosen.name,
        chosen.stated_error,
        f"{significant(100.0 * share(chosen, rate), 2)} %",
        significant(chosen.timing.setup, 2),
    ]
