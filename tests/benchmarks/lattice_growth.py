"""How cost grows: of a lattice's step with its nodes, of a run with spacing and mesh.

    python -m tests.benchmarks.lattice_growth

writes reports/data/lattice_growth.csv and run_growth.csv; it takes ten minutes and 4 GB. Times
are processor times of one thread, the least of several turns: a busy machine disturbs these little,
except that what else runs shares caches and bandwidth of the memory. `load_average` says how busy
it was, `of_smallest` is the ratio to the smallest lattice of the same precision.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from msm.grid import grids_of
from msm.grid_explicit import symplectic_euler
from study.models.table import model
from study.problem.problem import Problem
from study.scene import Scene
from study.scene.file import read_scene
from study.scene.problem import problem_of
from tests.benchmarks.bench_lattice import LAW, cube, free
from tests.benchmarks.bench_order import SIZES, SPRINGS_PER_REPEAT
from tests.benchmarks.tables import write

DATA = Path(__file__).parents[2] / "reports" / "data"
TURNS = 7
SPACINGS = (0.02, 0.015, 0.01, 0.02 / 3, 0.005)
ELEMENTS = (0.03, 0.02, 0.015)
"""Spacings of the built-in liver's lattice and element sizes of its reference [m]."""


class Step(NamedTuple):
    """One step of symplectic Euler of a free cube with volume term, on the grid."""

    precision: str
    nodes: int
    springs: int
    step_us: float
    ns_per_spring: float
    of_smallest: float
    load_average: float


class Whole(NamedTuple):
    """The motion of the built-in liver by one model, without its error estimates.

    `size_m`: spacing, or edge of the elements; `steps_s`: the shortest step; `run_s`: processor
    time; `per_second`: of a simulated second.
    """

    model: str
    precision: str
    size_m: float
    unknowns: int
    step_s: float
    run_s: float
    per_second: float
    load_average: float


def least(task: Callable[[], object], turns: int = TURNS) -> float:
    """Least processor time [s] of a task, after a turn that does not count."""
    taken = []
    for _ in range(turns + 1):
        started = time.thread_time()
        task()
        taken.append(time.thread_time() - started)
    return min(taken[1:])


def steps() -> Iterator[Step]:
    """By precision and size."""
    first: dict[str, float] = {}
    for size in SIZES:
        lattice = cube(size)
        net = free(lattice)
        count = max(2, SPRINGS_PER_REPEAT // len(net.ends))
        factors = np.ones((count, 1))
        for precision in ("double", "single"):
            grid = grids_of(lattice, net, single=precision == "single")
            u, v = np.zeros((2, *net.load.shape))
            # Many steps of a call against one of a few: what enters and leaves is not theirs.
            whole = least(lambda: symplectic_euler(LAW, grid, factors, 1e-4, u, v))  # noqa: B023
            ends = least(lambda: symplectic_euler(LAW, grid, factors[:0], 1e-4, u, v))  # noqa: B023
            each = (whole - ends) / count
            cost = each / len(net.ends)
            ratio = cost / first.setdefault(precision, cost)
            yield Step(
                precision, len(net.mass), len(net.ends), 1e6 * each, 1e9 * cost, ratio, load()
            )


def load() -> float:
    """Of the last minute."""
    return os.getloadavg()[0]


def runs() -> Iterator[Whole]:
    """The lattice by spacing in both precisions, then finite elements by mesh."""
    scene = read_scene("liver")
    problem = problem_of(scene)
    for spacing in SPACINGS:
        for precision in ("double", "single"):
            settings = {"spacing": spacing, "volume_term": True, "precision": precision}
            yield whole("tissue", scene, problem, spacing, precision, settings)
    for size in ELEMENTS:
        asked = (f"reference.element_size={size}", "reference.method=tr-bdf2")
        coarse = read_scene("liver", asked)
        yield whole("fem", coarse, problem_of(coarse), size, "double", {"rate": 60.0})


def whole(
    name: str,
    scene: Scene,
    problem: Problem,
    size: float,
    precision: str,
    settings: dict[str, object],
) -> Whole:
    """One model of a scene with these settings, moved from rest to the end."""
    prepared = model(scene, name).varied(**settings).prepare(problem)
    prepared.stepper()  # compiles
    started = time.thread_time()
    found = prepared.simulate()
    taken = time.thread_time() - started
    duration = float(problem.observation.times[-1])
    unknowns = prepared.stepper().unknowns
    return Whole(name, precision, size, unknowns, found.step, taken, taken / duration, load())


def main() -> None:
    """Measure and write both tables."""
    write(DATA / "lattice_growth.csv", steps())
    write(DATA / "run_growth.csv", runs())


if __name__ == "__main__":
    main()
