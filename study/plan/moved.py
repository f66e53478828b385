"""The plan of a scene with moved tools, gravity, weights or several loads: by three quick motions.

The discretisation error of a lattice is estimated from motions on three coarse ones, at the order
and with the safety factor of a run's own estimate. Errors of contact vary irregularly with the
position of the cells, so that two lattices may agree by chance, and the largest difference of any
two is taken. The error that springs have at any spacing is not estimated. Where corrected lattices
support the scene, as under tools that travel, their error is estimated from the nonlinear parts of
two of these motions, and from finite elements on two meshes at rest.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from fem_reference.error_estimate import ASSUMED_ORDER
from fem_reference.observation import at_points, evaluation
from fem_reference.solvers import solver
from msm.assembly import arrays
from msm.model import Counts, Run
from study.models.finite_elements import PreparedElements
from study.models.lattice import LatticeModel
from study.models.remainder import plus
from study.models.spacing_error import COARSER, INDEX, ORDER, force_differences
from study.models.table import kind, model
from study.models.tissue import lacks_poisson_ratio
from study.plan.candidates import SIZES, SPACINGS, Candidate, on_elements
from study.plan.look import ElementsLook, Look, Rest, meshes
from study.plan.prediction import (
    CAUTION,
    MESH,
    NONLINEAR_ORDER,
    REMAINDER,
    SPACING,
    SUBSPACE,
    TRUNCATION,
    Measure,
    Part,
    Prediction,
)
from study.problem.problem import Problem
from study.problem.trajectory import Trajectory
from study.scene import Lattice, Require, Scene
from study.similarity.fields import norm, relative_l2, relative_l2_of_curves

Floats = NDArray[np.float64]

LOOK = 1.0
"""Spacing of the finest of these lattices, times that of the scene.

Coarser ones underestimate the error of the nonlinear part: on a block under a tool of 12 mm, it is
an eighth of the difference between lattices of 10 and 5 mm if estimated from those of 12.5 and 25
mm, and two thirds from those of 10 and 20 mm.
"""
BETWEEN = 1.25
"""Spacing of the third lattice, times that of the finest.

