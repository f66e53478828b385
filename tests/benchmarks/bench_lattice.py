"""Speed of the lattice: against C, against its size, on grid and list, and against real time.

    python -m tests.benchmarks.bench_lattice

prints the figures and writes reports/data/real_time.csv; it takes ten minutes and 4 GB, and a C
compiler for the first part. Each figure is the least of several repeats, which others on the
machine disturb least, and their median. What is compared is measured in turns. Steps are those of a
run, over the grid; springs alone and the orders of nodes are measured over the list of springs.

A step on two threads, each with its half of the nodes, was tried over the list of springs and left
out. It starts threads three times a step, each 7 us with OpenMP and 50 us with numba's own queue,
of 150 us at 2500 nodes, and of 56 us over the grid; with another process on the second core a step
took 1.2 to 1.3 times as long as on one thread. An idle second core was not to be had. It is put to
better use by another run.
"""

from __future__ import annotations

import csv
import ctypes
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import reverse_cuthill_mckee

from msm.assembly import Assembly, Material, arrays
from msm.calibration import reference_stiffness
from msm.damping import NodalDamping
from msm.explicit import symplectic_euler
from msm.forces import add_spring_forces
from msm.grid import grid_of
from msm.grid_explicit import symplectic_euler as symplectic_euler_on_grid
from msm.lattice import CORNERS, CellLattice, node_volumes
from msm.laws import Hooke, Law
from msm.network import Network, network
from msm.springs import connect
from msm.stability import critical_time_step
from msm.timestep import LOOK
from msm.volume import volume_term
from study.models.damping import nodal_damping
from study.scene.file import read_scene
from tests.benchmarks import field_error

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

HERE = Path(__file__).parent
TABLE = HERE.parents[1] / "reports" / "data" / "real_time.csv"
RATIOS = (0.45, 0.49)
SPACINGS = (0.012, 0.010, 0.008, 0.02 / 3, 0.005)
GAIN_SPACINGS = (0.010, 0.02 / 3, 0.005)
FRACTION = 0.8
"""Of the critical step, as the study takes it."""
MODULUS, DENSITY, SPACING = 9.5e3, 1054.0, 0.01
LAW = Hooke(reference_stiffness(MODULUS, SPACING, 0.45))
SIZES = (1_000, 10_000, 100_000, 1_000_000)
LATENCY_SPACING = 0.0102
"""The liver in 2400 nodes."""
SPRINGS_PER_REPEAT = 2_000_000
"""Springs that one repeat evaluates: some milliseconds."""
REPEATS = 9


class Row(NamedTuple):
    """The built-in liver at one Poisson ratio and spacing.

    `wall_per_second`: of one simulated second at `step_s`, least and median; `error`: relative L2
    of the displacement at rest, NaN where it was not computed.
    """

    nu: float
    spacing_m: float
    nodes: int
    springs: int
    critical_step_s: float
    step_s: float
    step_wall_us: float
    ns_per_spring: float
    wall_per_second: float
    wall_per_second_median: float
    real_time_factor: float
    real_time_factor_median: float
    error: float


class Timing(NamedTuple):
    """Least and median time [s]."""

    least: float
    median: float

    def __truediv__(self, count: float) -> Timing:
        """Time of one of `count`."""
        return Timing(self.least / count, self.median / count)


def rounds(tasks: dict[str, Callable[[], None]], repeats: int = REPEATS) -> dict[str, list[float]]:
    """Times [s] of tasks that take turns, after one round that compiles them."""
    taken: dict[str, list[float]] = {name: [] for name in tasks}
    for _ in range(repeats + 1):
        for name, task in tasks.items():
            started = time.perf_counter()
            task()
            taken[name].append(time.perf_counter() - started)
    return {name: found[1:] for name, found in taken.items()}


def in_turns(tasks: dict[str, Callable[[], None]], repeats: int = REPEATS) -> dict[str, Timing]:
    """Least and median times of tasks that take turns."""
    taken = rounds(tasks, repeats)
    return {name: Timing(min(t), float(np.median(t))) for name, t in taken.items()}


