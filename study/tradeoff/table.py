"""The table of the study, a row per configuration.

contender, configuration  which, and its settings
status                    resolved; not resolved (its error is below the reference's own); diverged;
                          unstable (steps beyond the critical one, though damping or luck kept it
                          bounded); inverted (cells turned inside out); failed; crashed. Only the
                          first has errors and a place on a front
message                   what went wrong, and where
any_load                  whether it follows a load whose place was not known beforehand
field_error               relative L2 error of the displacement over the organ at the peak
field_error_bar           the reference's own error of it
tool_error, worst_error   relative L2 error of the displacement curve of the control point at the
                          tool and, among those that are resolved, the largest of a control point
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
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from study.tradeoff.errors import Errors
from study.tradeoff.lineup import Configuration, contender
from study.tradeoff.rates import RATES, frame
from study.tradeoff.timing import Timing

Row = dict[str, Any]

SAME = 0.01
"""Of an error: by so little no configuration is more accurate than another."""

COLUMNS = (
    *("contender", "configuration", "status", "message", "any_load"),
    *("field_error", "field_error_bar", "tool_error", "worst_error"),
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
    """What a configuration costs: set up once [s], and by the step [s]."""

    unknowns: int
    setup: float
    step: float
    timing: Timing


def row(configuration: Configuration, errors: Errors, bar: float, cost: Cost | None) -> Row:
    """A row without its place on the fronts; without `cost` where nothing could be timed."""
    return {
        "contender": configuration.contender,
        "configuration": configuration.label,
        "status": errors.status,
        "message": errors.message,
        "any_load": contender(configuration.contender).ANY_LOAD,
        "field_error": errors.field,
        "field_error_bar": bar,
        "tool_error": errors.tool,
        "worst_error": errors.worst,
    } | (_costs(cost) if cost else {})


def _costs(cost: Cost) -> Row:
    low, middle, high = cost.timing.step
    bare = cost.timing.bare
    found = {
        "unknowns": cost.unknowns,
        "step_s": cost.step,
        "setup_s": cost.setup,
        "step_us": 1e6 * middle,
        "bare_step_us": None if bare is None else 1e6 * float(np.median(bare)),
        "wall_per_s": middle / cost.step,
        "wall_per_s_q1": low / cost.step,
        "wall_per_s_q3": high / cost.step,
    }
    for name, rate in RATES.items():
        one = frame(rate, cost.step, cost.timing.walls)
        found |= {
            f"substeps_{name}": one.substeps,
            f"frame_ms_{name}": 1e3 * one.wall,
            f"slow_frame_ms_{name}": None if one.slow is None else 1e3 * one.slow,
            f"real_time_{name}": one.in_time,
        }
    return found


def with_fronts(rows: Sequence[Row]) -> list[Row]:
    """The rows with every column, those on a front marked."""
    eligible = [row for row in rows if row.get("field_error") and row.get("wall_per_s")]
    whole = front(eligible)
    held = front([row for row in eligible if row["any_load"]])
    return [
        {column: row.get(column) for column in COLUMNS}
        | {"pareto": _is_in(row, whole), "pareto_any_load": _is_in(row, held)}
        for row in rows
    ]


def _is_in(row: Row, rows: Sequence[Row]) -> bool:
    return any(row is other for other in rows)


def front(rows: Sequence[Row]) -> list[Row]:
    """Rows for which no cheaper one is as accurate, and no more accurate one as cheap.

    Errors that differ by less than SAME of themselves are the same: those of one lattice at two
    steps do.
    """

    def beaten(a: Row) -> bool:
        return any(
            (b["wall_per_s"] <= a["wall_per_s"] and b["field_error"] < a["field_error"])
            or (
                b["wall_per_s"] < a["wall_per_s"]
                and b["field_error"] <= (1.0 + SAME) * a["field_error"]
            )
            for b in rows
        )

    return [row for row in rows if not beaten(row)]


def write(rows: Sequence[Row], path: Path) -> None:
    """Write the rows as CSV; what does not apply is empty."""
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        table.writeheader()
        table.writerows({key: _cell(value) for key, value in row.items()} for row in rows)


def _cell(value: Any) -> Any:
    return f"{value:.4g}" if isinstance(value, float) else value


def lines(rows: Sequence[Row]) -> list[str]:
    """The front for a terminal, the cheapest first, and how the others ended."""
    shown = [row for row in rows if row["pareto"] or row["pareto_any_load"]]
    shown.sort(key=lambda row: float(row["wall_per_s"]))
    found = [f"{'wall per s':>10}  {'error':>6}  60 Hz  1 kHz  setup"]
    found += [
        f"{row['wall_per_s']:>10.3g}  {100 * row['field_error']:>4.1f} %  "
        f"{_yes(row['real_time_60hz']):5}  {_yes(row['real_time_1khz']):5}  "
        f"{row['setup_s']:.2f} s  {row['contender']} {row['configuration']}"
        + ("" if row["any_load"] else " (this load only)")
        for row in shown
    ]
    states = [row["status"] for row in rows]
    counts = ", ".join(f"{states.count(state)} {state}" for state in dict.fromkeys(states))
    return [*found, f"{len(rows)} configurations: {counts}"]


def _yes(value: bool) -> str:
    return "yes" if value else "no"
