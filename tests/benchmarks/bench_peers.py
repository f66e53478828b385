"""The lattice beside two engines of others: Newton on Warp (CPU) and MuJoCo's flex.

    python -m tests.benchmarks.bench_peers

writes reports/data/peers.csv, a row per lattice spacing and contender; it takes three minutes and
wants `pip install newton mujoco` (what is not installed is left out, with a line saying so).

All contenders hold the same block by its base, push it by the same nodal forces, and damp it to
ground alike; nodes and nodal masses are the same. Newton gets the very springs of the lattice, and
the tissue's E and nu in its own tetrahedra; MuJoCo tetrahedra or hexahedra of E and nu. Explicit
steps are the same share of the longest stable one, others what the engine's authors take
themselves. Beside its settings each row says what its maintainer would object.

Times are of the same stretch of motion from rest, in turns, and are those for which the process had
processors, all its threads together; errors are of the displacement after SETTLED seconds, against
finite elements.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msm.lattice import interpolation
from study.similarity.fields import relative_l2
from tests.benchmarks import field_error, peer_mujoco, peer_newton
from tests.benchmarks.bench_lattice import in_turns
from tests.benchmarks.contender import FRACTION, LOAD, Contender, block, lattice
from tests.benchmarks.converged import Converged
from tests.benchmarks.machine import load, machine
from tests.benchmarks.tables import write

Floats = NDArray[np.float64]
ReferenceSolution = tuple[Converged, Floats, Floats]
"""Finite elements at points [m] (q, 3) of volumes [m^3] (q,)."""

TABLE = Path(__file__).parents[2] / "reports" / "data" / "peers.csv"
SPACINGS = (0.04 / 3, 0.01)
SETTLED = 1.0
"""Time [s] after which the lattice is within 1e-8 of its state at rest, relative to it."""
TIMED = 0.1
"""Time [s] from rest over which the contenders are timed."""
TURNS = 5
TURN = 0.05
"""Shortest turn [s] of a contender."""
TRIAL_STEPS = 300
HALVINGS = 6


class Row(NamedTuple):
    """One contender on one lattice; times are the least of several repeats.

    `nu`: of material and reference; `relative_to_ours`: wall time per simulated second over that of
    the lattice of this nu; `field_error`: relative L2 difference of the displacement at rest from
    finite elements, whose own error is `reference_error`; `from_ours`: the same from the lattice.
    """

    body: str
    nodes: int
    engine: str
    version: str
    precision: str
    nu: float
    step_s: float
    us_per_step: float
    wall_per_simulated_s: float
    relative_to_ours: float
    field_error: float
    reference_error: float
    from_ours: float
    settings: str
    objection: str
    machine: str
    load: float


def contenders(case: field_error.Case, spacing: float) -> Iterator[Contender]:
    """All that are installed, the lattices first."""
    springs = block(case, spacing, 0.25, with_volume=False)
    solid = block(case, spacing, 0.45, with_volume=True)
    yield lattice(springs)
    yield lattice(solid)
    if find_spec("newton"):
        yield from peer_newton.contenders(springs, solid)
    if find_spec("mujoco"):
        coarse = field_error.lattice(case, peer_mujoco.COARSE).lattice
        yield from peer_mujoco.contenders(springs, solid, coarse)


def survives(one: Contender, dt: float, far: float) -> bool:
    """Whether the block stays within `far` [m] over some steps of dt [s] from rest."""
    return bool(np.abs(one.run(dt, TRIAL_STEPS)).max() < far)  # false for NaN


def stable_step(one: Contender, far: float) -> float:
    """Longest stable step [s] by bisection about the guess, to 2 %."""
    low = high = one.guess
    while survives(one, high, far) and high < 16.0 * one.guess:
        low, high = high, 2.0 * high
    while not survives(one, low, far):
        low, high = 0.5 * low, low
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if survives(one, middle, far) else (low, middle)
    return low


def with_step(one: Contender, far: float) -> Contender:
    """The contender with the step that it takes; its settings say why, if it was searched for."""
    if one.step:
        return one
    limit = stable_step(one, far)
    settings = f"{one.settings}; limit {1e3 * limit:.3g} ms by bisection"
    return one._replace(step=FRACTION * limit, settings=settings)


def steps_in(one: Contender, seconds: float) -> int:
    """Steps that last about that long."""
    return round(seconds / one.step)


def step_times(found: list[Contender]) -> list[float]:
    """Least wall time [s] of a step of each, in turns.

    Fast contenders repeat their stretch until a turn is as long for them as for others: the least
    of short ones would be less disturbed.
    """
    stretch = [partial(one.run, one.step, steps_in(one, TIMED)) for one in found]
    once = in_turns({str(i): task for i, task in enumerate(stretch)}, 1)
    repeats = [1 + int(TURN / timing.least) for timing in once.values()]
    turns = {
        str(i): partial(lambda task, n: [task() for _ in range(n)], stretch[i], n)
        for i, n in enumerate(repeats)
    }
    counts = [n * steps_in(one, TIMED) for n, one in zip(repeats, found, strict=True)]
    times = in_turns(turns, TURNS, time.process_time).values()
    return [timing.least / n for timing, n in zip(times, counts, strict=True)]


def measured(
    case: field_error.Case, spacing: float, truths: dict[float, ReferenceSolution]
) -> Iterator[Row]:
    """All contenders on one lattice."""
    found = [with_step(one, 0.5 * spacing) for one in contenders(case, spacing)]
    weights = interpolation(field_error.lattice(case, spacing).lattice, truths[0.25][1])[0]
    fields = [weights @ one.run(one.step, steps_in(one, SETTLED)) / LOAD for one in found]
    seconds = step_times(found)
    for one, field, taken in zip(found, fields, seconds, strict=True):
        ours = next(i for i, other in enumerate(found) if other.nu == one.nu)  # it comes first
        wall, our_wall = taken / one.step, seconds[ours] / found[ours].step
        reference, _, volumes = truths[one.nu]
        yield Row(
            *("block", weights.shape[1], *one[:4]),
            *(one.step, 1e6 * taken, wall, wall / our_wall),
            relative_l2(field, reference.field, volumes),
            reference.error,
            relative_l2(field, fields[ours], volumes),
            one.settings,
            one.objection,
            machine(),
            load(),
        )


def main() -> None:
    """Write the table."""
    for name in ("newton", "mujoco"):
        if not find_spec(name):
            sys.stdout.write(f"{name} is not installed and is left out: pip install {name}\n")
    case = field_error.block()
    truths = {nu: field_error.reference(case, nu) for nu in (0.25, 0.45)}
    write(TABLE, (line for spacing in SPACINGS for line in measured(case, spacing, truths)))


if __name__ == "__main__":
    main()
