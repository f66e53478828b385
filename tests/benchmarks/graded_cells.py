"""Corrected lattices of graded cells by the sizes of these, at places of large strain.

    python -m tests.benchmarks.graded_cells

writes reports/data/graded_cells.csv, a row for each grading that a plan offers at each place of
`graded_places.csv` with a strain above 5 %, the largest first. Places that are in the table are
kept. Errors are those of the nonlinear part, as there.


Costs are processor times of all lattices in turns, each step taken as the least of TURNS repeats,
since other processes disturb some of them. The table has the load of the machine.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from study.models.lattice import requested_step
from study.models.model import Stepper
from study.models.remainder import PreparedRemainder
from study.models.table import model
from study.plan.look import GradedLook, look
from study.plan.plan import measure
from study.plan.prediction import Foresight
from study.problem.problem import Problem
from study.scene import Scene
from study.scene.problem import problem_of
from study.tradeoff.timing import in_turns
from tests.benchmarks.corrected_places import SMALL, by_frames
from tests.benchmarks.corrected_runs import LEVEL, VECTORS
from tests.benchmarks.graded_places import (
    FINEST,
    TABLE,
    TURNS,
    at_tool,
    free,
    known,
    lattice,
    placed,
    size,
)
from tests.benchmarks.planned_places import WANTED
from tests.benchmarks.tables import complete, read

Floats = NDArray[np.float64]

OWN = TABLE.with_name("graded_cells.csv")


class Row(NamedTuple):
    """A place as in the other table, and a grading there; lengths [m].

    `finest_m`: edge of the finest cells, which reach `reach_m` from the tool; `levels`: number of
    sizes; `nodes`: those that do not hang. `error` of the displacement at the tool, `foretold` by a
    plan; `gain`: processor time of the uniform lattice of FINEST over that of the corrected one,
    at a `load` of so many processes that ran or waited, averaged over the last minute;
    nan where it was not recorded, which was on a machine without other work.
    """

    at_x: float
    at_z: float
    radius_m: float
    strain: float
    finest_m: float
    levels: int
    reach_m: float
    nodes: int
    error: float
    foretold: float
    gain: float
    load: float


def rows(one: dict[str, float]) -> Iterator[Row]:
    """All gradings at a place."""
    given = placed(one)
    problem = problem_of(given)
    seen = look(given, problem)
    foresight = Foresight(seen, measure(WANTED, problem))
    truth, added = (at_tool(problem, motion) for motion in uniform(given, problem))
    offered = seen.graded[:-1]
    costs, load = gains(given, problem, offered), os.getloadavg()[0]
    for grading, gain in zip(offered, costs, strict=True):
        region = lattice(given, "region", **settings(grading)).prepare(problem)
        run = PreparedRemainder(region, VECTORS).run(requested_step(region.model.lattice))
        error = size(at_tool(problem, run.trajectory.displacement) - added, truth)
        yield Row(
            *(one[key] for key in ("at_x", "at_z", "radius_m", "strain")),
            grading.lattice.spacing,
            grading.levels,
            grading.radius,
            free(region),
            error,
            foresight.graded_remainder(grading),
            gain,
            load,
        )


def settings(one: GradedLook) -> dict[str, float]:
    """Keys of the table `region`."""
    return {"spacing": one.lattice.spacing, "levels": one.levels, "radius": one.radius}


def uniform(given: Scene, problem: Problem) -> tuple[Floats, Floats]:
    """Motion [m] of the lattice of FINEST, and what of it is beyond its linear one."""
    whole, linear = (
        lattice(given, "tissue", spacing=FINEST, geometry=geometry)
        .prepare(problem)
        .simulate()
        .trajectory.displacement
        for geometry in ("nonlinear", "linear")
    )
    return whole, whole - linear


def gains(given: Scene, problem: Problem, offered: Sequence[GradedLook]) -> list[float]:
    """Processor time of a simulated second of the lattice of FINEST, over each corrected one's."""
    whole = lattice(given, "tissue", spacing=FINEST).prepare(problem).stepper()
    steppers = [by_frames(one) for one in (whole, *corrected(given, problem, offered))]
    timings = in_turns(steppers, TURNS, time.process_time)
    most, *costs = (
        timing.walls.min(axis=0).mean() / stepper.step
        for timing, stepper in zip(timings, steppers, strict=True)
    )
    return [float(most / cost) for cost in costs]


def corrected(given: Scene, problem: Problem, offered: Sequence[GradedLook]) -> Iterator[Stepper]:
    """Steppers of corrected lattices of these gradings."""
    found = model(given, "corrected").varied(level=LEVEL, step_fraction=0.8, coarse="graded")
    for one in offered:
        yield found.varied(**settings(one)).prepare(problem).stepper()


def kept() -> list[Row]:
    """Rows of the table that are there."""
    return read(OWN, Row)


def main() -> None:
    """Write the table, after each place."""
    places = sorted(known(), key=lambda one: -one["strain"])
    tasks = {
        (one["at_x"], one["at_z"]): partial(rows, one) for one in places if one["strain"] > SMALL[1]
    }
    complete(OWN, Row, tasks, lambda row: (row.at_x, row.at_z))


if __name__ == "__main__":
    main()
