"""What accuracy costs: the configurations of a trade-off study, and what they allow at a rate."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.resources.abc import Traversable
from typing import Any

from reports import beforehand
from reports.beforehand import Line
from reports.configuration_names import name_of
from reports.digits import Table, percent, with_error

NAME = "tradeoff"
MILLI = 1e-3
RATE = re.compile(r"real_time_((\d+)(k?)hz)")
MEASURED = ("resolved", "not resolved")


@dataclass(frozen=True)
class Frame:
    """A frame at a rate: its wall over the period, of a slow one where enough were timed.

    `in_time`: as the table has it.
    """

    share: float
    in_time: bool


@dataclass(frozen=True)
class Cost:
    """Quartiles of the wall per simulated second, set-up [s], and a frame of each rate."""

    quartiles: tuple[float, float, float]
    setup: float
    frames: dict[str, Frame]


@dataclass(frozen=True)
class Configuration:
    """A line of the table. `error`: of the field, None where there is none or it is not resolved.

    `bar`: the reference's own error; `cost`: None for one that was not timed.
    """

    contender: str
    settings: str
    status: str
    message: str
    any_load: bool
    error: float | None
    bar: float
    cost: Cost | None

    @property
    def name(self) -> str:
        """Contender and settings in words."""
        return name_of(self.contender, self.settings)

    @property
    def timing(self) -> Cost:
        """Its cost. ValueError for one that was not timed."""
        if self.cost is None:
            raise ValueError(f"{self.name}: {self.status} and so not timed; ask of `timed` ones")
        return self.cost

    @property
    def stated_error(self) -> str:
        """Its error as printed."""
        if self.error is None:
            return f"not resolved (< {percent(self.bar)})"
        return f"{with_error(100.0 * self.error, 100.0 * self.bar)} %"


def configurations(folder: Traversable | None = None) -> list[Configuration]:
    """Those of a folder's table, or of the one that comes with the program; none if missing."""
    return [_configuration(line) for line in beforehand.read(NAME, folder)]


def _configuration(line: Line) -> Configuration:
    return Configuration(
        contender=line["contender"],
        settings=line["configuration"],
        status=line["status"],
        message=line["message"],
        any_load=line["any_load"] == "True",
        error=float(line["field_error"]) if line["field_error"] else None,
        bar=float(line["field_error_bar"]),
        cost=_cost(line) if line["wall_per_s"] else None,
    )


def _cost(line: Line) -> Cost:
    walls = [float(line[f"wall_per_s{end}"]) for end in ("_q1", "", "_q3")]
    frames = {rate: _frame(line, rate, hertz) for rate, hertz in rates(line).items()}
    return Cost((walls[0], walls[1], walls[2]), float(line["setup_s"]), frames)


def _frame(line: Line, rate: str, hertz: float) -> Frame:
    wall = line[f"slow_frame_ms_{rate}"] or line[f"frame_ms_{rate}"]
    return Frame(MILLI * float(wall) * hertz, line[f"real_time_{rate}"] == "True")


def rates(columns: Iterable[str]) -> dict[str, float]:
    """Rates [Hz] that columns of a table tell of, by their names there."""
    found = (RATE.fullmatch(column) for column in columns)
    return {m[1]: float(m[2]) * (1e3 if m[3] else 1.0) for m in found if m}


def rates_of(shown: Sequence[Configuration]) -> list[str]:
    """Names of the rates that those that were timed tell of."""
    return list(shown[0].timing.frames) if shown else []


def rate_name(rate: str) -> str:
    """A rate's name in a table as one writes it: "1khz" becomes "1 kHz"."""
    return rate.replace("khz", " kHz").replace("hz", " Hz")


def timed(found: Iterable[Configuration]) -> list[Configuration]:
    """Those with a cost and an error, or one below the reference's."""
    return [one for one in found if one.cost is not None and one.status in MEASURED]


def front(found: Iterable[Configuration]) -> list[Configuration]:
    """The resolved that no other beats in error or cost without losing in the other; by cost."""
    kept: list[Configuration] = []
    resolved = [one for one in timed(found) if one.error is not None]
    for one in sorted(resolved, key=lambda one: (_wall(one), one.error)):
        if not kept or _error(one) < _error(kept[-1]):
            kept.append(one)
    return kept


def _wall(one: Configuration) -> float:
    return one.timing.quartiles[1]


def _error(one: Configuration) -> float:
    return 0.0 if one.error is None else one.error


def share(one: Configuration, rate: str) -> float:
    """Of the period of a rate that a frame takes."""
    return one.timing.frames[rate].share


def is_in_time(one: Configuration, rate: str) -> bool:
    """Whether a frame is ready within the period of a rate."""
    return one.timing.frames[rate].in_time


def best(found: Iterable[Configuration], rate: str) -> Configuration | None:
    """The most accurate that is in time, or None.

    Errors that differ by less than the reference's own are equal: the cheapest of those.
    """
    fit = [one for one in timed(found) if is_in_time(one, rate)]
    least = min((_error(one) for one in fit), default=0.0)
    equal = [one for one in fit if _error(one) <= least + (one.bar if least else 0.0)]
    return min(equal, key=lambda one: share(one, rate), default=None)


def next_better(
    found: Iterable[Configuration], rate: str, chosen: Configuration
) -> Configuration | None:
    """The cheapest whose error is lower than the chosen one's by more than the reference's own."""
    better = [one for one in timed(found) if is_better(one, chosen)]
    return min(better, key=lambda one: share(one, rate), default=None)


def is_better(one: Configuration, other: Configuration) -> bool:
    """Whether its error is lower by more than the reference's own."""
    return _error(one) < _error(other) - other.bar


def left_out(found: Iterable[Configuration]) -> Table:
    """Configuration, what became of it and what was said, of those that have no place."""
    return [[one.name, one.status, one.message] for one in found if one.status not in MEASURED]


def record(folder: Traversable | None = None) -> dict[str, Any]:
    """What a table was measured with; empty if that is missing."""
    file = (folder or beforehand.FOLDER).joinpath(f"{NAME}.json")
    if not file.is_file():
        return {}
    found: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return found
