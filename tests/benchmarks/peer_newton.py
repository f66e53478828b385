"""The block in Newton on Warp: its springs by two solvers, its tetrahedra by two.

Steps are launched as its examples launch them where they can, captured once as a graph of many.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from msm.calibration import lame
from tests.benchmarks.contender import Block, Contender

Floats = NDArray[np.float64]

FRAME = 1.0 / 60.0
EXAMPLE = FRAME / 10.0
"""Step [s] of Newton's own soft body and cloth under VBD and XPBD, with 10 iterations each."""
SMALL = FRAME / 20.0
"""Step [s] of one iteration: Macklin et al., Small steps in physics simulation, 2019.

Shorter ones lose their increments in single precision: with a hundred steps a frame the field is a
third off.
"""
CAPTURED = 20
"""Steps of a graph, even for the two states that take turns."""
COMMON = "made for GPUs and for contact, here one thread of a CPU and neither"
SPRINGS = f"{COMMON}; the springs of another's lattice are not its way to a solid"
LINEAR = f"{COMMON}; linear tetrahedra lock at this Poisson ratio in any code"


def contenders(springs: Block, solid: Block) -> Iterator[Contender]:
    """Springs at Poisson ratio 1/4, tetrahedra at that of the solid."""
    yield explicit(springs, of_springs(springs), "springs", SPRINGS)
    for step, iterations, whose in (
        (EXAMPLE, 10, "step and iterations of Newton's example cloth_hanging"),
        (SMALL, 1, "small steps after Macklin et al. 2019, 20 a frame"),
    ):
        yield made(
            springs,
            of_springs(springs),
            ("SolverXPBD", f"springs, {iterations} a step", {"iterations": iterations}),
            f"the same springs; {whose}; damping explicit",
            f"{SPRINGS}; XPBD trades accuracy for stability, so that a step is not its measure",
            step,
        )
    yield explicit(solid, of_tetrahedra(solid, 4 / 3, 5 / 6), "tetrahedra", LINEAR)
    yield made(
        solid,
        of_tetrahedra(solid, 1.0, 0.0),
        ("SolverVBD", "tetrahedra", {"iterations": 10, "particle_enable_tile_solve": False}),
        "5 neo-Hookean tetrahedra a cell; step and iterations of its example softbody_hanging; "
        "damping explicit",
        f"{LINEAR}; a visual method: more iterations would come nearer to its equations",
        EXAMPLE,
    )


def explicit(body: Block, model: Any, kind: str, objection: str) -> Contender:
    """Semi-implicit Euler at a share of the longest stable step."""
    what = "the same springs" if kind == "springs" else "5 neo-Hookean tetrahedra a cell"
    return made(
        body,
        model,
        ("SolverSemiImplicit", kind, {"enable_tri_contact": False}),
        f"{what}; damping explicit",
        objection,
    )._replace(guess=body.limit)


def engine() -> tuple[Any, Any]:
    """Newton, and an empty model without gravity."""
    import warp as wp

    wp.config.quiet = True  # before Newton is imported
    import newton

    return newton, newton.ModelBuilder(gravity=(0.0, 0.0, 0.0))


def masses(body: Block) -> list[float]:
    """Of the lattice's nodes; a mass of 0 holds one."""
    return np.where(body.held, 0.0, body.net.mass).tolist()


def without_contact(builder: Any) -> Any:
    """The model, whose particles are not looked for among each other: nothing touches here."""
    model = builder.finalize(device="cpu")
    model.particle_grid = None
    return model


def of_springs(body: Block) -> Any:
    """The springs and nodes of the lattice."""
    _, builder = engine()
    net, nodes, mass = body.net, body.lattice.nodes, masses(body)
    still, points = np.zeros_like(nodes).tolist(), [0.0] * len(mass)  # no size, so no contact
    builder.add_particles(nodes.tolist(), still, mass, radius=points)
    stiffness = body.law.k * net.scale / net.length
    for (i, j), k in zip(net.ends.tolist(), stiffness.tolist(), strict=True):
        builder.add_spring(i, j, k, 0.0, 0.0)
    return without_contact(builder)


