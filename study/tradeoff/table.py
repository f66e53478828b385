"""The table of the study, a row per configuration.

contender, configuration  which, and its settings
status                    resolved; not resolved (its error is below the reference's own); diverged;
                          unstable (steps beyond the critical one, though damping or luck kept it
                          bounded); inverted (cells turned inside out); failed; crashed. Only the
                          first has errors and a place on a front
message                   what went wrong, and where
any_load                  whether it follows a load whose place was not known beforehand
field_error               relative L2 error of the displacement over the organ at the peak
field_error_bar           own error of it of what is compared with
tool_error, worst_error   relative L2 error of the displacement curve of the control point at the
                          tool and, among those that are resolved, the largest of a control point
force_error               of scenes with tools that are moved, which are judged by it and have the
                          status of it: relative L2 error of the force over time, the largest of a
                          tool; empty without such, as are the next three
force_error_bar           own error of it of what is compared with
peak_force_error          relative error of the largest force along the axis
discretisation_error      relative L2 difference of the force over time from the finest lattice of
                          the same springs, if it exceeds the finest's own error
unknowns                  components of displacement, or coordinates of a superposition
step_s                    the shortest step that the run took, for which all costs are meant
setup_s                   assembly, factors, vectors: what is done once, without the organ's mesh
step_us, bare_step_us     wall of a step as a run takes it, with the limit followed, and without
wall_per_s, _q1, _q3      wall per simulated second: median of the turns and quartiles
substeps_R, frame_ms_R    steps in a frame at the rate R (25hz, 60hz, 1khz), and its median wall
slow_frame_ms_R           its 95th percentile, empty where too few steps were timed
real_time_R               whether that is within the period
pareto                    no other configuration is both more accurate and cheaper by wall_per_s
pareto_any_load           the same among those with any_load
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from study.tradeoff.contenders import Configuration
from study.tradeoff.errors import Errors
from study.tradeoff.rates import RATES, frame
from study.tradeoff.timing import Timing

Cell = str | float | int | bool | None

SAME = 0.01
"""Relative difference below which two errors count as equal."""

COLUMNS = (
    *("contender", "configuration", "status", "message", "any_load"),
    *("field_error", "field_error_bar", "tool_error", "worst_error"),
    *("force_error", "force_error_bar", "peak_force_error", "discretisation_error"),
    *("unknowns", "step_s", "setup_s", "step_us", "bare_step_us"),
    *("wall_per_s", "wall_per_s_q1", "wall_per_s_q3"),
    *(
        f"{column}_{rate}"
        for rate in RATES
        for column in ("substeps", "frame_ms", "slow_frame_ms", "real_time")
    ),
    *("pareto", "pareto_any_load"),
)


@dataclass(frozen=True)
class Cost:
    """Cost of a configuration: one-time setup [s], and time per step.

    `memory` [byte]: what it holds while it steps, where that was measured.
    """

    unknowns: int
    setup: float
    step: float
    timing: Timing
    memory: int | None = None

    @property
    def per_second(self) -> tuple[float, float, float]:
        """Wall time per simulated second: lower quartile, median and upper quartile."""
        low, middle, high = self.timing.step
        return low / self.step, middle / self.step, high / self.step


@dataclass(frozen=True, eq=False)  # fronts compare by identity
class Entry:
    """A configuration with its errors and, where it was timed, its cost.

    `bar`: the reference's own error of the field, and `force_bar` of the force on moved tools.
    """

    configuration: Configuration
    errors: Errors
    bar: float
    cost: Cost | None
    force_bar: float | None = None

    @property
    def place(self) -> tuple[float, float] | None:
        """Error that is the criterion, and median wall per simulated second; None if unknown."""
        if self.cost is None or not self.errors.judged:
            return None
        return self.errors.judged, self.cost.per_second[1]


def is_dominated(place: tuple[float, float], places: Sequence[tuple[float, float]]) -> bool:
    """Whether one of the places, each an error and a cost, dominates another.

    It does if it is cheaper and as accurate, or more accurate and as cheap. Errors that differ by
    less than SAME of their value count as equal: those of one lattice at two steps do.
    """
    error, wall = place
    return any(
        (w <= wall and e < error) or (w < wall and e <= (1.0 + SAME) * error) for e, w in places
    )


def front(entries: Sequence[Entry]) -> list[Entry]:
    """The Pareto front: entries that no other dominates, among those with error and cost."""
    places = [one.place for one in entries if one.place is not None]
    return [one for one in entries if one.place is not None and not is_dominated(one.place, places)]


def fronts(entries: Sequence[Entry]) -> tuple[list[Entry], list[Entry]]:
    """The front of all entries, and that of the entries that can follow any load."""
    return front(entries), front([one for one in entries if one.configuration.any_load])


def write(entries: Sequence[Entry], path: Path) -> None:
    """Write a row for each entry as CSV; what does not apply is empty."""
    whole, any_load = fronts(entries)
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        table.writeheader()
        for one in entries:
            marks = {"pareto": one in whole, "pareto_any_load": one in any_load}
            table.writerow({k: _printed(v) for k, v in (dict(_cells(one)) | marks).items()})


def _cells(one: Entry) -> Iterator[tuple[str, Cell]]:
    """Columns and values of a row, without its place on the fronts."""
    configuration, errors = one.configuration, one.errors
    yield "contender", configuration.contender
    yield "configuration", configuration.label
    yield "status", errors.status
    yield "message", errors.message
    yield "any_load", configuration.any_load
    yield "field_error", errors.field
    yield "field_error_bar", one.bar
    yield "tool_error", errors.tool
    yield "worst_error", errors.worst
    yield "force_error", errors.force
    yield "force_error_bar", one.force_bar
    yield "peak_force_error", errors.peak_force
    yield "discretisation_error", errors.discretisation
    if one.cost is not None:
        yield from _costs(one.cost)


def _costs(cost: Cost) -> Iterator[tuple[str, Cell]]:
    bare, (low, middle, high) = cost.timing.bare, cost.per_second
    yield "unknowns", cost.unknowns
    yield "step_s", cost.step
    yield "setup_s", cost.setup
    yield "step_us", 1e6 * cost.timing.step[1]
    yield "bare_step_us", None if bare is None else 1e6 * float(np.median(bare))
    yield "wall_per_s", middle
    yield "wall_per_s_q1", low
    yield "wall_per_s_q3", high
    for name, rate in RATES.items():
        found = frame(rate, cost.step, cost.timing.walls)
        yield f"substeps_{name}", found.substeps
        yield f"frame_ms_{name}", 1e3 * found.wall
        yield f"slow_frame_ms_{name}", None if found.slow is None else 1e3 * found.slow
        yield f"real_time_{name}", found.in_time


def _printed(value: Cell) -> Cell:
    return f"{value:.4g}" if isinstance(value, float) else value


def lines(entries: Sequence[Entry]) -> list[str]:
    """The fronts for a terminal, the cheapest first, and the outcome of the others."""
    whole, any_load = fronts(entries)
    shown = [(one.place, one, one.cost) for one in entries if one in whole or one in any_load]
    found = [f"{'wall per s':>10}  {'error':>6}  60 Hz  1 kHz  setup"]
    found += [
        _line(place, one, cost)
        for place, one, cost in sorted(shown, key=lambda row: row[0][1] if row[0] else 0.0)
        if place is not None and cost is not None
    ]
    states = [one.errors.status for one in entries]
    counts = ", ".join(f"{states.count(state)} {state}" for state in dict.fromkeys(states))
    return [*found, f"{len(entries)} configurations: {counts}"]


def _line(place: tuple[float, float], one: Entry, cost: Cost) -> str:
    (error, wall), configuration = place, one.configuration
    in_time = (
        "yes" if frame(RATES[rate], cost.step, cost.timing.walls).in_time else "no"
        for rate in ("60hz", "1khz")
    )
    ready = "  ".join(f"{text:5}" for text in in_time)
    bound = "" if configuration.any_load else " (this load only)"
    return (
        f"{wall:>10.3g}  {100 * error:>4.1f} %  {ready}  {cost.setup:.2f} s  "
        f"{configuration.contender} {configuration.label}{bound}"
    )
