"""What own steps for each size of cells would gain a graded lattice.

    python -m tests.benchmarks.multirate

writes reports/data/multirate.csv: graded lattices on the built-in liver, each size stepped at every
so many of the finest steps. Springs and cells of a size push at the start of a step of their own,
so many times as hard (impulses, Tuckerman, Berne and Martyna 1992, J. Chem. Phys. 97:1990), which
is symplectic and conserves momentum. How long steps may then be is found by trial, linear and
without damping; what they cost by the kernels of a run, each size by itself, and with what passes
between sizes at every finest step or, as a bound, for nothing.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, eye_array, kron

from msm.assembly import Assembly, Material, arrays
from msm.grid import Grids, grids_of
from msm.grid_explicit import symplectic_euler
from msm.laws import initial_stiffness
from msm.springs import Springs, stiffness_matrix
from msm.stability import critical_time_step
from msm.ties import hanging_nodes
from msm.volume import VolumeTerm
from msm.volume import stiffness_matrix as volume_stiffness
from study.models.lattice import PreparedLattice
from study.scene.problem import problem_of
from tests.benchmarks.corrected_places import TABLE as OTHERS
from tests.benchmarks.corrected_runs import scene
from tests.benchmarks.graded_places import FINEST, lattice
from tests.benchmarks.tables import write

Floats = NDArray[np.float64]

TABLE = OTHERS.with_name("multirate.csv")
RADII = (0.015, 0.025)
RATES = ((1, 1, 1), (1, 2, 2), (1, 2, 4))
CYCLES, GROWN = 1000, 1e3
NARROW = 0.02
"""How near to the longest step the trials come, as a share of it."""
STEPS, TURNS = 20, 15


class Row(NamedTuple):
    """A lattice whose finest cells reach `radius_m`, at `rates`.

    `limit`: the longest finest step over that at one rate, as far as so few steps tell; `step_us`:
    processor time of one; `gain` of a simulated second, `bound` if what passes between sizes, and
    the support, cost nothing.
    """

    radius_m: float
    rates: str
    limit: float
    step_us: float
    gain: float
    bound: float


def rows(radius: float) -> Iterator[Row]:
    """All rates of one lattice."""
    given = scene()
    cells = lattice(given, "region", spacing=FINEST, radius=radius, flexion=0.0)
    one = cells.prepare(problem_of(given))
    parts, mass = by_size(one)
    step = critical_time_step(one.assembly, one.springs.material)
    whole, sizes = costs(one)
    for rates in RATES:
        limit = longest(parts, mass, step, rates) / step
        free = sum(c / r for c, r in zip(sizes, rates, strict=True))
        cost = free + whole - sum(sizes)
        words = "-".join(map(str, rates))
        yield Row(radius, words, limit, 1e6 * cost, limit * whole / cost, limit * whole / free)


def by_size(one: PreparedLattice) -> tuple[list[csr_array], Floats]:
    """Stiffness [N/m] of the cells of each size on what does not hang, and its mass [kg].

    The support is of the largest cells, which hold most of it.
    """
    assembly, material = one.assembly, one.springs.material
    masters = assembly.masters
    assert masters is not None
    free = ~hanging_nodes(masters)
    spread = csr_array(kron(csr_array(masters[:, free]), eye_array(3)))
    support = kron(assembly.foundation, eye_array(3))
    found = [_of_size(assembly, material, n) for n in range(len(RATES[0]))]
    found[-1] = found[-1] + support
    return [csr_array(spread.T @ part @ spread) for part in found], np.repeat(
        assembly.mass[free], 3
    )


def _of_size(assembly: Assembly, material: Material, n: int) -> csr_array:
    """Stiffness [N/m] (3 n, 3 n) of the springs and cells of a size."""
    springs, term, count = assembly.springs, material.volume, len(assembly.mass)
    assert term is not None
    edge = assembly.lattice.spacing * 2**n
    steps = np.abs(springs.rest).max(axis=1) / edge
    chosen = np.abs(steps - 1.0) < 1e-6
    picked = Springs(springs.ends[chosen], springs.rest[chosen], springs.weight[chosen])
    cells = np.abs(term.edges / edge - 1.0) < 1e-6
    own = VolumeTerm(
        term.cells[cells], term.bulk[cells], term.edges[cells], edge, term.poisson_ratio
    )
    k = initial_stiffness(material.law)
    return csr_array(stiffness_matrix(picked, count, k) + volume_stiffness(own, count))


def longest(parts: list[csr_array], mass: Floats, step: float, rates: tuple[int, ...]) -> float:
    """The longest stable finest step [s], by halving between a safe one and that at one rate."""
    safe, unsafe = 0.0, 1.05 * step
    while unsafe - safe > NARROW * step:
        middle = 0.5 * (safe + unsafe)
        if grows(parts, mass, middle, rates):
            unsafe = middle
        else:
            safe = middle
    return safe


def grows(parts: list[csr_array], mass: Floats, step: float, rates: tuple[int, ...]) -> bool:
    """Whether a motion without damping grows beyond bounds."""
    v = np.random.default_rng(0).standard_normal(len(mass))
    u = np.zeros_like(v)
    most = GROWN * np.abs(v).max() * step
    for _ in range(CYCLES // max(rates)):
        for n in range(max(rates)):
            for part, rate in zip(parts, rates, strict=True):
                if n % rate == 0:
                    v -= (rate * step) * (part @ u) / mass
            u += step * v
        if not np.abs(u).max() < most:
            return True
    return False


def costs(one: PreparedLattice) -> tuple[float, list[float]]:
    """Processor time [s] of a step, and of the cells of each size by themselves."""
    net = arrays(one.assembly, one.springs.material)
    whole = grids_of(one.assembly.lattice, net)
    assert whole is not None
    alone = [whole._replace(grids=(grid,), joints=None) for grid in whole.grids]
    law, u = one.springs.material.law, np.zeros_like(net.load)

    def taken(grids: Grids) -> float:
        started = time.process_time()
        symplectic_euler(law, grids, np.ones((STEPS, 1)), 1e-5, u, np.zeros_like(u))
        return (time.process_time() - started) / STEPS

    every = (whole, *alone)
    for grids in every:
        taken(grids)
    found = np.min([[taken(grids) for grids in every] for _ in range(TURNS)], axis=0)
    return float(found[0]), found[1:].tolist()


def main() -> None:
    """Write the table and print it."""
    found = [one for radius in RADII for one in rows(radius)]
    for one in write(TABLE, found):
        sys.stdout.write(f"{one}\n")


if __name__ == "__main__":
    main()
