"""What a plan foretells at random places of the tool, to be held against what was found there.

    python -m tests.benchmarks.planned_places [PLACES]

writes reports/data/planned_places.csv, a row per place of `corrected_places.csv`, which has the
errors of lattices in motion there, as `graded_places.csv` has those of graded ones at some. Places
that are in the table are kept: started again, it goes on where it was stopped.

Foretold are relative errors of the displacement of the control point under the tool, each part by
itself, from solutions at rest (`study.plan.prediction`). Only the error of the elements' mesh is
measured here, at rest, against the limit of two finer meshes.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fem_reference.direct import Solve
from fem_reference.error_estimate import ASSUMED_ORDER
from fem_reference.observation import at_points, evaluation
from fem_reference.solvers import solver
from study.plan.candidates import candidates
from study.plan.look import look
from study.plan.plan import choose, measure
from study.plan.prediction import Foresight
from study.problem.problem import Problem
from study.scene import Require
from tests.benchmarks import corrected_places
from tests.benchmarks.corrected_runs import base, elements, pressed, under_tool
from tests.benchmarks.graded_places import known, placed
from tests.benchmarks.tables import complete, read

Floats = NDArray[np.float64]

TABLE = corrected_places.TABLE.with_name("planned_places.csv")
PLACES = 100
WANTED = Require(error=0.02, at=("tool",))
FINER = (1, 2)
"""Meshes from whose solutions at rest the limit is found."""


class Row(NamedTuple):
    """A place as in the other table, and relative errors that were foretold there.

    `geometry`: of what is linear; `remainder_H`: of the nonlinear part on a lattice of H mm;
    `near` and `far`: the same on graded lattices, finest to 0.6 radii and to one radius of the
    tool; `region`: of a graded lattice alone, finest to 1.5 radii; `alone_H`: of a lattice alone.
    `mesh`: of the scene's elements, and `mesh_found` what it is. `chosen`: what the plan takes for
    2 %, with the error that it foretells, or the nearest where it refuses.
    """

    at_x: float
    at_z: float
    radius_m: float
    strain: float
    force_n: float
    geometry: float
    remainder_20: float
    remainder_15: float
    remainder_10: float
    near: float
    far: float
    region: float
    alone_10: float
    alone_5: float
    mesh: float
    mesh_found: float
    chosen: str
    foretold: float


def row(one: dict[str, float]) -> Row:
    """What is foretold at a place."""
    given = replace(placed(one), require=WANTED)
    problem = under_tool([one["at_x"], one["at_z"]], one["radius_m"], one["force_n"])
    seen = look(given, problem)
    foresight = Foresight(seen, measure(WANTED, problem))
    offered = candidates(given, seen, foresight)
    try:
        chosen = choose(offered, WANTED)
    except ValueError:
        chosen = min(offered, key=lambda found: found.prediction.error)
    size = problem.geometry.level(0)
    assert size is not None
    return Row(
        *(one[key] for key in ("at_x", "at_z", "radius_m", "strain", "force_n")),
        foresight.geometry,
        *(foresight.remainder(h) for h in (0.02, 0.015, 0.01)),
        *(foresight.graded_remainder(graded) for graded in seen.graded[-3:-1]),
        foresight.graded(seen.graded[-1]),
        *(foresight.spacing(h) for h in (0.01, 0.005)),
        foresight.mesh(size.size),
        mesh_error(problem),
        chosen.name,
        chosen.prediction.error,
    )


def mesh_error(problem: Problem) -> float:
    """Of the scene's elements at rest, at the tool, against the limit of finer meshes."""
    own, before, last = (at_tool(problem, level) for level in (0, *FINER))
    sizes = [base().geometry.level(level) for level in FINER]
    assert sizes[0] is not None
    assert sizes[1] is not None
    gain = (sizes[0].size / sizes[1].size) ** ASSUMED_ORDER - 1.0
    limit = last + (last - before) / gain
    return float(np.linalg.norm(own - limit) / np.linalg.norm(limit))


def at_tool(problem: Problem, level: int) -> Floats:
    """Displacement [m] (3,) of the control point at rest, of elements on a level."""
    body = pressed(problem, level)
    u = solving(level)(body.load)
    return at_points(evaluation(body, problem.observation.probes), u)[0]


@lru_cache(maxsize=3)
def solving(level: int) -> Solve:
    """Solutions on a level, whatever the load."""
    return solver(elements(level)[0])


def kept() -> dict[tuple[float, float], Row]:
    """Rows of the table that are there, by place."""
    return {(one.at_x, one.at_z): one for one in read(TABLE, Row)}


def main(places: int = PLACES) -> None:
    """Write what is missing of the table, after each place."""
    tasks = {(one["at_x"], one["at_z"]): lambda one=one: [row(one)] for one in known(1)[:places]}
    complete(TABLE, Row, tasks, lambda one: (one.at_x, one.at_z))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
