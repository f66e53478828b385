"""Finite elements stepped in time by TR-BDF2, with factors made once."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fem_reference import model as fem
from fem_reference.dynamics import Oscillator, SteppedMotion
from msm.timestep import whole_steps
from study.problem.problem import Problem
from study.scene import Scene
from study.tradeoff.body import FRAME_RATE, build, damping
from study.tradeoff.contender import Observed, Ready, Settings

ANY_LOAD = True
METHOD = "tr-bdf2"
MESHES = (
    *(("p1", level) for level in (-2, -1, 0, 1)),
    *(("p2", level) for level in (-2, -1, 0)),
    *(("taylor-hood", level) for level in (-2, -1)),
)
"""Elements, and level of the organ's mesh: 0 is that of the scene."""
FAST = 250.0
"""Steps per second [Hz], to show what the step contributes."""


def configurations(scene: Scene) -> Iterator[Settings]:
    """By element and mesh at a frame's step, and the coarsest with shorter ones."""
    del scene
    for element, level in MESHES:
        yield {"element": element, "level": level, "rate": FRAME_RATE}
    yield {"element": "p2", "level": -2, "rate": FAST}


def run(scene: Scene, posed: Problem, settings: Settings) -> Observed:
    """The whole motion."""
    body = build(scene, posed, settings["element"], settings["level"], METHOD)
    times = posed.observation.times
    every = whole_steps(float(times[1] - times[0]), 1.0 / settings["rate"])
    method = fem.Method(METHOD, every)
    found = fem.run(body, damping(scene), posed.factor, posed.observation, method)
    return Observed(found.trajectory, found.time_step)


def prepare(scene: Scene, posed: Problem, settings: Settings) -> Ready:
    """Set up to take steps, factors and all."""
    body = build(scene, posed, settings["element"], settings["level"], METHOD)
    system = Oscillator(body.mass, body.stiffness, body.load, damping(scene))
    step = 1.0 / settings["rate"]
    motion = SteppedMotion(system, posed.factor, step)  # at rest, and the factors

    def displacement() -> NDArray[np.float64]:
        return motion.displacement.reshape(-1, 3)

    return Ready(motion.take_step, displacement, step, body.stiffness.size)
