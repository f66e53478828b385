"""Nonlinear parts of graded lattices at rest, against cells finer than those of a plan.

    python -m tests.benchmarks.graded_rest [PLACES]

writes reports/data/graded_rest.csv, a row for each grading that a plan offers at each place of
`graded_places.csv`, whose errors are those against cells of 5 mm: it cannot show the error that
these have themselves, of which a plan predicts a part. Here the differences are from cells of 2.5
mm as well, at rest under the full load, at the control point under the tool. Places that are in the
table are kept.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from study.models.lattice import LatticeModel
from study.models.table import model
from study.models.tissue import lacks_poisson_ratio
from study.plan.look import (
    GRADINGS,
    SPACINGS,
    ElementsLook,
    GradedLook,
    Grading,
    LatticeLook,
    Look,
    Rest,
    lattice_at_rest,
    on_lattice,
)
from study.plan.prediction import Foresight, Measure
from study.problem.problem import Problem
from study.scene import Scene
from tests.benchmarks import planned_places
from tests.benchmarks.corrected_runs import under_tool
from tests.benchmarks.graded_places import TABLE as PLACES
from tests.benchmarks.graded_places import known, placed
from tests.benchmarks.tables import complete, read

TABLE = PLACES.with_name("graded_rest.csv")
FINE = Grading(0.25, 4, 1.5)
"""The lattice whose cells are half as large as the finest of a plan, and reach as far."""


class Row(NamedTuple):
    """A place as in the other table, and a grading there; lengths [m].

    `finest_m`: edge of the finest cells, which reach `reach_m` from the tool; `foretold`: error by
    a plan. `of_5_mm` and `of_2_5_mm`: differences of the nonlinear part from those of the widest
    region of cells of 5 and of 2.5 mm. All relative to the displacement.
    """

    at_x: float
    at_z: float
    radius_m: float
    strain: float
    finest_m: float
    reach_m: float
    foretold: float
    of_5_mm: float
    of_2_5_mm: float


def rows(one: dict[str, float]) -> Iterator[Row]:
    """All gradings at a place."""
    given = placed(one)
    problem = under_tool([one["at_x"], one["at_z"]], one["radius_m"], one["force_n"])
    uniform = (at_tool(problem, lattice_at_rest(on_lattice(given, problem, h))) for h in SPACINGS)
    elements = Rest(planned_places.at_tool(problem, 0)[None], np.zeros((0, 3)))
    *graded, fine = (graded_at_rest(given, problem, grading) for grading in (*GRADINGS, FINE))
    seen = Look(
        problem,
        tuple(uniform),
        (ElementsLook(0, 1.0, 0, 0.0, elements),),
        one["strain"],
        0.0,
        tuple(graded),
    )
    yield from compared(one, seen, fine)


def compared(one: dict[str, float], seen: Look, fine: GradedLook) -> Iterator[Row]:
    """Predictions at a place, and differences from the widest region and from a fine one."""
    foresight = Foresight(seen, Measure((0,), None))
    for grading in seen.graded[:-1]:
        yield Row(
            *(one[key] for key in ("at_x", "at_z", "radius_m", "strain")),
            grading.lattice.spacing,
            grading.radius,
            foresight.graded_remainder(grading),
            *(apart(foresight, grading, other) for other in (seen.graded[-1], fine)),
        )


def apart(foresight: Foresight, one: GradedLook, other: GradedLook) -> float:
    """Relative difference of two nonlinear parts. ValueError where one of them finds no rest."""
    found = []
    for grading in (one, other):
        if grading.lattice.nonlinear is None:
            raise ValueError(f"lattice of {grading.lattice.spacing:g} m: is not at rest")
        found.append(grading.lattice.nonlinear.plus(grading.lattice.linear, -1.0))
    return foresight.measure(found[0].plus(found[1], -1.0), foresight.whole)


def graded_at_rest(given: Scene, problem: Problem, grading: Grading) -> GradedLook:
    """A graded lattice at rest, observed at the tool."""
    region = model(given, "region")
    assert isinstance(region, LatticeModel)
    spacing, radius = grading.finest * given.lattice.spacing, grading.reach * given.tool.radius
    prepared = region.varied(
        spacing=spacing,
        levels=grading.levels,
        radius=radius,
        volume_term=lacks_poisson_ratio(given),
    ).prepare(problem)
    seen = replace(lattice_at_rest(prepared), spacing=spacing)
    return GradedLook(grading.levels, radius, at_tool(problem, seen), 0.0)


def at_tool(problem: Problem, one: LatticeLook) -> LatticeLook:
    """What of a lattice is seen at the control point under the tool."""

    def only(rest: Rest) -> Rest:
        return Rest(rest.probes[[problem.tool_probe]], np.zeros((0, 3)))

    large = None if one.nonlinear is None else only(one.nonlinear)
    return replace(one, linear=only(one.linear), nonlinear=large)


def kept() -> list[Row]:
    """Rows of the table that are there."""
    return read(TABLE, Row)


def main(places: int | None = None) -> None:
    """Write what is missing of the table, after each place."""
    tasks = {(one["at_x"], one["at_z"]): partial(rows, one) for one in known()[:places]}
    complete(TABLE, Row, tasks, lambda row: (row.at_x, row.at_z))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