def cube(nodes: int) -> CellLattice:
    """A full lattice of about that many nodes."""
    edge = round(nodes ** (1 / 3)) - 1
    index = np.argwhere(np.ones((edge,) * 3, dtype=bool))
    strides = np.array([(edge + 1) ** 2, edge + 1, 1])
    places = np.argwhere(np.ones((edge + 1,) * 3, dtype=bool))
    cells = (index[:, None, :] + CORNERS) @ strides
    fill = np.ones(len(index))
    return CellLattice(SPACING, np.zeros(3), SPACING * places, cells, index, fill, 0.0)


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


def free(lattice: CellLattice, *, with_volume: bool = True) -> Network:
    """The lattice as a free body at nu = 0.45."""
    count = len(lattice.nodes)
    net = network(
        connect(lattice),
        DENSITY * node_volumes(lattice),
        csr_array((count, count)),
        np.zeros((count, 3)),
        volume_term(lattice, MODULUS, 0.45),
        NodalDamping(600.0),
    )
    return net if with_volume else net._replace(cells=net.cells[:0], bulk=net.bulk[:0])


def moved(net: Network) -> Floats:
    """Displacements [m] (n, 3) of a hundredth of the spacing."""
    return 0.01 * net.spacing * np.random.default_rng(0).standard_normal(net.load.shape)


def c_kernel(folder: Path) -> Callable[[Network, Floats, Floats, int], None]:
    """The spring forces in C, `count` times over; OSError without a compiler."""
    library = folder / "edges.so"
    source = HERE / "edges.c"
    flags = ["-O3", "-march=native", "-shared", "-fPIC"]
    subprocess.run(["cc", *flags, "-o", library, source, "-lm"], check=True)
    function = ctypes.CDLL(str(library)).add_spring_forces

    def run(net: Network, u: Floats, force: Floats, count: int) -> None:
        parts = (net.ends, net.rest, net.length, net.scale, u, force)
        pointers = [ctypes.c_void_p(part.ctypes.data) for part in parts]
        springs, k = ctypes.c_int64(len(net.ends)), ctypes.c_double(LAW.k)
        for _ in range(count):
            function(springs, k, *pointers)

    return run


@numba.njit
def repeat_springs(law: Hooke, net: Network, u: Floats, force: Floats, count: int) -> None:
    """The spring forces of the lattice, `count` times over."""
    for _ in range(count):
        add_spring_forces(law, net, u, force)


