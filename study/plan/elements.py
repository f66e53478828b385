"""Neo-Hookean finite elements in contact, as a candidate under moved tools.

Their errors are predicted from motions on two meshes that are coarser than those of a run. That of
the mesh is found by Richardson extrapolation at order two, with the safety factor of a grid
convergence index for two grids, and that of the steps by taking steps twice as long.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from fem_reference.error_estimate import ASSUMED_ORDER, SAFETY_ASSUMED
from fem_reference.memory import needed, unknowns
from study.models.hyperelastic import ELEMENT, FEWEST, HyperelasticElements, PreparedHyperelastic
from study.models.table import kind, model
from study.organ.geometry import Level
from study.plan.candidates import GROWTH, Candidate, Omitted
from study.plan.prediction import MESH, STEPS, Part, Prediction
from study.problem.problem import Problem
from study.problem.trajectory import Trajectory
from study.scene import Scene

NAME, ELEMENTS = "hyperelastic", "neo-Hookean finite elements"
LEVELS = (-4, -2)
"""Meshes that are solved. A run solves the latter and one of level 0."""
LONGER = 2
"""Steps of the compared motions, times those of a run."""
STEPS_ERROR = 0.5
"""Estimated error by steps over the change by longer ones, as in a run."""

Difference = Callable[[Trajectory, Trajectory], float]


@dataclass(frozen=True)
class _Motion:
    """A motion on a mesh, and its wall time [s]."""

    trajectory: Trajectory
    level: Level
    wall: float


def elements(scene: Scene, problem: Problem, difference: Difference) -> Candidate | Omitted:
    """Hyperelastic elements with predicted error and cost.

    Omitted where they are not applicable, or a motion on a coarse mesh does not finish.
    `difference`: relative difference of a motion from a finer one.
    """
    brief = _thinned(problem)
    beyond = set(scene.features) - kind(NAME).supported_features
    if beyond:
        return Omitted(ELEMENTS, f"they do not support {', '.join(sorted(beyond))}")
    if len(brief.observation.times) < FEWEST:
        return Omitted(ELEMENTS, f"time.samples: their steps need {LONGER * FEWEST - 1} or more")
    elements = model(scene, NAME)
    assert isinstance(elements, HyperelasticElements)  # noqa: S101 - they are by their kind
    whole = elements.prepare(problem)
    try:
        whole.refuse()
        motions = [
            _moved(elements.varied(level=level).prepare(brief), times * whole.time_step)
            for level, times in ((LEVELS[0], 1), (LEVELS[0], LONGER), (LEVELS[1], LONGER))
        ]
    except ValueError as error:  # of damping, a mesh or gravity that they cannot follow
        return Omitted(ELEMENTS, str(error))
    if any(one.trajectory.status != "finished" for one in motions):
        return Omitted(ELEMENTS, "a motion on a coarse mesh does not finish")
    own, coarse, fine = motions
    parts = (
        Part(MESH, _by_mesh(coarse, fine, whole.level(), difference)),
        Part(STEPS, STEPS_ERROR * difference(coarse.trajectory, own.trajectory)),
    )
    return _candidate(scene, whole, fine, parts)


def _thinned(problem: Problem) -> Problem:
    """The problem observed at every other sample, which longer steps reach too."""
    seen = problem.observation
    frames = tuple(frame // LONGER for frame in seen.frames)
    return replace(problem, observation=replace(seen, times=seen.times[::LONGER], frames=frames))


def _moved(prepared: PreparedHyperelastic, step: float) -> _Motion:
    """The motion by steps of at most `step` [s]."""
    started = time.perf_counter()
    trajectory = prepared.simulate(step).trajectory
    return _Motion(trajectory, prepared.level(), time.perf_counter() - started)


def _by_mesh(coarse: _Motion, fine: _Motion, level: Level, difference: Difference) -> float:
    """Error on the mesh of a level, at the order of edges, of which contact has one."""
    before, last, own = (h.size**ASSUMED_ORDER for h in (coarse.level, fine.level, level))
    change = difference(coarse.trajectory, fine.trajectory)
    return float(SAFETY_ASSUMED * change * own / (before - last)) if before > last else math.inf


def _candidate(
    scene: Scene, whole: PreparedHyperelastic, fine: _Motion, parts: tuple[Part, ...]
) -> Candidate:
    """The elements of the scene, on whose coarser mesh a run takes longer steps as well."""
    level = whole.level()
    share = len(level.mesh.tetrahedra) / len(fine.level.mesh.tetrahedra)
    coarser = LONGER * fine.wall
    steps = round(scene.time.duration / whole.time_step)
    return Candidate(
        name=f"mesh of {len(level.mesh.tetrahedra)} neo-Hookean finite elements",
        scene=replace(scene, models=(NAME,)),
        prediction=Prediction(parts),
        step=whole.time_step,
        step_wall=coarser * share**GROWTH / steps,
        setup=coarser + fine.wall,
        memory=needed(unknowns(level.mesh, ELEMENT), ELEMENT, stepping=True),
    )
