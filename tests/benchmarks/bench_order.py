"""How a step of the lattice over its list depends on the order of nodes, and its memory by size.

    python -m tests.benchmarks.bench_order

prints the figures and writes reports/data/lattice_order.csv; it takes three minutes and 4 GB.
Times are of a full cube with volume term, least of several repeats in turns, as in `bench_lattice`.
Orders of nodes matter only to the list of springs, as a grid has its own.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import reverse_cuthill_mckee

from msm.lattice import CellLattice
from msm.springs import connect
from msm.timestep import LOOK
from tests.benchmarks.bench_lattice import (
    LAW,
    Timing,
    cube,
    free,
    in_turns,
    stepping,
)
from tests.benchmarks.machine import load, machine
from tests.benchmarks.tables import cells, write

Ints = NDArray[np.int64]

TABLE = Path(__file__).parents[2] / "reports" / "data" / "lattice_order.csv"
SIZES = (1_000, 10_000, 100_000, 1_000_000)
ORDERED = 100_000
LATENCY_NODES = 2_400
SPRINGS_PER_REPEAT = 2_000_000
"""Springs that one repeat evaluates: some milliseconds."""
REPEATS = 5
STEP = 1e-4


class Row(NamedTuple):
    """A step of a cube over list or grid, nodes in an order: ns per spring, least and median.

    `peak_mib`: largest memory of a process that makes the lattice and steps it, NaN where it was
    not measured.
    """

    nodes: int
    springs: int
    kernel: str
    order: str
    ns_per_spring: float
    ns_per_spring_median: float
    peak_mib: float
    machine: str
    load: float


def numbered(lattice: CellLattice, order: Ints) -> CellLattice:
    """The same lattice with its nodes in the given order, and its cells in that of their nodes."""
    number = np.empty(len(order), dtype=np.int64)
    number[order] = np.arange(len(order))
    cells = number[lattice.cells]
    first = np.argsort(cells.min(axis=1), kind="stable")
    return CellLattice(
        lattice.spacing,
        lattice.origin,
        lattice.nodes[order],
        cells[first],
        lattice.index[first],
        lattice.fill[first],
        lattice.dropped,
    )


def cuthill_mckee(lattice: CellLattice) -> Ints:
    """The nodes in an order of small bandwidth."""
    ends = connect(lattice).ends
    pairs = (np.ones(len(ends), dtype=np.int8), tuple(ends.T))
    graph = csr_array(coo_array(pairs, shape=(len(lattice.nodes),) * 2))
    return np.asarray(reverse_cuthill_mckee(csr_array(graph + graph.T), symmetric_mode=True))


def rows(lattices: dict[str, CellLattice], *, on_grid: bool) -> list[Row]:
    """Lattices by the order of their nodes and a word for it, in turns."""
    nets = {name: free(lattice) for name, lattice in lattices.items()}
    counts = {name: max(1, SPRINGS_PER_REPEAT // len(net.ends)) for name, net in nets.items()}
    tasks = {
        name: stepping(LAW, net, STEP, counts[name], lattices[name] if on_grid else None)
        for name, net in nets.items()
    }
    found = in_turns(tasks, REPEATS, time.thread_time)
    return [
        row(len(net.mass), len(net.ends), on_grid, name, found[name] / counts[name])
        for name, net in nets.items()
    ]


def row(nodes: int, springs: int, on_grid: bool, order: str, step: Timing) -> Row:
    """A line of the table from the time [s] of a step."""
    times = [1e9 * t / springs for t in step]
    kernel = "grid" if on_grid else "list"
    order = order if not order.isdecimal() else "as built"
    return Row(nodes, springs, kernel, order, *times, float("nan"), machine(), load())


def growth() -> list[Row]:
    """The number of nodes, over grid and list; memory of the largest."""
    cubes = {str(size): cube(size) for size in SIZES}
    found = rows(cubes, on_grid=True)
    found[-1] = found[-1]._replace(peak_mib=peak_memory(SIZES[-1]) / 2**20)
    return [*found, *rows(cubes, on_grid=False)]


def orders(size: int) -> list[Row]:
    """Nodes numbered otherwise than built, and at random."""
    built = cube(size)
    shuffled = np.random.default_rng(0).permutation(len(built.nodes))
    others = {"reverse Cuthill-McKee": cuthill_mckee(built), "random": shuffled}
    return rows({name: numbered(built, o) for name, o in others.items()}, on_grid=False)


def peak_memory(nodes: int) -> float:
    """Memory [byte] of a process that builds a lattice of that many nodes and steps it."""
    code = f"from tests.benchmarks.bench_order import *; print(memory_of_a_run({nodes}))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, text=True)
    return float(found.stdout)


def memory_of_a_run(nodes: int) -> int:
    """Largest memory [byte] of this process after some steps of a lattice."""
    lattice = cube(nodes)
    stepping(LAW, free(lattice), STEP, 5, lattice)()
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def latency() -> dict[str, Timing]:
    """Time [s] of one step: in calls of as many as a run takes, and by itself."""
    lattice = cube(LATENCY_NODES)
    net, counts = free(lattice), {"in a run": LOOK, "by itself": 1}
    tasks = {name: stepping(LAW, net, STEP, count, lattice) for name, count in counts.items()}
    found = in_turns(tasks, 100)
    return {name: found[name] / count for name, count in counts.items()}


def main() -> None:
    """Print the figures and write the table."""
    for row in write(TABLE, [*growth(), *orders(ORDERED)]):
        sys.stdout.write("  ".join(map(str, cells(row)[:-2])) + "\n")
    for name, step in latency().items():
        sys.stdout.write(f"One step of {LATENCY_NODES} nodes, {name}: {1e6 * step.least:.0f} us\n")


if __name__ == "__main__":
    main()
