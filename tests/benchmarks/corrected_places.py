"""The corrected lattice at random places of the tool, beside uniform lattices and a static control.

    python -m tests.benchmarks.corrected_places DIR [PLACES]

writes reports/data/corrected_places.csv, a row per place, and corrected_cost.csv, what each lattice
costs. Runs are kept in DIR as soon as they end: started again, only what is missing is run.

Errors are relative L2 differences of the displacement of the control point under the tool. What a
corrected lattice of a spacing adds to the linear elements is compared with what the finest lattice
adds, so its error is that of the nonlinear part; a uniform lattice is compared with the sum of
both, and, as `own`, with the finest lattice, which has an error of the linear part too.
"""

from __future__ import annotations

import csv
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from study.models.model import Model, Prepared, Stepper
from study.models.remainder import ORDER
from study.models.table import model
from study.problem.problem import Problem
from study.problem.trajectory import Trajectory
from study.scene.problem import problem_of
from study.similarity.fields import relative_l2
from study.sweep.canonical import Plain
from study.sweep.runner import Outcome, run
from study.sweep.store import Store
from study.sweep.tally import on_stderr
from study.sweep.task import Task
from study.tradeoff.timing import Timing, in_turns
from tests.benchmarks.corrected_runs import FUNCTION, LEVEL, SAMPLES, SPACINGS, scene

Floats = NDArray[np.float64]

TABLE = Path(__file__).parents[2] / "reports" / "data" / "corrected_places.csv"
COSTS = TABLE.with_name("corrected_cost.csv")
SEED, PLACES = 15, 100
RADII = (0.025, 0.015)
SMALL, LARGE = (0.01, 0.05), (0.05, 0.2)
"""Between which the largest strain of the linear elements is drawn."""
FINEST = SPACINGS[-1]
UNIFORM = (0.02, 0.015, 0.01, 0.008, 0.02 / 3, 0.005)
CORRECTED = (0.02, 0.015, 0.01, 0.008)
TRUE_LEVEL = LEVEL + 1
TOLERANCE = 0.02
TURNS = 5


class Row(NamedTuple):
    """One place: lengths [m], relative errors, NaN where one is not told.

    `strain`: largest of the linear elements; `nonlinear`: size of what the finest lattice adds to
    them. `error_H`: of the corrected lattice of H mm; `estimate_20` from 10 mm, `estimate_15` from
    8 mm, `estimate_10` from 6.7 mm, and as controls `coarser_20` from 40 mm and `nearer_20` from
    13 mm. `static_H`: of the lattice with the difference of both at rest times the load.
    `uniform_H`: of lattices alone, `own_H` the same against the finest. `inverted`: whether cells
    of a lattice were.
    """

    at_x: float
    at_z: float
    radius_m: float
    strain: float
    force_n: float
    nonlinear: float
    error_20: float
    error_15: float
    error_10: float
    error_8: float
    estimate_20: float
    estimate_15: float
    estimate_10: float
    coarser_20: float
    nearer_20: float
    static_20: float
    static_10: float
    uniform_20: float
    uniform_15: float
    uniform_10: float
    uniform_8: float
    uniform_7: float
    uniform_5: float
    own_20: float
    own_15: float
    own_10: float
    own_8: float
    own_7: float
    inverted: bool


class Cost(NamedTuple):
    """A lattice alone or corrected at the built-in place: processor time of its steps, and errors.

    `per_second` [s]: of a simulated second; `field_error` over the organ at the peak, `tool_error`
    of the curve at the tool, relative L2, against linear elements on a finer mesh and what the
    finest lattice adds to them.
    """

    model: str
    spacing_m: float
    unknowns: int
    step_s: float
    step_us: float
    per_second: float
    field_error: float
    tool_error: float


