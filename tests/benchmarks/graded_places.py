"""Graded lattices at places of the tool, against the uniform lattice of their finest cells.

    python -m tests.benchmarks.graded_places [PLACES]

writes reports/data/graded_places.csv, a row per place of `corrected_places.csv`, which has uniform
and corrected lattices there. Places that are in the table are kept. What corrected ones cost, which
is nearly the same everywhere, is in `corrected_cost.csv`.

Errors are relative L2 differences of the curve of the control point under the tool, as there: of a
region of interest against the uniform lattice of 5 mm, of a graded corrected lattice of what it
adds to the linear elements against what that lattice adds.
"""

from __future__ import annotations

import csv
import sys
import time
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from study.models.lattice import LatticeModel, PreparedLattice, requested_step
from study.models.remainder import PreparedRemainder
from study.models.table import model
from study.problem.problem import Problem
from study.scene import Place, Scene
from study.scene.problem import problem_of
from study.tradeoff.timing import in_turns
from tests.benchmarks import corrected_places
from tests.benchmarks.corrected_places import REACHES, by_frames
from tests.benchmarks.corrected_runs import VECTORS, scene
from tests.benchmarks.tables import complete, read

Floats = NDArray[np.float64]

TABLE = corrected_places.TABLE.with_name("graded_places.csv")
PLACES = 20
EVERY = 5
"""Of the places of the other table."""
FINEST = 0.005
TOLERANCE = 0.02
TURNS = 5


class Row(NamedTuple):
    """A place as in the other table; lengths [m], relative errors, nodes that do not hang.

    `region_apart`: what the region's rest is off, linear, by which its radius was chosen;
    `region_error` of its motion; `region_gain`: processor time of the finest cells throughout over
    its own. `graded_*`: of corrected lattices whose finest cells reach REACHES
    radii of the tool. `uniform_10` and `uniform_8`, of lattices of one size, and `corrected_20`
    and `corrected_10` are those of the other table.
    """

    at_x: float
    at_z: float
    radius_m: float
    strain: float
    force_n: float
    region_radius_m: float
    region_nodes: int
    region_apart: float
    region_error: float
    region_gain: float
    graded_nodes: int
    graded_error: float
    graded_near_nodes: int
    graded_near_error: float
    uniform_10: float
    uniform_8: float
    corrected_20: float
    corrected_10: float


def known(every: int = EVERY) -> list[dict[str, float]]:
    """Places of the other table, every so many."""
    with corrected_places.TABLE.open(encoding="utf-8") as file:
        rows = [{k: _number(v) for k, v in one.items()} for one in csv.DictReader(file)]
    return rows[::every]


def _number(text: str) -> float:
    return float(text) if text not in {"True", "False"} else float(text == "True")


def placed(one: dict[str, float]) -> Scene:
    """The scene with the tool at a place."""
    given = scene()
    place = Place(side="anterior", at=(one["at_x"], one["at_z"]))
    tool = replace(given.tool, place=place, radius=one["radius_m"], force=one["force_n"])
    points = {**given.control_points, "tool": place}
    return replace(given, tool=tool, control_points=points)


def row(one: dict[str, float]) -> Row:
    """All errors at a place."""
    given = placed(one)
    problem = problem_of(given)
    whole = lattice(given, "tissue", spacing=FINEST).prepare(problem)
    truth = at_tool(problem, whole.simulate().trajectory.displacement)
    linear = lattice(given, "tissue", spacing=FINEST, geometry="linear").prepare(problem)
    added = truth - at_tool(problem, linear.simulate().trajectory.displacement)
    region = lattice(given, "region", spacing=FINEST, tolerance=TOLERANCE).prepare(problem)
    found = at_tool(problem, region.simulate().trajectory.displacement)
    graded = [corrected(given, problem, reach, added, truth) for reach in reversed(REACHES)]
    return Row(
        *(one[key] for key in ("at_x", "at_z", "radius_m", "strain", "force_n")),
        region.region.radius,
        free(region),
        region.region.apart,
        size(found - truth, truth),
        ratio(region, whole),
        *(value for pair in graded for value in pair),
        *(one[key] for key in ("own_10", "own_8", "error_20", "error_10")),
    )


def lattice(given: Scene, name: str, **settings: float | str) -> LatticeModel:
    """A lattice of the tissue with the volume term."""
    return model(given, name).varied(volume_term=True, step_fraction=0.8, **settings)


def corrected(
    given: Scene, problem: Problem, reach: float, added: Floats, truth: Floats
) -> tuple[int, float]:
    """Free nodes of a graded lattice, and the error of what it adds to its linear motion."""
    radius = reach * given.tool.radius
    one = lattice(given, "region", spacing=FINEST, radius=radius).prepare(problem)
    remainder = PreparedRemainder(one, VECTORS).run(requested_step(one.model.lattice))
    return free(one), size(at_tool(problem, remainder.trajectory.displacement) - added, truth)


def at_tool(problem: Problem, motion: Floats) -> Floats:
    """Curve [m] (samples, 3) of the control point under the tool."""
    return motion[:, problem.tool_probe]


def free(one: PreparedLattice) -> int:
    """Nodes that do not hang."""
    return len(one.assembly.mass) - getattr(one.assembly.lattice, "hanging", 0)


def size(difference: Floats, whole: Floats) -> float:
    """Relative L2 norm."""
    return float(np.linalg.norm(difference) / np.linalg.norm(whole))


def ratio(one: PreparedLattice, whole: PreparedLattice) -> float:
    """Processor time of a simulated second of the finest cells throughout, over one's."""
    steppers = [by_frames(each.stepper()) for each in (one, whole)]
    timings = in_turns(steppers, TURNS, time.process_time)
    cost, most = (
        timing.walls.mean(axis=1).min() / stepper.step
        for timing, stepper in zip(timings, steppers, strict=True)
    )
    return float(most / cost)


def kept() -> dict[tuple[float, float], Row]:
    """Rows of the table that are there, by place."""
    return {(one.at_x, one.at_z): one for one in read(TABLE, Row)}


def main(places: int = PLACES) -> None:
    """Write what is missing of the table, after each place."""
    tasks = {(one["at_x"], one["at_z"]): lambda one=one: [row(one)] for one in known()[:places]}
    complete(TABLE, Row, tasks, lambda one: (one.at_x, one.at_z))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
