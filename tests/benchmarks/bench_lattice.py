"""Speed of a step of the lattice: over grid and list, against C, and against real time.

    python -m tests.benchmarks.bench_lattice

prints the figures and writes reports/data/lattice_kernels.csv and reports/data/real_time.csv; it
takes three minutes, and a C compiler for the rows in C. What is compared is measured in turns, in
one process; the least of several repeats, which others on the machine disturb least, stands beside
their median and the load of the machine. Times are those for which the one thread had a processor;
on a core of its own the clock on the wall shows the same. `bench_order` measures how a step grows
with the lattice.

The C is no transliteration of ours but the best formulation that we know (grid.c), compiled for the
same number of lanes. All kernels take the same steps to the same state, or no row is written.

A step on two threads, each with its half of the nodes, was tried over the list of springs and left
out. It starts threads three times a step, each 7 us with OpenMP and 50 us with numba's own queue,
of 150 us at 2500 nodes, and of 56 us over the grid; with another process on the second core a step
took 1.2 to 1.3 times as long as on one thread. An idle second core was not to be had. It is put to
better use by another run.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from msm.assembly import Assembly, Material, arrays
from msm.calibration import reference_stiffness
from msm.damping import NodalDamping
from msm.explicit import symplectic_euler
from msm.grid import grids_of
from msm.grid_explicit import symplectic_euler as symplectic_euler_on_grid
from msm.lattice import CORNERS, CellLattice, node_volumes
from msm.laws import Hooke, Law
from msm.network import Network, network
from msm.simd import widest
from msm.springs import connect
from msm.stability import critical_time_step
from msm.timestep import LOOK
from msm.volume import volume_term
from study.models.damping import nodal_damping
from study.scene.file import read_scene
from tests.benchmarks import field_error, grid_in_c, tables
from tests.benchmarks.machine import load, machine

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

TABLE = Path(__file__).parents[2] / "reports" / "data" / "real_time.csv"
KERNELS = TABLE.with_name("lattice_kernels.csv")
DIGITS = 6
RATIOS = (0.45, 0.49)
SPACINGS = (0.012, 0.010, 0.008, 0.02 / 3, 0.005)
KERNEL_SPACINGS = (0.010, 0.02 / 3, 0.005)
WIDTHS = tuple(lanes for lanes in (4, 8) if lanes <= widest())
"""Lanes for which both numba and C compile here."""
FRACTION = 0.8
"""Of the critical step, as the study takes it."""
MODULUS, DENSITY, SPACING = 9.5e3, 1054.0, 0.01
LAW = Hooke(reference_stiffness(MODULUS, SPACING, 0.45))
REPEATS = 9
COMPARED_STEPS = 400
SAME = 1e-12
"""Relative L2 difference of displacements after those steps: sums in another order."""


class Row(NamedTuple):
    """The built-in liver at one Poisson ratio and spacing.

    `wall_per_second`: of one simulated second at `step_s` on a core of its own, least and median;
    `error`: relative L2 of the displacement at rest, NaN where it was not computed. `load`: see
    `machine.load`.
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
    machine: str
    load: float


class Kernel(NamedTuple):
    """Steps of the built-in liver at nu = 0.45 by one kernel of so many lanes.

    `step_us`: least time of a step, and median; `times_list`: speed over that of the list of
    springs; `over_c`: time over that of C with as many lanes, NaN where there is none (both of the
    least times); `real_time`: simulated over wall time; `apart`: relative L2 difference of the
    displacement from the list's after COMPARED_STEPS from rest.
    """

    spacing_m: float
    volume_term: bool
    nodes: int
    springs: int
    kernel: str
    lanes: int
    step_us: float
    step_us_median: float
    ns_per_spring: float
    times_list: float
    over_c: float
    real_time: float
    real_time_median: float
    apart: float
    machine: str
    load: float


class Timing(NamedTuple):
    """Least and median time [s]."""

    least: float
    median: float

    def __truediv__(self, count: float) -> Timing:
        """Time of one of `count`."""
        return Timing(self.least / count, self.median / count)


def in_turns(
    tasks: dict[str, Callable[[], object]],
    repeats: int = REPEATS,
    clock: Callable[[], float] = time.perf_counter,
) -> dict[str, Timing]:
    """Least and median times of tasks that take turns, after one round that compiles them."""
    taken: dict[str, list[float]] = {name: [] for name in tasks}
    for _ in range(repeats + 1):
        for name, task in tasks.items():
            started = clock()
            task()
            taken[name].append(clock() - started)
    return {name: Timing(min(t[1:]), float(np.median(t[1:]))) for name, t in taken.items()}


def cube(nodes: int) -> CellLattice:
    """A full lattice of about that many nodes."""
    edge = round(nodes ** (1 / 3)) - 1
    index = np.argwhere(np.ones((edge,) * 3, dtype=bool))
    strides = np.array([(edge + 1) ** 2, edge + 1, 1])
    places = np.argwhere(np.ones((edge + 1,) * 3, dtype=bool))
    cells = (index[:, None, :] + CORNERS) @ strides
    fill = np.ones(len(index))
    return CellLattice(SPACING, np.zeros(3), SPACING * places, cells, index, fill, 0.0)


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
    grid = grids_of(lattice, net)
    return lambda: symplectic_euler_on_grid(law, grid, factors, dt, u, v)


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
    tasks = {
        str(key): stepping(
            one.material.law,
            arrays(one.assembly, one.material),
            FRACTION * one.critical,
            LOOK,  # after so many steps a run takes its nodes out of the grid
            one.assembly.lattice,
        )
        for key, one in livers.items()
    }
    found = in_turns(tasks, clock=time.thread_time)
    errors = static_errors(case, lattices)
    return [
        row(*key, one, found[str(key)] / LOOK, errors.get(key, float("nan")))
        for key, one in livers.items()
    ]


