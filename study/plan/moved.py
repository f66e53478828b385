"""The plan of a scene with moved tools, gravity, weights or several loads: by two quick motions.

What a lattice is off by its spacing is told by the motions of two coarse ones, at the order that a
run assumes too, and so of a tool smaller than their cells rather too much. What springs cannot do
at any spacing is not looked at.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from msm.assembly import arrays
from msm.model import Run
from study.models.lattice import LatticeModel
from study.models.spacing_error import COARSER, ORDER, force_differences
from study.models.table import model
from study.models.tissue import lacks_poisson_ratio
from study.plan.candidates import SPACINGS, Candidate
from study.plan.prediction import SPACING, Measure, Part, Prediction
from study.problem.problem import Problem
from study.scene import Lattice, Require, Scene
from study.similarity.fields import relative_l2, relative_l2_of_curves

LOOK = 1.25
"""Spacing of the finer lattice that is looked at, times that of the scene."""
PEAK_FORCE, HISTORY = "peak-force", "history"


@dataclass(frozen=True)
class MovedLook:
    """What two lattices did: of `spacing` [m], and of COARSER times it.

    `apart`: largest relative difference of what is wanted. Of the finer: springs, critical step
    [s], wall [s] of a step and of its set-up, bytes of its arrays, largest strain of a spring.
    """

    spacing: float
    apart: float
    springs: int
    critical: float
    step_wall: float
    setup: float
    nbytes: int
    strain: float


def look(scene: Scene, problem: Problem, measure: Measure) -> MovedLook:
    """Move two lattices. ValueError where one of them does not reach the end."""
    spacing = LOOK * scene.lattice.spacing
    coarse, _ = _run(scene, problem, COARSER * spacing)
    fine, seen = _run(scene, problem, spacing)
    assert scene.require is not None  # noqa: S101 - as something is planned for
    return replace(seen, apart=_apart(problem, scene.require, measure, coarse, fine))


def _run(scene: Scene, problem: Problem, spacing: float) -> tuple[Run, MovedLook]:
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
    return run, MovedLook(spacing, 0.0, *found)


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
