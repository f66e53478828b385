"""The lattice beside two engines of others: Newton on Warp (CPU) and MuJoCo's flex.

    python -m tests.benchmarks.bench_peers

writes reports/data/peers.csv, a row per lattice spacing and contender; it takes about ten minutes
and wants `pip install newton mujoco` (what is not installed is left out, with a line saying so).

All contenders hold the same block by its base, push it by the same nodal forces, and damp it to
ground alike; nodes and nodal masses are the same. Newton gets the very springs of the lattice,
MuJoCo tetrahedra or hexahedra of the same E and nu on the same nodes. Times are of the same stretch
of motion from rest, in turns; errors are of the displacement after SETTLED seconds, against finite
elements.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Callable, Iterator
from functools import partial
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial import KDTree

from msm.damping import NodalDamping
from msm.explicit import symplectic_euler
from msm.integrators import INTEGRATORS
from msm.lattice import CellLattice, interpolation
from msm.laws import Hooke
from msm.network import Network, network
from msm.stability import DEFAULT, largest_frequency, longest_step
from msm.volume import none
from study.similarity.fields import relative_l2
from tests.benchmarks import field_error
from tests.benchmarks.bench_lattice import in_turns
from tests.benchmarks.converged import Converged

Floats = NDArray[np.float64]
Truth = tuple[Converged, Floats, Floats]
"""Finite elements at points [m] (q, 3) of volumes [m^3] (q,)."""

TABLE = Path(__file__).parents[2] / "reports" / "data" / "peers.csv"
SPACINGS = (0.04 / 3, 0.01, 0.02 / 3)
LOAD = 0.02
"""Share of the load of `field_error`: the lattice departs from its linear self by 0.2 %."""
DAMPING = 40.0
"""Nodal damping over mass [1/s], a little below twice the lowest frequency of the block."""
SETTLED = 1.0
"""Time [s] after which the lattice is within 1e-8 of its state at rest, relative to it."""
TIMED = 0.1
"""Time [s] from rest over which the contenders are timed."""
TURNS = 7
TURN = 0.1
"""Shortest turn [s] of a contender."""
FRACTION = 0.8
"""Of the longest stable step."""
RECOMMENDED = 0.004
"""Longest step [s] that MuJoCo's manual calls typical of its integrator `discrete`."""
TRIAL_STEPS = 300
HALVINGS = 6
IMMOVABLE = 1e30
"""Mass [kg] of held nodes: no force here moves it by as much as a rounding error."""


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
    note: str


class Contender(NamedTuple):
    """An engine with the block in it; the first four fields are those of its row.

    `run(dt, count)` takes steps of dt [s] from rest under the full load, and returns the
    displacement [m] (n, 3) of the lattice's nodes. `step` [s] is the step to take; 0 until
    `with_step` has found it from `guess`, a first guess [s] of the longest stable one.
    """

    engine: str
    version: str
    precision: str
    nu: float
    run: Callable[[float, int], Floats]
    note: str
    step: float = 0.0
    guess: float = 0.0


class Block(NamedTuple):
    """The block on one lattice: the arrays of the springs, and which nodes are held (n,)."""

    nu: float
    modulus: float
    lattice: CellLattice
    law: Hooke
    net: Network
    held: NDArray[np.bool_]

    @property
    def limit(self) -> float:
        """Longest stable step [s] of the lattice, as the engine predicts it."""
        omega, _ = largest_frequency(self.law, self.net, np.zeros_like(self.net.load))
        return longest_step(INTEGRATORS[DEFAULT], omega, 0.0)


def block(case: field_error.Case, spacing: float, nu: float, *, with_volume: bool) -> Block:
    """The block with its base held fast instead of by stiff springs, which would set the step."""
    found = field_error.lattice(case, spacing)
    material = field_error.material(case, found, nu, with_volume=with_volume)
    held = found.lattice.nodes[:, 2] < found.lattice.nodes[:, 2].min() + 0.5 * spacing
    mass = np.where(held, IMMOVABLE, found.mass)
    free = csr_array((len(held), len(held)))
    term = material.volume or none(spacing)
    net = network(found.springs, mass, free, LOAD * found.load, term, NodalDamping(DAMPING))
    return Block(nu, case.youngs_modulus, found.lattice, material.law, net, held)  # type: ignore[arg-type]


def lattice(body: Block) -> Contender:
    """The lattice under symplectic Euler."""
    limit = body.limit

    def run(dt: float, count: int) -> Floats:
        u, v = np.zeros((2, *body.net.load.shape))
        symplectic_euler(body.law, body.net, np.ones((count, 1)), dt, u, v)
        return u

    kind = "springs and volume term" if len(body.net.cells) else "springs"
    label = (f"lattice, {kind}", version("liver-study"), "float64", body.nu)
    note = f"{len(body.net.ends)} springs; damping implicit; limit {1e3 * limit:.3g} ms predicted"
    return Contender(*label, run, note, FRACTION * limit)