class Candidate(NamedTuple):
    """A kernel with a lattice in it.

    `advance(count)` takes steps under the full load, on and on, and `displacement()` is where they
    have led, [m] (n, 3).
    """

    kernel: str
    lanes: int
    advance: Callable[[int], None]
    displacement: Callable[[], Floats]


def on_list(law: Law, net: Network, dt: float) -> Candidate:
    """Over the list of springs."""
    u, v = np.zeros((2, *net.load.shape))

    def advance(count: int) -> None:
        symplectic_euler(law, net, np.ones((count, 1)), dt, u, v)

    return Candidate("list", 1, advance, lambda: u)


def on_grid(law: Law, net: Network, dt: float, lattice: CellLattice, lanes: int) -> Candidate:
    """Over the grid."""
    u, v = np.zeros((2, *net.load.shape))
    grid = grids_of(lattice, net, lanes)

    def advance(count: int) -> None:
        symplectic_euler_on_grid(law, grid, np.ones((count, 1)), dt, u, v)

    return Candidate("grid", lanes, advance, lambda: u)


def in_c(
    folder: Path, law: Hooke, net: Network, dt: float, lattice: CellLattice, lanes: int
) -> Candidate:
    """In C. Raises what `grid_in_c.compile_grid` does."""
    library = grid_in_c.compile_grid(folder, lanes, with_volume=len(net.cells) > 0)
    made = grid_in_c.stepper(library, lanes, lattice, net, law, dt)
    return Candidate("C", lanes, made.advance, lambda: made.motion()[0])


def candidates(
    folder: Path, law: Hooke, net: Network, dt: float, lattice: CellLattice
) -> Iterator[Candidate]:
    """List, grid and C of every width; without C where it cannot be compiled, which is said."""
    yield on_list(law, net, dt)
    for lanes in WIDTHS:
        yield on_grid(law, net, dt, lattice, lanes)
        try:
            yield in_c(folder, law, net, dt, lattice, lanes)
        except (FileNotFoundError, subprocess.CalledProcessError) as error:
            sys.stdout.write(f"C with {lanes} lanes is left out: {error}\n")


def kernels(case: field_error.Case, assembly: Assembly, *, with_volume: bool) -> list[Kernel]:
    """Every kernel on one lattice, in turns. ValueError if one leads to another state."""
    one = liver(case, assembly, 0.45)
    net, dt = arrays(one.assembly, one.material), FRACTION * one.critical
    if not with_volume:
        net = net._replace(cells=net.cells[:0], bulk=net.bulk[:0])
    with tempfile.TemporaryDirectory() as folder:
        found = list(candidates(Path(folder), one.material.law, net, dt, assembly.lattice))
        apart = differences(found)
        tasks = {str(i): partial(each.advance, LOOK) for i, each in enumerate(found)}
        times = [
            timing / LOOK for timing in in_turns(tasks, 2 * REPEATS, time.thread_time).values()
        ]
    c = {each.lanes: t.least for each, t in zip(found, times, strict=True) if each.kernel == "C"}
    return [
        Kernel(
            assembly.lattice.spacing,
            with_volume,
            len(net.mass),
            len(net.ends),
            each.kernel,
            each.lanes,
            1e6 * step.least,
            1e6 * step.median,
            1e9 * step.least / len(net.ends),
            times[0].least / step.least,
            step.least / c.get(each.lanes, float("nan")),
            dt / step.least,
            dt / step.median,
            difference,
            machine(),
            load(),
        )
        for each, step, difference in zip(found, times, apart, strict=True)
    ]


def differences(found: Sequence[Candidate]) -> list[float]:
    """Of each one's displacement from the first one's. ValueError if it is more than rounding."""
    for each in found:
        each.advance(COMPARED_STEPS)
    truth, *_ = fields = [each.displacement().copy() for each in found]
    apart = [float(np.linalg.norm(u - truth) / np.linalg.norm(truth)) for u in fields]
    for each, difference in zip(found, apart, strict=True):
        if not difference < SAME:
            raise ValueError(
                f"{each.kernel} with {each.lanes} lanes leads to another state: {difference:.1e}"
            )
    return apart


def all_kernels(case: field_error.Case) -> list[Kernel]:
    """The spacings that a study takes, with and without volume term."""
    lattices = [field_error.lattice(case, spacing) for spacing in KERNEL_SPACINGS]
    return [
        line
        for lattice in lattices
        for term in (True, False)
        for line in kernels(case, lattice, with_volume=term)
    ]


def report_kernels(found: list[Kernel]) -> None:
    """Print them, a line each."""
    for one in found:
        sys.stdout.write(
            f"{1e3 * one.spacing_m:4.1f} mm, {'with' if one.volume_term else 'without'} volume "
            f"term: {one.kernel:4} of {one.lanes} lanes {one.step_us:6.0f} us a step "
            f"({one.ns_per_spring:5.2f} ns per spring), {one.times_list:5.2f} times the list's "
            f"speed, {one.over_c:4.2f} times the time of C, {one.real_time:5.2f} times real time\n"
        )
    sys.stdout.flush()


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
        machine(),
        load(),
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
    """Rows of the table against real time as written."""
    return tables.read(TABLE, Row)


def read_kernels() -> list[Kernel]:
    """Rows of the table of kernels as written."""
    return tables.read(KERNELS, Kernel)


def main() -> None:
    """Print the figures and write the tables."""
    case = field_error.liver()
    found = all_kernels(case)
    report_kernels(found)
    tables.write(KERNELS, found, DIGITS)
    tables.write(TABLE, real_time(case), DIGITS)


if __name__ == "__main__":
    main()