def tasks(places: int) -> list[Task]:
    """Random places on the anterior side, by turns of either radius and of either strain."""
    rng = np.random.default_rng(SEED)
    found = []
    for k in range(places):
        a, b, share = rng.uniform(0.0, 1.0, 3)
        low, high = (SMALL, LARGE)[k // 2 % 2]
        at = [round(0.2 + 0.6 * float(one), 3) for one in (a, b)]
        strain = round(low + (high - low) * float(share), 4)
        found.append(Task(FUNCTION, {"at": at, "radius": RADII[k % 2], "strain": strain}))
    return found


@dataclass(frozen=True)
class At:
    """What was observed at a place."""

    arguments: Plain
    value: Plain

    @cached_property
    def linear(self) -> Floats:
        """Curve [m] (samples, 3) of the elements."""
        return curve(self.value["linear"])

    @cached_property
    def truth(self) -> Floats:
        """That of the elements and what the finest lattice adds."""
        return self.linear + self.added(FINEST)

    def added(self, spacing: float) -> Floats:
        """What a lattice does beyond itself linear."""
        return curve(self._lattice(spacing)["remainder"])

    def alone(self, spacing: float) -> Floats:
        """A lattice by itself."""
        return curve(self._lattice(spacing)["nonlinear"])

    def _lattice(self, spacing: float) -> Plain:
        found: list[Plain] = self.value["lattices"]
        return next(one for one in found if abs(one["spacing"] - spacing) < 1e-6)

    def size(self, difference: Floats) -> float:
        """L2 norm over that of the truth."""
        return float(np.linalg.norm(difference) / np.linalg.norm(self.truth))

    def error(self, spacing: float) -> float:
        """Of a corrected lattice, whose linear part is the truth's."""
        return self.size(self.added(spacing) - self.added(FINEST))

    def told(self, spacing: float, other: float) -> float:
        """The error of a corrected lattice as one of another spacing tells it."""
        share = abs(1.0 - (other / spacing) ** ORDER)
        return self.size(self.added(spacing) - self.added(other)) / share

    def static(self, spacing: float) -> float:
        """Of a lattice corrected at rest only, in proportion to the load."""
        rest = np.subtract(self.value["rest"], self._lattice(spacing)["rest"])
        return self.size(self.alone(spacing) + load()[:, None] * rest - self.truth)

    @property
    def inverted(self) -> bool:
        """Whether a lattice had cells inside out."""
        return any(one["inverted_cells"] for one in self.value["lattices"])


def curve(values: Sequence[float]) -> Floats:
    """Samples of three components."""
    return np.array(values, dtype=np.float64).reshape(-1, 3)


def load() -> Floats:
    """Share of the load at the samples."""
    given = scene()
    return given.tool.history.factor(np.linspace(0.0, given.time.duration, SAMPLES))


def row(at: At) -> Row:
    """All errors at a place."""
    given = at.arguments
    return Row(
        *given["at"],
        given["radius"],
        given["strain"],
        at.value["force"],
        at.size(at.added(FINEST)),
        *(at.error(h) for h in CORRECTED),
        *(at.told(*pair) for pair in ((0.02, 0.01), (0.015, 0.008), (0.01, 0.02 / 3))),
        *(at.told(0.02, other) for other in (0.04, 0.04 / 3)),
        *(at.static(h) for h in (0.02, 0.01)),
        *(at.size(at.alone(h) - at.truth) for h in UNIFORM),
        *(at.size(at.alone(h) - at.alone(FINEST)) for h in UNIFORM[:-1]),
        at.inverted,
    )


def costs() -> list[Cost]:
    """Of all lattices in turns, in processor time, at the place and load of the built-in scene."""
    problem = problem_of(scene())
    ready = dict(lattices(problem))
    steppers = [one.stepper() for one in ready.values()]
    timings = in_turns(steppers, TURNS, time.process_time)
    truth = both(FINEST, TRUE_LEVEL).prepare(problem).simulate().trajectory
    return [
        cost(*named, one, timing, truth, problem.volume_rule.weights)
        for named, one, timing in zip(ready.items(), steppers, timings, strict=True)
    ]


def both(spacing: float, level: int) -> Model:
    """A corrected lattice of a spacing [m] on a mesh of the elements."""
    given = model(scene(), "corrected")
    return given.varied(spacing=spacing, level=level, step_fraction=0.8)


def lattices(problem: Problem) -> Iterator[tuple[tuple[str, float], Prepared]]:
    """By model and spacing."""
    alone = model(scene(), "tissue")
    for h in UNIFORM:
        found = alone.varied(spacing=h, volume_term=True, step_fraction=0.8)
        yield ("uniform", h), found.prepare(problem)
    for h in CORRECTED:
        yield ("corrected", h), both(h, LEVEL).prepare(problem)


def cost(
    named: tuple[str, float],
    ready: Prepared,
    one: Stepper,
    timing: Timing,
    truth: Trajectory,
    volumes: Floats,
) -> Cost:
    """Per step and per simulated second, the best of the turns: others share the machine."""
    step = float(timing.walls.mean(axis=1).min())
    found = ready.simulate().trajectory
    weights = np.ones(len(found.displacement))
    field = relative_l2(found.volume_field[0], truth.volume_field[0], volumes)
    tool = relative_l2(found.displacement[:, 0], truth.displacement[:, 0], weights)
    return Cost(*named, one.unknowns, one.step, 1e6 * step, step / one.step, field, tool)


def written(path: Path, rows: Sequence[NamedTuple]) -> None:
    """A table of named tuples."""
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(type(rows[0])._fields)
        table.writerows([_printed(v) for v in one] for one in rows)


def _printed(value: object) -> object:
    return f"{value:.4g}" if isinstance(value, float) else value


def cheapest(errors: Sequence[float], found: Sequence[Cost]) -> float:
    """Cost of the cheapest of these that meets the tolerance, infinite if none does."""
    pairs = zip(errors, found, strict=True)
    return min((one.per_second for e, one in pairs if e <= TOLERANCE), default=np.inf)


def summary(rows: Sequence[Row], found: Sequence[Cost]) -> Iterator[str]:
    """What the tables say, in lines."""
    for one in found:
        yield f"{one.model} {1e3 * one.spacing_m:.3g} mm: {one.per_second:.3g} s per second"
    for name, of in groups(rows):
        ratios = np.array([r.error_20 / r.estimate_20 for r in of])
        yield f"{name}: {len(of)} places, {(ratios <= 2.0).sum()} within twice the estimate"
        for kind in (
            "error_20",
            "error_15",
            "error_10",
            "error_8",
            "static_20",
            "static_10",
            "uniform_5",
        ):
            values = np.array([getattr(r, kind) for r in of])
            met = int((values <= TOLERANCE).sum())
            yield f"  {kind}: median {np.median(values):.2%}, worst {values.max():.2%}, {met} met"
        for words, each in zip(
            ("elements", "finest"), zip(*(gains(r, found) for r in of), strict=True), strict=True
        ):
            yield f"  cost of the cheapest uniform one over it, {words}: {quantiles(each)}"


def gain(errors: Sequence[float], corrected: Sequence[float], found: Sequence[Cost]) -> float:
    """How many times the cheapest uniform lattice costs of the cheapest corrected one.

    The finest is taken where no other meets the tolerance: a lower bound then. Zero where no
    corrected one meets it.
    """
    uniform = [one for one in found if one.model == "uniform"]
    both = [one for one in found if one.model == "corrected"]
    return cheapest([*errors[:-1], 0.0], uniform) / cheapest(corrected, both)


def gains(one: Row, found: Sequence[Cost]) -> tuple[float, float]:
    """Against elements and what the finest lattice adds, and against the finest lattice."""
    corrected = one.error_20, one.error_15, one.error_10, one.error_8
    sums = (one.uniform_20, one.uniform_15, one.uniform_10, one.uniform_8, one.uniform_7)
    own = (one.own_20, one.own_15, one.own_10, one.own_8, one.own_7)
    return tuple(gain([*errors, 0.0], corrected, found) for errors in (sums, own))


def quantiles(values: Sequence[float]) -> str:
    """A few of them."""
    return ", ".join(f"{q} % {np.percentile(values, q):.3g}" for q in (0, 5, 50, 95))


def groups(rows: Sequence[Row]) -> Iterator[tuple[str, list[Row]]]:
    """By strain, then all."""
    yield "strain to 5 %", [r for r in rows if r.strain <= SMALL[1]]
    yield "strain to 20 %", [r for r in rows if r.strain > SMALL[1]]
    yield "all", list(rows)


def observed(outcomes: Sequence[Outcome]) -> list[At]:
    """Those that ran."""
    return [At(one.task.arguments, one.value) for one in outcomes if one.value is not None]


def main(folder: str, places: str = str(PLACES)) -> None:
    """Run what is missing, write both tables and print what they say."""
    with on_stderr("places") as tell:
        outcomes = run(tasks(int(places)), Store(Path(folder)), None, tell)
    found = observed(outcomes)
    rows, priced = [row(at) for at in found], costs()
    written(TABLE, rows)
    written(COSTS, priced)
    for line in summary(rows, priced):
        sys.stdout.write(line + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