def against_c(nodes: int = 10_000) -> dict[str, Timing]:
    """Time [s] per spring of the forces, ours and in C."""
    net = free(cube(nodes), with_volume=False)
    u, force = moved(net), np.zeros_like(net.load)
    count = max(1, SPRINGS_PER_REPEAT // len(net.ends))
    with tempfile.TemporaryDirectory() as folder:
        in_c = c_kernel(Path(folder))
        tasks = {
            "ours": lambda: repeat_springs(LAW, net, u, force, count),
            "C": lambda: in_c(net, u, force, count),
        }
        found = in_turns(tasks)
    return {name: timing / (count * len(net.ends)) for name, timing in found.items()}


def stepping(
    law: Law, net: Network, dt: float, count: int, lattice: CellLattice | None = None
) -> Callable[[], None]:
    """A task: that many steps of symplectic Euler under the full load, on and on.

    Over the grid of a lattice if one is given.
    """
    u, v = np.zeros((2, *net.load.shape))
    factors = np.ones((count, 1))
    if lattice is None:
        return lambda: symplectic_euler(law, net, factors, dt, u, v)
    grid = grid_of(lattice, net)
    return lambda: symplectic_euler_on_grid(law, grid, factors, dt, u, v)


def per_spring(
    lattices: dict[str, CellLattice], repeats: int = REPEATS, *, on_grid: bool = True
) -> dict[str, Timing]:
    """Time [s] of a step over the number of springs."""
    nets = {name: free(lattice) for name, lattice in lattices.items()}
    counts = {name: max(1, SPRINGS_PER_REPEAT // len(net.ends)) for name, net in nets.items()}
    tasks = {
        name: stepping(LAW, net, 1e-4, counts[name], lattices[name] if on_grid else None)
        for name, net in nets.items()
    }
    found = in_turns(tasks, repeats)
    return {name: found[name] / (counts[name] * len(net.ends)) for name, net in nets.items()}


def flatness(sizes: tuple[int, ...] = SIZES) -> dict[str, Timing]:
    """Time [s] per spring and step over the number of nodes."""
    return per_spring({f"{size} nodes": cube(size) for size in sizes}, 5)


def node_orders(size: int) -> dict[str, Timing]:
    """Time [s] per spring and step with the nodes numbered as built, otherwise, and at random."""
    built = cube(size)
    shuffled = np.random.default_rng(0).permutation(len(built.nodes))
    orders = {"reverse Cuthill-McKee": cuthill_mckee(built), "random": shuffled}
    others = {name: numbered(built, order) for name, order in orders.items()}
    return per_spring({"as built": built, **others}, 5, on_grid=False)


def peak_memory(nodes: int) -> float:
    """Memory [byte] of a process that builds a lattice of that many nodes and steps it."""
    code = f"from tests.benchmarks.bench_lattice import *; print(memory_of_a_run({nodes}))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, text=True)
    return float(found.stdout)


def memory_of_a_run(nodes: int) -> int:
    """Largest memory [byte] of this process after some steps of a lattice."""
    stepping(LAW, free(cube(nodes)), 1e-4, 5)()
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


class Liver(NamedTuple):
    """The built-in liver's lattice and material; its critical step [s]."""

    assembly: Assembly
    material: Material
    critical: float


def liver(case: field_error.Case, assembly: Assembly, nu: float) -> Liver:
    """The lattice of `field_error` with the damping of eq. (2), as the study sets it."""
    damping = nodal_damping(read_scene("liver"), case.youngs_modulus)
    stiff = field_error.material(case, assembly, nu, with_volume=True)
    material = Material(stiff.law, stiff.volume, damping)
    return Liver(assembly, material, critical_time_step(assembly, material))


def real_time(case: field_error.Case) -> list[Row]:
    """Every Poisson ratio and spacing, all in turns."""
    lattices = [field_error.lattice(case, spacing) for spacing in SPACINGS]
    livers = {(nu, a.lattice.spacing): liver(case, a, nu) for nu in RATIOS for a in lattices}
    counts = {
        key: max(1, SPRINGS_PER_REPEAT // len(one.assembly.springs.weight))
        for key, one in livers.items()
    }
    tasks = {
        str(key): stepping(
            one.material.law,
            arrays(one.assembly, one.material),
            FRACTION * one.critical,
            counts[key],
            one.assembly.lattice,
        )
        for key, one in livers.items()
    }
    found = in_turns(tasks)
    errors = static_errors(case, lattices)
    return [
        row(*key, one, found[str(key)] / counts[key], errors.get(key, float("nan")))
        for key, one in livers.items()
    ]


class Gain(NamedTuple):
    """Steps of the built-in liver at nu = 0.45 over the list of springs and over the grid.

    `gain`: median over the rounds of the ratio of their times; `list_us`, `grid_us`: least times of
    a step, `grid_ns` per spring; `real_time`, `real_time_median`: simulated over wall time.
    """

    spacing_m: float
    volume_term: bool
    nodes: int
    springs: int
    gain: float
    list_us: float
    grid_us: float
    grid_ns: float
    list_real_time: float
    real_time: float
    real_time_median: float


def gain(case: field_error.Case, assembly: Assembly, *, with_volume: bool) -> Gain:
    """One lattice, on list and grid by turns."""
    one = liver(case, assembly, 0.45)
    net, dt = arrays(one.assembly, one.material), FRACTION * one.critical
    if not with_volume:
        net = net._replace(cells=net.cells[:0], bulk=net.bulk[:0])
    springs = len(net.ends)
    count = max(1, SPRINGS_PER_REPEAT // springs)
    law = one.material.law
    tasks = {
        "list": stepping(law, net, dt, count),
        "grid": stepping(law, net, dt, count, assembly.lattice),
    }
    taken = rounds(tasks, 2 * REPEATS)
    ratios = np.divide(taken["list"], taken["grid"])
    least = {name: min(found) / count for name, found in taken.items()}
    return Gain(
        assembly.lattice.spacing,
        with_volume,
        len(net.mass),
        springs,
        float(np.median(ratios)),
        1e6 * least["list"],
        1e6 * least["grid"],
        1e9 * least["grid"] / springs,
        dt / least["list"],
        dt / least["grid"],
        dt * count / float(np.median(taken["grid"])),
    )


def gains(case: field_error.Case) -> list[Gain]:
    """The spacings that a study takes, with and without volume term."""
    lattices = [field_error.lattice(case, spacing) for spacing in GAIN_SPACINGS]
    return [gain(case, one, with_volume=term) for one in lattices for term in (True, False)]


def report_gains(found: list[Gain]) -> None:
    """Print the gains, a line each."""
    for one in found:
        sys.stdout.write(
            f"{1e3 * one.spacing_m:.1f} mm, {'with' if one.volume_term else 'without'} volume "
            f"term: grid {one.gain:.2f} times the list's speed, {one.list_us:.0f} and "
            f"{one.grid_us:.0f} us a step ({one.grid_ns:.2f} ns per spring), "
            f"{one.list_real_time:.2f} and {one.real_time:.2f} times real time "
            f"(median {one.real_time_median:.2f})\n"
        )
    sys.stdout.flush()


def latency(case: field_error.Case) -> dict[str, Timing]:
    """Time [s] of one step of the liver: in calls of as many as a run takes, and by itself."""
    one = liver(case, field_error.lattice(case, LATENCY_SPACING), 0.45)
    net, dt = arrays(one.assembly, one.material), FRACTION * one.critical
    counts = {"in a run": LOOK, "by itself": 1}
    tasks = {
        name: stepping(one.material.law, net, dt, count, one.assembly.lattice)
        for name, count in counts.items()
    }
    found = in_turns(tasks, 100)
    return {name: found[name] / count for name, count in counts.items()}


def row(nu: float, spacing: float, one: Liver, step: Timing, error: float) -> Row:
    """The line of one lattice from the time [s] of its step."""
    dt, springs = FRACTION * one.critical, len(one.assembly.springs.weight)
    wall = step / dt
    return Row(
        nu,
        spacing,
        len(one.assembly.mass),
        springs,
        one.critical,
        dt,
        1e6 * step.least,
        1e9 * step.least / springs,
        *wall,
        1.0 / wall.least,
        1.0 / wall.median,
        error,
    )


def static_errors(
    case: field_error.Case, lattices: list[Assembly]
) -> dict[tuple[float, float], float]:
    """Relative L2 errors at rest, of every Poisson ratio and spacing."""
    errors = {}
    for nu in RATIOS:
        truth, points, volumes = field_error.reference(case, nu)
        for a in lattices:
            one = field_error.row(case, nu, a, truth, points, volumes, with_volume=True)
            errors[nu, a.lattice.spacing] = one.error
    return errors


def read() -> list[Row]:
    """Rows of the table as written."""
    with TABLE.open(newline="") as file:
        return [
            Row(
                float(line.pop("nu")),
                float(line.pop("spacing_m")),
                int(line.pop("nodes")),
                int(line.pop("springs")),
                *map(float, line.values()),
            )
            for line in csv.DictReader(file)
        ]


def write(rows: list[Row]) -> None:
    """Write the table."""
    with TABLE.open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(Row._fields)
        for line in rows:
            table.writerow(f"{v:.6g}" if isinstance(v, float) else v for v in line)


def report(title: str, found: dict[str, Timing]) -> None:
    """Print times per spring [ns]."""
    sys.stdout.write(f"{title} [ns per spring: least, median]\n")
    for name, timing in found.items():
        sys.stdout.write(f"  {name:24} {1e9 * timing.least:7.2f} {1e9 * timing.median:7.2f}\n")
    sys.stdout.flush()


def main() -> None:
    """Print the figures and write the table."""
    report("Spring forces alone", against_c())
    report("Step with the volume term", flatness())
    for size in SIZES[1:]:
        report(f"Node orders, {size} nodes", node_orders(size))
    sys.stdout.write(f"Memory of 1e6 nodes: {peak_memory(1_000_000) / 2**30:.2f} GiB\n")
    case = field_error.liver()
    report_gains(gains(case))
    for name, step in latency(case).items():
        sys.stdout.write(f"One step of 2400 nodes, {name}: {1e6 * step.least:.0f} us\n")
    write(real_time(case))


if __name__ == "__main__":
    main()
