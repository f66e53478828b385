"""The corrected lattice at random places of the tool, beside uniform lattices and a static control.

    python -m tests.benchmarks.corrected_places DIR [PLACES]

writes reports/data/corrected_places.csv, a row per place; runs are kept in DIR as soon as they end:
started again, only what is missing is run. Without DIR it writes corrected_cost.csv alone, what
each lattice costs.

Errors are relative L2 differences of the displacement of the control point under the tool. What a
corrected lattice of a spacing adds to the linear elements is compared with what the finest lattice
adds, so its error is that of the nonlinear part; a uniform lattice is compared with the sum of
both, and, as `own`, with the finest lattice, which has an error of the linear part too.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from study.models.finite_elements import FRAME_RATE
from study.models.model import Model, Prepared, Stepper
from study.models.remainder import ORDER
from study.models.table import model
from study.problem.problem import Problem
from study.problem.trajectory import Trajectory
from study.scene.problem import problem_of
from study.similarity.fields import relative_l2
from study.sweep.canonical import Plain
from study.sweep.runner import Outcome, run
from study.sweep.status import on_stderr
from study.sweep.store import Store
from study.sweep.task import Task
from study.tradeoff.timing import in_turns
from tests.benchmarks.corrected_runs import FUNCTION, LEVEL, SAMPLES, SPACINGS, scene
from tests.benchmarks.tables import write

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
REACHES, LARGER = (0.6, 1.0), 1.5
"""How far the finest cells of graded lattices reach, in radii of the tool; the last one alone."""
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

    `spacing_m`: of the finest cells, which reach `radius_m` from the tool, 0 where they are all.
    Steps are taken as a run takes them, by frames of 1/60 s with the displacement after each:
    `per_second` [s] of a simulated second, `step_us` of a step; `single_us` of one that is taken by
    itself. `field_error` over the organ at the
    peak, `tool_error` of the curve at the tool, relative L2, against linear elements on a finer
    mesh and what the finest lattice adds to them.
    """

    model: str
    spacing_m: float
    radius_m: float
    unknowns: int
    step_s: float
    step_us: float
    single_us: float
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
    count = len(steppers)
    timings = in_turns([*map(by_frames, steppers), *steppers], TURNS, time.process_time)
    truth = both(FINEST, TRUE_LEVEL).prepare(problem).simulate().trajectory
    # Every turn takes the same steps again: of each the least, and the mean of these.
    walls = [float(timing.walls.min(axis=0).mean()) for timing in timings]
    return [
        cost(*named, one, wall, single, truth, problem.volume_rule.weights)
        for named, one, wall, single in zip(
            ready.items(), steppers, walls[:count], walls[count:], strict=True
        )
    ]


def both(spacing: float, level: int) -> Model:
    """A corrected lattice of a spacing [m] on a mesh of the elements."""
    given = model(scene(), "corrected")
    return given.varied(spacing=spacing, level=level, step_fraction=0.8)


def in_frame(one: Stepper) -> int:
    """Steps in a frame."""
    return max(1, round(1.0 / (FRAME_RATE * one.step)))


def by_frames(one: Stepper) -> Stepper:
    """The same, of which a step is a frame with its displacement delivered."""
    count = in_frame(one)

    def take_frame() -> None:
        one.take_steps(count)
        one.displacement()

    return Stepper(
        take_frame, one.displacement, count * one.step, one.unknowns, restart=one.restart
    )


def lattices(problem: Problem) -> Iterator[tuple[tuple[str, float, float], Prepared]]:
    """By model, spacing and, of graded ones, radius."""
    given = scene()
    alone, region = model(given, "tissue"), model(given, "region")
    same = {"volume_term": True, "step_fraction": 0.8}
    for h in UNIFORM:
        yield ("uniform", h, 0.0), alone.varied(spacing=h, **same).prepare(problem)
    for times in (*REACHES, LARGER):
        radius = times * given.tool.radius
        found = region.varied(spacing=FINEST, radius=radius, **same)
        yield ("graded", FINEST, radius), found.prepare(problem)
    for h in CORRECTED:
        yield ("corrected", h, 0.0), both(h, LEVEL).prepare(problem)
    for times in REACHES:
        radius = times * given.tool.radius
        found = both(FINEST, LEVEL).varied(coarse="graded", spacing=FINEST, radius=radius)
        yield ("corrected graded", FINEST, radius), found.prepare(problem)
    elements = model(given, "superposition").varied(level=LEVEL, certificate=0)
    yield ("superposition", 0.0, 0.0), elements.prepare(problem)


def cost(
    named: tuple[str, float, float],
    ready: Prepared,
    one: Stepper,
    frame: float,
    single: float,
    truth: Trajectory,
    volumes: Floats,
) -> Cost:
    """Of a frame and of a single step [s]; with the errors of the whole motion."""
    step = frame / in_frame(one)
    found = ready.simulate().trajectory
    weights = np.ones(len(found.displacement))
    field = relative_l2(found.volume_field[0], truth.volume_field[0], volumes)
    tool = relative_l2(found.displacement[:, 0], truth.displacement[:, 0], weights)
    walls = 1e6 * step, 1e6 * single, step / one.step
    return Cost(*named, one.unknowns, one.step, *walls, field, tool)


def summary(rows: Sequence[Row]) -> Iterator[str]:
    """What the table says, in lines; `docs.figures` holds it against the costs."""
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


def groups(rows: Sequence[Row]) -> Iterator[tuple[str, list[Row]]]:
    """By strain, then all."""
    yield "strain to 5 %", [r for r in rows if r.strain <= SMALL[1]]
    yield "strain to 20 %", [r for r in rows if r.strain > SMALL[1]]
    yield "all", list(rows)


def observed(outcomes: Sequence[Outcome]) -> list[At]:
    """Those that ran."""
    return [At(one.task.arguments, one.value) for one in outcomes if one.value is not None]


def main(folder: str | None = None, places: str = str(PLACES)) -> None:
    """Run what is missing and write its table, or that of costs, and print what it says."""
    if folder is None:
        priced = costs()
        write(COSTS, priced)
        for cost in priced:
            sys.stdout.write(f"{cost}\n")
        return
    with on_stderr("places") as tell:
        outcomes = run(tasks(int(places)), Store(Path(folder)), None, tell)
    rows = [row(at) for at in observed(outcomes)]
    write(TABLE, rows)
    for line in summary(rows):
        sys.stdout.write(line + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
