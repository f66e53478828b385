"""Trade-off of accuracy and cost: the configurations measured, and what they allow at a rate."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.resources.abc import Traversable

from reports import benchmarks
from reports.benchmarks import Line
from reports.configuration_names import LIVER_EDGE, mark_of, name_of
from reports.digits import Table, percent, with_error
from reports.reference import is_built_in_liver
from study.scene.file import validate

NAME = "tradeoff"
MILLI = 1e-3
RATE = re.compile(r"real_time_((\d+)(k?)hz)")
MEASURED = ("resolved", "not resolved")


@dataclass(frozen=True)
class FrameTime:
    """Wall time of a frame over the period of a rate, of a slow one where enough were timed.

    `in_time`: as the table has it.
    """

    share: float
    in_time: bool


@dataclass(frozen=True)
class MeasuredCost:
    """Cost of a configuration: quartiles of wall per simulated second, set-up [s], frames."""

    quartiles: tuple[float, float, float]
    setup: float
    frames: dict[str, FrameTime]


@dataclass(frozen=True)
class MeasuredConfiguration:
    """Accuracy and cost of a configuration of a trade-off study, a line of its table.

    `error`: of the field, or of the force of tools that are moved (`of_force`), None where there is
    none or it is not resolved; `bar`: own error of what it is compared with; `cost`: None for one
    that was not timed. `on_front`: whether
    the study found it on the Pareto front of all, `on_any_load_front` on that of those that follow
    any load. `edge`: elements [m] of the scene's mesh, None where those of others are not known.
    """

    contender: str
    settings: str
    status: str
    message: str
    any_load: bool
    on_front: bool
    on_any_load_front: bool
    error: float | None
    bar: float
    cost: MeasuredCost | None
    of_force: bool = False
    edge: float | None = None

    @property
    def name(self) -> str:
        """Name of the configuration: contender and settings in words."""
        return name_of(self.contender, self.settings, self.edge)

    @property
    def mark(self) -> str:
        """The setting that tells it apart from others of its contender first."""
        return mark_of(self.settings, self.edge)

    @property
    def timing(self) -> MeasuredCost:
        """Cost of a timed configuration. ValueError for one that was not timed."""
        if self.cost is None:
            raise ValueError(f"{self.name}: {self.status} and so not timed; ask of `timed` ones")
        return self.cost

    @property
    def stated_error(self) -> str:
        """Error of the configuration as printed."""
        if self.error is None:
            return f"not resolved (< {percent(self.bar)})"
        return f"{with_error(100.0 * self.error, 100.0 * self.bar)} %"


def configurations(folder: Traversable | None = None) -> list[MeasuredConfiguration]:
    """Configurations of a folder's table, or of that of the program; none if it is missing."""
    edge = _edge(folder)
    return [_configuration(line, edge) for line in benchmarks.read(NAME, folder)]


def _edge(folder: Traversable | None) -> float | None:
    """Elements [m] of the mesh of a study's scene, None where its levels are not of one ratio."""
    if folder is None:
        return LIVER_EDGE
    file = folder.joinpath("scene.toml")
    if not file.is_file():
        return None
    scene = validate(tomllib.loads(file.read_text(encoding="utf-8")), "scene.toml")
    return scene.reference.element_size if is_built_in_liver(scene) else None


def _configuration(line: Line, edge: float | None) -> MeasuredConfiguration:
    judged = "force" if line.get("force_error_bar") else "field"
    return MeasuredConfiguration(
        contender=line["contender"],
        settings=line["configuration"],
        status=line["status"],
        message=line["message"],
        any_load=line["any_load"] == "True",
        on_front=line["pareto"] == "True",
        on_any_load_front=line["pareto_any_load"] == "True",
        error=float(line[f"{judged}_error"]) if line[f"{judged}_error"] else None,
        bar=float(line[f"{judged}_error_bar"]),
        cost=_cost(line) if line["wall_per_s"] else None,
        of_force=judged == "force",
        edge=edge,
    )