def of_tetrahedra(body: Block, to_mu: float, to_lambda: float) -> Any:
    """Newton's grid of tetrahedra on the lattice's nodes, with their masses.

    Its two solvers read k_mu and k_lambda differently: for small strains the stable neo-Hookean law
    of Smith et al. 2018 has Lame's constants mu and lambda if k_mu is `to_mu` mu and k_lambda is
    lambda + `to_lambda` mu.
    """
    import warp as wp

    _, builder = engine()
    nodes, h = body.lattice.nodes, body.lattice.spacing
    cells = np.ptp(body.lattice.index, axis=0) + 1
    first, mu = lame(body.modulus, body.nu)
    builder.add_soft_grid(
        pos=wp.vec3(*nodes.min(axis=0)),
        rot=wp.quat_identity(),
        vel=wp.vec3(0.0, 0.0, 0.0),
        **{f"dim_{axis}": int(count) for axis, count in zip("xyz", cells, strict=True)},
        **{f"cell_{axis}": h for axis in "xyz"},
        density=0.0,
        k_mu=to_mu * mu,
        k_lambda=first + to_lambda * mu,
        k_damp=0.0,
        particle_radius=0.0,
        add_surface_mesh_edges=False,
    )
    _, order = KDTree(nodes).query(np.array(builder.particle_q))
    builder.particle_mass[:] = np.array(masses(body))[order].tolist()
    builder.color()
    return without_contact(builder)


def made(
    body: Block,
    model: Any,
    solver: tuple[str, str, dict[str, Any]],
    settings: str,
    objection: str,
    step: float = 0.0,
) -> Contender:
    """A model in one of Newton's solvers: its name, what it solves, and its options."""
    newton, _ = engine()
    import warp as wp

    kind, what, options = solver
    stepper = getattr(newton.solvers, kind)(model, **options)
    name = f"Newton {kind.removeprefix('Solver')}, {what}"
    label = (name, f"{version('newton')}, Warp {wp.__version__}")
    run = runner(body, model, stepper)
    return Contender(*label, "float32", body.nu, run, f"{settings}; captured", objection, step)


def runner(body: Block, model: Any, stepper: Any) -> Callable[[float, int], Floats]:
    """What takes steps of a solver from rest."""
    import warp as wp

    @wp.kernel
    def push(
        load: wp.array[wp.vec3], c: wp.array[float], v: wp.array[wp.vec3], f: wp.array[wp.vec3]
    ) -> None:
        i = wp.tid()
        f[i] = load[i] - c[i] * v[i]

    states, control = (model.state(), model.state()), model.control()
    at_rest = states[0].particle_q.numpy().copy()
    _, order = KDTree(at_rest).query(body.lattice.nodes)  # of the lattice's nodes in the model
    node = np.argsort(order)
    damping = np.where(body.held, 0.0, body.net.gamma_0)[node]
    load = wp.array(body.net.load[node], dtype=wp.vec3, device="cpu")
    c = wp.array(damping, dtype=float, device="cpu")
    graphs: dict[float, Any] = {}

    def steps(dt: float, count: int) -> None:
        for i in range(count):
            now, then = states if i % 2 == 0 else states[::-1]
            wp.launch(push, len(c), [load, c, now.particle_qd], [now.particle_f], device="cpu")
            stepper.step(now, then, control, None, dt)

    def captured(dt: float) -> Any:
        if dt not in graphs:
            steps(dt, 2)  # compiles, and allocates what a graph may not
            with wp.ScopedCapture(device="cpu") as capture:
                steps(dt, CAPTURED)
            graphs[dt] = capture.graph
        return graphs[dt]

    def run(dt: float, count: int) -> Floats:
        graph = captured(dt)
        for state in states:
            state.particle_q.assign(at_rest)
            state.particle_qd.zero_()
        for _ in range(count // CAPTURED):
            wp.capture_launch(graph)
        steps(dt, count % CAPTURED)
        found = states[count % CAPTURED % 2].particle_q.numpy() - at_rest
        return np.asarray(found[order], dtype=np.float64)

    return run