def newton_model(body: Block) -> Any:
    """The springs and nodes of the lattice as Newton's particles; a mass of 0 holds a node."""
    import newton

    net, nodes = body.net, body.lattice.nodes
    builder = newton.ModelBuilder(gravity=(0.0, 0.0, 0.0))
    mass = np.where(body.held, 0.0, net.mass)
    still, points = np.zeros_like(nodes).tolist(), [0.0] * len(mass)  # no size, so no contact
    builder.add_particles(nodes.tolist(), still, mass.tolist(), radius=points)
    stiffness = body.law.k * net.scale / net.length
    for (i, j), k in zip(net.ends.tolist(), stiffness.tolist(), strict=True):
        builder.add_spring(i, j, k, 0.0, 0.0)
    return builder.finalize(device="cpu")


def newton(body: Block, solver: str, **options: Any) -> Contender:
    """The same springs in one of Newton's solvers."""
    import warp as wp

    wp.config.quiet = True  # before Newton is imported
    import newton as engine

    @wp.kernel
    def push(
        load: wp.array[wp.vec3], c: wp.array[float], v: wp.array[wp.vec3], f: wp.array[wp.vec3]
    ) -> None:
        i = wp.tid()
        f[i] = load[i] - c[i] * v[i]

    model = newton_model(body)
    stepper = getattr(engine.solvers, solver)(model, **options)
    states, control = [model.state(), model.state()], model.control()
    load = wp.array(body.net.load, dtype=wp.vec3, device="cpu")
    c = wp.array(np.where(body.held, 0.0, body.net.gamma_0), dtype=float, device="cpu")
    at_rest = states[0].particle_q.numpy().copy()

    def run(dt: float, count: int) -> Floats:
        for state in states:
            state.particle_q.assign(at_rest)
            state.particle_qd.zero_()
        for _ in range(count):
            now, then = states
            wp.launch(push, len(c), [load, c, now.particle_qd], [now.particle_f], device="cpu")
            stepper.step(now, then, control, None, dt)
            states.reverse()
        return states[0].particle_q.numpy().astype(np.float64) - at_rest

    name, numbers = solver.removeprefix("Solver"), f"{version('newton')}, Warp {wp.__version__}"
    note = "; ".join(["the same springs", *(f"{k} {v}" for k, v in options.items())])
    return Contender(
        *(f"Newton {name}", numbers, "float32", body.nu),
        run,
        note=f"{note}; damping explicit",
        guess=body.limit,
    )


FLEX = """
<mujoco>
  <option gravity="0 0 0" integrator="{integrator}" solver="CG" tolerance="1e-6">
    <flag autoreset="disable"/>
  </option>
  <size memory="2G"/>
  <worldbody>
    <flexcomp name="block" type="grid" dim="3" count="{nodes}" spacing="{h} {h} {h}"
              radius="{radius}" dof="{dof}" {cells}>
      <contact selfcollide="none" contype="0" conaffinity="0"/>
      <edge equality="false"/>
      <elasticity young="{young}" poisson="{nu}"/>
      <pin gridrange="0 0 0 {x} {y} 0"/>
    </flexcomp>
  </worldbody>
</mujoco>
"""


def flex_model(body: Block, integrator: str, dof: str) -> Any:
    """The block as a grid of MuJoCo's flex: tetrahedra, or hexahedra if `dof` is trilinear."""
    import mujoco

    h = body.lattice.spacing
    cells = np.ptp(body.lattice.index, axis=0) + 1
    text = FLEX.format(
        **{"integrator": integrator, "dof": dof, "young": body.modulus, "nu": body.nu, "h": h},
        **{"radius": 0.01 * h, "x": cells[0], "y": cells[1]},
        nodes="{} {} {}".format(*(cells + 1)),
        cells='cellcount="{} {} {}"'.format(*cells) if dof == "trilinear" else "",
    )
    mujoco.set_mju_user_warning(lambda _: None)  # divergence is looked for below
    return mujoco.MjModel.from_xml_string(text)


def free_nodes(body: Block, model: Any, data: Any) -> NDArray[np.int64]:
    """The lattice's node of each of MuJoCo's bodies but the world, by its place."""
    import mujoco

    mujoco.mj_forward(model, data)
    nodes = body.lattice.nodes
    centre = 0.5 * (nodes.min(axis=0) + nodes.max(axis=0))
    away, node = KDTree(nodes - centre).query(data.xpos[1:])
    if away.max() > 1e-6 * body.lattice.spacing or len(node) != (~body.held).sum():
        raise ValueError("MuJoCo's grid is not the lattice; its layout has changed")
    return np.asarray(node)