def _cost(line: Line) -> MeasuredCost:
    walls = [float(line[f"wall_per_s{end}"]) for end in ("_q1", "", "_q3")]
    frames = {rate: _frame(line, rate, hertz) for rate, hertz in rates(line).items()}
    return MeasuredCost((walls[0], walls[1], walls[2]), float(line["setup_s"]), frames)


def _frame(line: Line, rate: str, hertz: float) -> FrameTime:
    wall = line[f"slow_frame_ms_{rate}"] or line[f"frame_ms_{rate}"]
    return FrameTime(MILLI * float(wall) * hertz, line[f"real_time_{rate}"] == "True")


def rates(columns: Iterable[str]) -> dict[str, float]:
    """Rates [Hz] that a table has columns of, by their names there."""
    found = (RATE.fullmatch(column) for column in columns)
    return {m[1]: float(m[2]) * (1e3 if m[3] else 1.0) for m in found if m}


def rates_of(shown: Sequence[MeasuredConfiguration]) -> list[str]:
    """Names of the rates at which configurations were timed."""
    return list(shown[0].timing.frames) if shown else []


def rate_name(rate: str) -> str:
    """Name of a rate as one writes it: "1khz" becomes "1 kHz"."""
    return rate.replace("khz", " kHz").replace("hz", " Hz")


def timed(found: Iterable[MeasuredConfiguration]) -> list[MeasuredConfiguration]:
    """Configurations with a cost and an error, or one below the reference's."""
    return [one for one in found if one.cost is not None and one.status in MEASURED]


def _error(one: MeasuredConfiguration) -> float:
    return 0.0 if one.error is None else one.error


def share(one: MeasuredConfiguration, rate: str) -> float:
    """Share of the period of a rate that a frame of a configuration takes."""
    return one.timing.frames[rate].share


def is_in_time(one: MeasuredConfiguration, rate: str) -> bool:
    """Whether a frame of a configuration is ready within the period of a rate."""
    return one.timing.frames[rate].in_time


def best(found: Iterable[MeasuredConfiguration], rate: str) -> MeasuredConfiguration | None:
    """The most accurate configuration that is in time at a rate, or None.

    Errors that differ by less than the reference's own are equal: the cheapest of those.
    """
    fit = [one for one in timed(found) if is_in_time(one, rate)]
    least = min((_error(one) for one in fit), default=0.0)
    equal = [one for one in fit if _error(one) <= least + (one.bar if least else 0.0)]
    return min(equal, key=lambda one: share(one, rate), default=None)


def next_better(
    found: Iterable[MeasuredConfiguration], rate: str, chosen: MeasuredConfiguration
) -> MeasuredConfiguration | None:
    """The cheapest configuration better than the chosen one by more than the reference's error."""
    better = [one for one in timed(found) if is_better(one, chosen)]
    return min(better, key=lambda one: share(one, rate), default=None)


def is_better(one: MeasuredConfiguration, other: MeasuredConfiguration) -> bool:
    """Whether an error is lower than another by more than the reference's own."""
    return _error(one) < _error(other) - other.bar


def left_out(found: Iterable[MeasuredConfiguration]) -> Table:
    """Configurations that have no place: name, what became of them and what was said."""
    return [[one.name, one.status, one.message] for one in found if one.status not in MEASURED]


@dataclass(frozen=True)
class Conditions:
    """Conditions of a trade-off study: machine, turns, unknowns and error of its reference."""

    processor: str | None
    repeats: int
    unknowns: int
    field_error: float


def conditions(folder: Traversable | None = None) -> Conditions | None:
    """Conditions of a folder's study, or of that of the program; None if its record is missing."""
    file = (folder or benchmarks.FOLDER).joinpath(f"{NAME}.json")
    if not file.is_file():
        return None
    found = json.loads(file.read_text(encoding="utf-8"))
    return Conditions(
        processor=found["machine"]["processor"],
        repeats=found["repeats"],
        unknowns=found["reference"]["unknowns"],
        field_error=found["reference"]["field_error"],
    )
