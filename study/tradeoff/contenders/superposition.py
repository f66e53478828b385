"""Finite elements in a subspace of few vectors: nearly free to step, once these are computed.

The vectors belong to one load pattern. A tool that moves over the organ needs others.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fem_reference.elasticity import Body
from fem_reference.subspace import Subspace, SubspaceMotion, modal_subspace, ritz_subspace
from fem_reference.superposition import subspace_trajectory
from msm.timestep import whole_steps
from study.problem.problem import Problem
from study.scene import Scene
from study.tradeoff.body import FRAME_RATE, build, damping
from study.tradeoff.contender import Observed, Ready, Settings

ANY_LOAD = False
STEP = 1.0 / FRAME_RATE
SUBSPACES = (
    *(("ritz", count, -1) for count in (4, 16)),
    *(("ritz", count, 0) for count in (2, 4, 8, 16, 24)),
    *(("ritz", 16, level) for level in (1, 2)),
    *(("modal", count, -2) for count in (10, 40)),
    ("ritz", 16, -2),
)
"""Vectors, how many, and the level of the organ's mesh: 0 is that of the scene."""


def configurations(scene: Scene) -> Iterator[Settings]:
    """By vectors, their number and mesh."""
    del scene
    for vectors, count, level in SUBSPACES:
        yield {"vectors": vectors, "count": count, "level": level}


def run(scene: Scene, posed: Problem, settings: Settings) -> Observed:
    """The whole motion."""
    body = _body(scene, posed, settings)
    sample = float(posed.observation.times[1])
    every = whole_steps(sample, STEP)
    found = subspace_trajectory(
        body, _subspace(body, settings), damping(scene), posed.factor, posed.observation, every
    )
    return Observed(found, sample / every)


def prepare(scene: Scene, posed: Problem, settings: Settings) -> Ready:
    """Set up to take steps, each of which gives the displacement of all nodes."""
    subspace = _subspace(_body(scene, posed, settings), settings)
    motion = SubspaceMotion(subspace, damping(scene), posed.factor, STEP)

    def displacement() -> NDArray[np.float64]:
        return motion.displacement.reshape(-1, 3)

    return Ready(motion.take_step, displacement, STEP, subspace.load.size)


def _body(scene: Scene, posed: Problem, settings: Settings) -> Body:
    return build(scene, posed, scene.reference.element, settings["level"], "ritz-vectors")


def _subspace(body: Body, settings: Settings) -> Subspace:
    make = ritz_subspace if settings["vectors"] == "ritz" else modal_subspace
    return make(body, settings["count"])
