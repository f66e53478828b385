"""The plan of a scene with moved tools, gravity, weights or several loads: by two quick motions.

What a lattice is off by its spacing is told by the motions of two coarse ones, at the order that a
run assumes too, and so of a tool smaller than their cells rather too much. What springs cannot do
at any spacing is not looked at. Where corrected lattices follow the scene, as under tools that
travel, theirs is told by what the two do beyond themselves linear, and by elements on two meshes at
rest.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

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
from study.models.spacing_error import COARSER, ORDER, force_differences
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

LOOK, CORRECTED_LOOK = 1.25, 1.0
"""Spacing of the finer lattice that is looked at, times that of the scene: alone, or corrected.

Of what lattices do beyond themselves linear coarser ones tell too little: on a block under a tool
of 12 mm those of 12.5 and 25 mm an eighth of what one of 10 mm is off that of 5 mm, those of 10
and 20 mm two thirds.
"""
PEAK_FORCE, HISTORY = "peak-force", "history"


@dataclass(frozen=True)
class MovedLook:
    """What two lattices did: of `spacing` [m], and of COARSER times it.

    `apart`: largest relative difference of what is wanted. Of the finer: springs, critical step
    [s], wall [s] of a step and of its set-up, bytes of its arrays, largest strain of a spring.
    `beyond`: as `apart`, of what they do beyond themselves linear, beside the finer's whole motion;
    `elements`: coarse and fine ones at rest, `mesh` how far apart. None and none where a corrected
    lattice does not follow the scene.
    """

    spacing: float
    apart: float
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
    """Move two lattices. ValueError where one of them does not reach the end."""
    spacing = (CORRECTED_LOOK if _is_correctable(scene) else LOOK) * scene.lattice.spacing
    coarse, _, *before = _run(scene, problem, COARSER * spacing)
    fine, seen, *last = _run(scene, problem, spacing)
    assert scene.require is not None  # noqa: S101 - as something is planned for
    seen = replace(seen, apart=_apart(problem, scene.require, measure, coarse, fine))
    if not before or not last:
        return seen
    elements = [_at_rest(level, size, one) for level, size, one in meshes(scene, problem)]
    return replace(
        seen,
        beyond=_by_motion(measure, plus(before[0], last[0], -1.0), fine.trajectory),
        elements=Look(problem, (), tuple(one.look for one in elements), seen.strain, 0.0),
        mesh=_by_mesh(measure, elements),
    )


def _is_correctable(scene: Scene) -> bool:
    """Whether a corrected lattice follows a scene, and large displacements are asked for."""
    able = kind("corrected").supported_features
    nonlinear = scene.lattice.geometry == "nonlinear" and scene.lattice.integrator != "xpbd"
    return nonlinear and able.issuperset(scene.features)


def _run(
    scene: Scene, problem: Problem, spacing: float
) -> tuple[Run, MovedLook] | tuple[Run, MovedLook, Trajectory]:
    """A motion and what it took; and what of it is beyond itself linear where that is asked for."""
    tissue = model(scene, "tissue")
    assert isinstance(tissue, LatticeModel)  # noqa: S101 - it is one by its kind
    started = time.perf_counter()
    chosen = replace(tissue, scene=replace(tissue.scene, lattice=_settings(scene, spacing)))
    prepared = chosen.prepare(problem)
    run, springs = prepared.moved(), len(prepared.assembly.springs.weight)
    setup = time.perf_counter() - started - run.wall
    if run.trajectory.status != "finished" or run.inverted_cells:
        raise ValueError(
            f"require: the motion of a lattice of {1e3 * spacing:.3g} mm, by which errors are "
            "foretold, is lost; reduce tool.displacement or lattice.step_fraction"
        )
    net = arrays(prepared.assembly, prepared.springs.material)
    nbytes = sum(part.nbytes for part in net if isinstance(part, np.ndarray))
    step_wall = run.wall / run.steps
    found = (springs, run.smallest_step, step_wall, setup, nbytes, run.largest_strain)
    seen = MovedLook(spacing, 0.0, *found)
    if not _is_correctable(scene):
        return run, seen
    linear = replace(chosen.scene.lattice, geometry="linear")
    other = replace(chosen, scene=replace(chosen.scene, lattice=linear)).prepare(problem)
    below = other.moved(Counts(run.substeps)).trajectory
    return run, seen, plus(run.trajectory, below, -1.0)


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


def _apart(problem: Problem, required: Require, measure: Measure, coarse: Run, fine: Run) -> float:
    """Largest relative difference of what is wanted."""
    one, other, found = coarse.trajectory, fine.trajectory, list[float]()
    if HISTORY in required.quantities:
        curves = relative_l2_of_curves(one.displacement - other.displacement, other.displacement)
        found += curves[list(measure.probes)].tolist()
    if measure.volumes is not None:
        found.append(relative_l2(one.volume_field[0], other.volume_field[0], measure.volumes))
    if PEAK_FORCE in required.quantities:
        # Over time too, for two lattices may meet in a single number by chance.
        found += force_differences(problem, one.tool_force, other.tool_force).ravel().tolist()
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
    """Error of the finest of these elements, by Richardson; infinite of a single mesh.

    Over all loads together, as a control point that a tool leaves hardly moves any more.
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
    """Lattices corrected by elements, with errors and costs foretold; none where they cannot be."""
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
                leaves_out=("any other way of the loads",),
            )


def lattices(scene: Scene, seen: MovedLook) -> Iterator[Candidate]:
    """Lattices of the tissue's modulus by their spacing, with errors and costs foretold."""
    for times in SPACINGS:
        spacing = times * scene.lattice.spacing
        finer = seen.spacing / spacing
        error = seen.apart / (COARSER**ORDER - 1.0) / finer**ORDER
        chosen = _settings(scene, spacing)
        yield Candidate(
            name=f"lattice of {1e3 * spacing:.3g} mm",
            scene=replace(scene, models=("tissue",), lattice=chosen),
            prediction=Prediction((Part(SPACING, error),)),
            step=seen.critical / finer,
            step_wall=seen.step_wall * finer**3,
            setup=seen.setup * finer**3,
            memory=seen.nbytes * finer**3,
            leaves_out=("what springs cannot do at any spacing",),
        )