def flex(body: Block, integrator: str, dof: str, step: float = 0.0) -> Contender:
    """MuJoCo's elastic solid of the same E and nu on the lattice's nodes, with its masses."""
    import mujoco

    model = flex_model(body, integrator, dof)
    data = mujoco.MjData(model)
    node = free_nodes(body, model, data)
    model.body_mass[1:] = body.net.mass[node]
    model.dof_damping[:] = np.repeat(body.net.gamma_0[node], 3)
    mujoco.mj_setConst(model, data)

    def run(dt: float, count: int) -> Floats:
        mujoco.mj_resetData(model, data)
        data.qfrc_applied[:] = body.net.load[node].ravel()
        model.opt.timestep = dt
        mujoco.mj_step(model, data, nstep=count)
        u = np.zeros_like(body.net.load)
        u[node] = data.qpos.reshape(-1, 3)
        return u

    elements = "linear tetrahedra" if dof == "full" else "trilinear hexahedra"
    label = (f"MuJoCo flex {dof}, {integrator}", mujoco.__version__, "float64", body.nu)
    note = f"Saint Venant-Kirchhoff, {elements}; damping implicit"
    return Contender(*label, run, note, step, body.limit)


def contenders(case: field_error.Case, spacing: float) -> Iterator[Contender]:
    """All that are installed, the lattices first."""
    springs = block(case, spacing, 0.25, with_volume=False)
    solid = block(case, spacing, 0.45, with_volume=True)
    yield lattice(springs)
    yield lattice(solid)
    if find_spec("newton"):
        yield newton(springs, "SolverSemiImplicit")
        yield newton(springs, "SolverXPBD", iterations=2)
    if find_spec("mujoco"):
        yield flex(springs, "Euler", "full")
        yield flex(solid, "Euler", "full")
        yield flex(solid, "discrete", "full", RECOMMENDED)
        yield flex(solid, "Euler", "trilinear")
        yield flex(solid, "discrete", "trilinear", RECOMMENDED)


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
    """The contender with the step that it takes; its note says why, if it was searched for."""
    if one.step:
        return one
    limit = stable_step(one, far)
    note = f"{one.note}; limit {1e3 * limit:.3g} ms by bisection"
    return one._replace(step=FRACTION * limit, note=note)


def steps_in(one: Contender, seconds: float) -> int:
    """Steps that last about that long."""
    return round(seconds / one.step)


def step_times(found: list[Contender]) -> list[float]:
    """Least wall time [s] of a step of each, in turns.

    Fast contenders repeat their stretch until a turn is as long for them as for others: the least
    of short ones would be less disturbed.
    """
    stretch = [partial(one.run, one.step, steps_in(one, TIMED)) for one in found]
    once = in_turns({str(i): task for i, task in enumerate(stretch)}, 2)
    repeats = [1 + int(TURN / timing.least) for timing in once.values()]
    turns = {
        str(i): partial(lambda task, n: [task() for _ in range(n)], stretch[i], n)
        for i, n in enumerate(repeats)
    }
    counts = [n * steps_in(one, TIMED) for n, one in zip(repeats, found, strict=True)]
    times = in_turns(turns, TURNS).values()
    return [timing.least / n for timing, n in zip(times, counts, strict=True)]


def measured(case: field_error.Case, spacing: float, truths: dict[float, Truth]) -> Iterator[Row]:
    """All contenders on one lattice."""
    found = [with_step(one, 0.5 * spacing) for one in contenders(case, spacing)]
    weights = interpolation(field_error.lattice(case, spacing).lattice, truths[0.25][1])[0]
    fields = [weights @ one.run(one.step, steps_in(one, SETTLED)) / LOAD for one in found]
    seconds = step_times(found)
    for one, field, time in zip(found, fields, seconds, strict=True):
        ours = next(i for i, other in enumerate(found) if other.nu == one.nu)  # it comes first
        wall, our_wall = time / one.step, seconds[ours] / found[ours].step
        reference, _, volumes = truths[one.nu]
        yield Row(
            *("block", weights.shape[1], *one[:4]),
            *(one.step, 1e6 * time, wall, wall / our_wall),
            relative_l2(field, reference.field, volumes),
            reference.error,
            relative_l2(field, fields[ours], volumes),
            one.note,
        )


def main() -> None:
    """Write the table."""
    for name in ("newton", "mujoco"):
        if not find_spec(name):
            sys.stdout.write(f"{name} is not installed and is left out: pip install {name}\n")
    case = field_error.block()
    truths = {nu: field_error.reference(case, nu) for nu in (0.25, 0.45)}
    with TABLE.open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(Row._fields)
        for spacing in SPACINGS:
            for line in measured(case, spacing, truths):
                table.writerow(f"{v:.4g}" if isinstance(v, float) else v for v in line)
                file.flush()


if __name__ == "__main__":
    main()