Two lattices may agree by chance, and the prediction would fall short more often.
"""
PEAK_FORCE, HISTORY = "peak-force", "history"


@dataclass(frozen=True)
class MovedLook:
    """Motions of lattices of `spacing` [m], and of COARSER and BETWEEN times it.

    `error`: estimated relative error of the required quantities on the finest. Of the finest too:
    number of `springs`, `critical` step [s], wall time [s] of a step and of its set-up, bytes of
    its arrays, largest strain of a spring. `beyond`: largest difference of the nonlinear parts on
    the coarsest and the finest, relative to the whole motion of the latter. `elements`: coarse
    finite elements at rest, and `mesh` their estimated discretisation error. `beyond` and
    `elements` are None where a corrected lattice does not support the scene.
    """

    spacing: float
    error: float
    springs: int
    critical: float
    step_wall: float
    setup: float
    nbytes: int
    strain: float
    beyond: float | None = None
    elements: Look | None = None
    mesh: float = math.inf


@dataclass(frozen=True)
class AtRest:
    """Elements, displacements [m] of control points (loads, p, 3) and over the organ (loads, q, 3).

    Under each load by itself, in full, gravity among them.
    """

    look: ElementsLook
    probes: Floats
    field: Floats


def look(scene: Scene, problem: Problem, measure: Measure) -> MovedLook:
    """Motions of three lattices. ValueError where one of them does not finish."""
    spacings = [times * LOOK * scene.lattice.spacing for times in (COARSER, BETWEEN, 1.0)]
    moved = [_run(scene, problem, one) for one in spacings]
    runs = [run for run, _ in moved]
    assert scene.require is not None  # noqa: S101 - as something is planned for
    apart = partial(difference, problem, scene.require, measure)
    motions = [run.trajectory for run in runs]
    seen = replace(moved[-1][1], error=error_of_finest(motions, apart))
    if not _is_correctable(scene):
        return seen
    before, last = (_beyond_linear(scene, problem, spacings[n], runs[n]) for n in (0, -1))
    elements = [_at_rest(*one) for one in meshes(scene, problem)]
    return replace(
        seen,
        beyond=_by_motion(measure, plus(before, last, -1.0), runs[-1].trajectory),
        elements=Look(problem, (), tuple(one.look for one in elements), seen.strain, 0.0),
        mesh=_by_mesh(measure, elements),
    )


def error_of_finest(
    motions: Sequence[Trajectory], apart: Callable[[Trajectory, Trajectory], float]
) -> float:
    """Relative error of the last of several lattices of falling spacing.

    A grid convergence index of the largest difference, at order one as if the lattices were COARSER
    apart, and so never less than a run's own estimate. The order that three lattices show is not
    used: under tools of the size of a few cells they are not in the asymptotic range. `apart`:
    relative difference of a motion from one on a finer lattice.
    """
    return float(INDEX * max(apart(one, finer) for one, finer in combinations(motions, 2)))


def _is_correctable(scene: Scene) -> bool:
    """Whether a corrected lattice follows a scene, and large displacements are asked for."""
    able = kind("corrected").supported_features
    nonlinear = scene.lattice.geometry == "nonlinear" and scene.lattice.integrator != "xpbd"
    return nonlinear and able.issuperset(scene.features)


def _run(scene: Scene, problem: Problem, spacing: float) -> tuple[Run, MovedLook]:
    """A motion, and its size and cost."""
    started = time.perf_counter()
    prepared = _lattice(scene, _settings(scene, spacing)).prepare(problem)
    run, springs = prepared.moved(), len(prepared.assembly.springs.weight)
    setup = time.perf_counter() - started - run.wall
    if run.trajectory.status != "finished" or run.inverted_cells:
        raise ValueError(
            f"require: the motion of a lattice of {1e3 * spacing:.3g} mm, by which errors are "
            "predicted, is lost; reduce tool.displacement or lattice.step_fraction"
        )
    net = arrays(prepared.assembly, prepared.springs.material)
    nbytes = sum(part.nbytes for part in net if isinstance(part, np.ndarray))
    step_wall = run.wall / run.steps
    found = (springs, run.smallest_step, step_wall, setup, nbytes, run.largest_strain)
    return run, MovedLook(spacing, 0.0, *found)


def _lattice(scene: Scene, settings: Lattice) -> LatticeModel:
    """The lattice of the tissue's modulus, with these settings."""
    tissue = model(scene, "tissue")
    assert isinstance(tissue, LatticeModel)  # noqa: S101 - it is one by its kind
    return replace(tissue, scene=replace(tissue.scene, lattice=settings))


def _beyond_linear(scene: Scene, problem: Problem, spacing: float, run: Run) -> Trajectory:
    """The nonlinear part of a lattice's motion, by the same steps."""
    settings = replace(_settings(scene, spacing), geometry="linear")
    linear = _lattice(scene, settings).prepare(problem).moved(Counts(run.substeps))
    return plus(run.trajectory, linear.trajectory, -1.0)


def _settings(scene: Scene, spacing: float) -> Lattice:
    """The scene's table of a lattice of a spacing [m], with steps that follow the limit."""
    return replace(
        scene.lattice,
        spacing=spacing,
        springs="lattice",
        volume_term=lacks_poisson_ratio(scene),
        time_step=None,
        step_rate=None,
    )


def difference(
    problem: Problem, required: Require, measure: Measure, coarse: Trajectory, fine: Trajectory
) -> float:
    """Largest relative difference of two motions in any of the required quantities."""
    found = list[float]()
    if HISTORY in required.quantities:
        curves = relative_l2_of_curves(coarse.displacement - fine.displacement, fine.displacement)
        found += curves[list(measure.probes)].tolist()
    if measure.volumes is not None:
        found.append(relative_l2(coarse.volume_field[0], fine.volume_field[0], measure.volumes))
    if PEAK_FORCE in required.quantities:
        # Over time too, for two lattices may meet in a single number by chance.
        found += force_differences(problem, coarse.tool_force, fine.tool_force).ravel().tolist()
    return max(found)


def _by_motion(measure: Measure, apart: Trajectory, whole: Trajectory) -> float:
    """Largest relative size of a difference of motions, over time or of the kept field."""
    curves = relative_l2_of_curves(apart.displacement, whole.displacement)
    found = curves[list(measure.probes)].tolist()
    if measure.volumes is not None:
        field = norm(apart.volume_field[0], measure.volumes)
        found.append(field / norm(whole.volume_field[0], measure.volumes))
    return float(max(found))


