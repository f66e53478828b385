"""Finite elements in a subspace of few vectors: nearly free to step, once these are computed.

The vectors belong to one load pattern. A tool that moves over the organ needs others.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import reduce

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh, expm

from fem_reference.dynamics import Damping
from fem_reference.elasticity import Body
from fem_reference.observation import at_points
from fem_reference.recording import Recorder
from fem_reference.solvers import solver
from fem_reference.subspace import Subspace, eigenvectors, empty, extended, superposition
from fem_reference.superposition import LOOSE
from msm.timestep import whole_steps
from study.problem.problem import Problem
from study.scene import Scene
from study.tradeoff.body import FRAME_RATE, build, damping
from study.tradeoff.contender import Observed, Ready, Settings

Floats = NDArray[np.float64]

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
    subspace = _subspace(body, settings)
    samples = posed.observation.times
    every = whole_steps(float(samples[1]), STEP)
    times = np.linspace(samples[0], samples[-1], (len(samples) - 1) * every + 1)
    y, rates = superposition(subspace, damping(scene), posed.factor, times)
    recorder, V = Recorder(body, posed.observation), subspace.vectors
    for sample in range(len(samples)):
        u, v = V @ y[sample * every], V @ rates[sample * every]
        seen = recorder.at_probes
        recorder.motion(sample, at_points(seen, u), at_points(seen, v))
        recorder.field(sample, u)
    return Observed(recorder.trajectory, float(times[1]))


def prepare(scene: Scene, posed: Problem, settings: Settings) -> Ready:
    """Set up to take steps, each of which gives the displacement of all nodes."""
    subspace = _subspace(_body(scene, posed, settings), settings)
    squares, Q = eigh(subspace.stiffness)
    shapes, load = subspace.vectors @ Q, Q.T @ subspace.load
    moved = transitions(squares, damping(scene), STEP)
    state = np.zeros((len(squares), 4))
    t, u = 0.0, np.zeros(len(shapes))

    def take_step() -> None:
        nonlocal t, u
        before, after = posed.factor(np.array([t, t + STEP]))
        state[:, 2], state[:, 3] = load * before, load * (after - before) / STEP
        state[:, :2] = np.einsum("mij,mj->mi", moved, state)[:, :2]
        u = shapes @ state[:, 0]
        t += STEP

    return Ready(take_step, lambda: u.reshape(-1, 3), STEP, len(squares))


def transitions(squares: Floats, damped: Damping, step: float) -> Floats:
    """Of displacement, velocity, load and its slope over a step [s], (m, 4, 4), by mode.

    `squares` (m,): squared frequencies; exact for a load that is linear over the step.
    """
    rate = np.zeros((len(squares), 4, 4))
    rate[:, [0, 1, 2], [1, 2, 3]] = 1.0
    rate[:, 1, 0], rate[:, 1, 1] = -squares, -(damped.mass + damped.stiffness * squares)
    return np.asarray(expm(step * rate))


def _body(scene: Scene, posed: Problem, settings: Settings) -> Body:
    return build(scene, posed, scene.reference.element, settings["level"], "ritz-vectors")


def _subspace(body: Body, settings: Settings) -> Subspace:
    return (_ritz if settings["vectors"] == "ritz" else _modal)(body, settings["count"])


def _ritz(body: Body, count: int) -> Subspace:
    found = extended(body, empty(body.stiffness.size), solver(body)(body.load))
    loose = solver(body, LOOSE)
    for _ in range(count - 1):
        found = extended(body, found, loose(body.mass @ found.vectors[:, -1]))
    return found


def _modal(body: Body, count: int) -> Subspace:
    """The static displacement and so many modes."""
    vectors = eigenvectors(body, solver(body), count)
    start = empty(body.stiffness.size)
    return reduce(lambda found, vector: extended(body, found, vector), vectors.T, start)