def _at_rest(level: int, size: float, prepared: PreparedElements) -> AtRest:
    """Elements at rest under gravity and each load alone, of one that travels at each station."""
    started, body = time.perf_counter(), prepared.body()
    solve, seen = solver(body), prepared.problem.observation
    dead = () if body.dead is None else (body.dead,)
    rests = np.array([solve(load) for load in (*body.loads.T, *dead)])
    wall = (time.perf_counter() - started) / len(rests)
    probes, field = (
        np.array([at_points(weights, u) for u in rests])
        for weights in (evaluation(body, seen.probes), evaluation(body, seen.volume_points))
    )
    whole = Rest(probes.sum(axis=0), field.sum(axis=0))
    return AtRest(ElementsLook(level, size, body.unknowns, wall, whole), probes, field)


def _by_mesh(measure: Measure, elements: Sequence[AtRest]) -> float:
    """Error of the finest of these elements by Richardson extrapolation; infinite for one mesh.

    Over all loads together, since a control point hardly moves once a tool has left it.
    """
    if len(elements) < 2:
        return math.inf
    before, last = elements[-2:]
    gain = (before.look.size / last.look.size) ** ASSUMED_ORDER - 1.0
    chosen = list(measure.probes)
    apart = relative_l2_of_curves(last.probes - before.probes, last.probes)[chosen].tolist()
    if measure.volumes is not None:
        fields = zip(last.field, before.field, strict=True)
        size = math.hypot(*(norm(one, measure.volumes) for one in last.field))
        apart.append(math.hypot(*(norm(a - b, measure.volumes) for a, b in fields)) / size)
    return float(CAUTION * max(apart) / gain)


def corrected(scene: Scene, seen: MovedLook) -> Iterator[Candidate]:
    """Lattices corrected by elements, with predicted errors and costs, where they apply."""
    if seen.beyond is None or seen.elements is None:
        return
    last, base = seen.elements.elements[-1].size, seen.elements.problem.geometry.level(0)
    assert base is not None  # noqa: S101 - the organ was built of it
    gain = COARSER**NONLINEAR_ORDER - 1.0
    loads = 1 + len(seen.elements.problem.loads)
    for coarse in lattices(scene, seen):
        spacing = coarse.scene.lattice.spacing
        left = CAUTION * seen.beyond / gain * (spacing / seen.spacing) ** NONLINEAR_ORDER
        for times in SIZES:
            fine = on_elements(scene, seen.elements, times)
            mesh = seen.mesh * (times * base.size / last) ** ASSUMED_ORDER
            parts = Part(REMAINDER, left), Part(MESH, mesh), Part(TRUNCATION, SUBSPACE)
            chosen = replace(scene.corrected, spacing=spacing, coarse="uniform")
            size = f"{1e3 * fine.scene.reference.element_size:.3g} mm"
            yield replace(
                coarse,
                name=f"{coarse.name}, corrected by finite elements of {size}",
                scene=replace(fine.scene, models=("corrected",), corrected=chosen),
                prediction=Prediction(parts),
                step_wall=coarse.step_wall + 2.0 * loads * fine.step_wall,
                setup=coarse.setup + loads * fine.setup,
                memory=2.0 * coarse.memory + fine.memory,
                leaves_out=("any other path of the loads",),
            )


def lattices(scene: Scene, seen: MovedLook) -> Iterator[Candidate]:
    """Lattices of the tissue's modulus by their spacing, with predicted errors and costs."""
    for times in SPACINGS:
        spacing = times * scene.lattice.spacing
        finer = seen.spacing / spacing
        error = seen.error / finer**ORDER
        chosen = _settings(scene, spacing)
        yield Candidate(
            name=f"lattice of {1e3 * spacing:.3g} mm",
            scene=replace(scene, models=("tissue",), lattice=chosen),
            prediction=Prediction((Part(SPACING, error),)),
            step=seen.critical / finer,
            step_wall=seen.step_wall * finer**3,
            setup=seen.setup * finer**3,
            memory=seen.nbytes * finer**3,
            leaves_out=("the error of springs that does not decrease with the spacing",),
        )
