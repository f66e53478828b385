"""Finite elements in a subspace of few vectors: nearly free to step, once these are computed.

The vectors belong to one load pattern. A tool that moves over the organ needs others.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh, expm

from fem_reference import model as fem
from fem_reference.dynamics import Damping as RayleighDamping
from fem_reference.elasticity import Body
from fem_reference.observation import at_points, evaluation
from fem_reference.recording import Recorder
from fem_reference.solvers import solver
from fem_reference.subspace import Subspace, eigenvectors, empty, extended, superposition
from fem_reference.superposition import LOOSE
from msm.timestep import whole_steps
from study.models.damping import reference_damping
from study.models.errors import estimated_run
from study.models.model import Estimates, ModelKind, ModelRun, Simulation, Stepper, Watch
from study.problem.problem import Problem
from study.results.records import ElementsRecord
from study.scene import Scene

Floats = NDArray[np.float64]

STEP = 1.0 / 60.0
"""Longest step [s] of the load, which is linear within it."""
ORDER = 2
"""Of the error by such steps."""


@dataclass(frozen=True, kw_only=True)
class SuperpositionModel:
    """So many Ritz vectors or modes of finite elements, `level` 0 being the scene's mesh."""

    element: str
    damping: RayleighDamping
    vectors: str
    count: int
    level: int = 0
    name: str = "superposition"
    label: str = "Superposition"

    def varied(self, **settings: Any) -> Self:
        """With other vectors, another count or level."""
        return replace(self, **settings)

    def prepare(self, problem: Problem) -> PreparedSuperposition:
        """Assemble the body; vectors are solved for when they are needed.

        ValueError if the organ has no such level.
        """
        level = problem.geometry.level(self.level)
        if level is None:
            raise ValueError(
                f"level {self.level}: the organ has no such mesh; choose another level"
            )
        where = (problem.foundation, problem.tool, self.element, problem.geometry.project)
        return PreparedSuperposition(self, problem, fem.build(level.mesh, problem.tissue, *where))


@dataclass(frozen=True, eq=False)
class PreparedSuperposition:
    """The body, and its subspace."""

    model: SuperpositionModel
    problem: Problem
    body: Body

    @cached_property
    def subspace(self) -> Subspace:
        """The vectors, and the body among them."""
        return (_ritz if self.model.vectors == "ritz" else _modal)(self.body, self.model.count)

    @property
    def critical_time_step(self) -> float:
        """Infinite: each mode is integrated exactly."""
        return float("inf")

    def describe(self) -> list[str]:
        """Unknowns and vectors."""
        kind = "Ritz vectors" if self.model.vectors == "ritz" else "modes and the rest"
        return [f"{self.model.name}: {self.model.count} {kind} of {self.body.unknowns} unknowns"]

    def simulate(self, longest: float | None = None) -> Simulation:
        """The motion, exact in the subspace for a load that is linear over steps of a frame."""
        seen, subspace = self.problem.observation, self.subspace
        samples = seen.times
        every = whole_steps(float(samples[1]), longest or STEP)
        times = np.linspace(samples[0], samples[-1], (len(samples) - 1) * every + 1)
        y, rates = superposition(subspace, self.model.damping, self.problem.factor, times)
        recorder, V = Recorder(self.body, seen), subspace.vectors
        for sample in range(len(samples)):
            u, v = V @ y[sample * every], V @ rates[sample * every]
            probes = recorder.at_probes
            recorder.motion(sample, at_points(probes, u), at_points(probes, v))
            recorder.field(sample, u)
        return Simulation(recorder.trajectory, float(times[1]))

    def run(self, watch: Watch) -> ModelRun:
        """The motion, its error by the steps of the load, and what it is made of."""
        elements = ElementsRecord(
            element=self.body.element,
            elements=len(self.body.mesh.tetrahedra),
            unknowns=self.body.unknowns,
            method=self.model.vectors,
            subspace_vectors=self.subspace.load.size,
        )
        found = estimated_run(self.model, self, self.problem, watch, ORDER)
        modulus, damping = self.problem.tissue.youngs_modulus, self.model.damping
        record = replace(
            found.record,
            elements=elements,
            nodes=self.body.node_count,
            small_strain_modulus_pa=modulus,
            damping_rate_per_s=damping.mass,
            stiffness_damping_s=damping.stiffness,
        )
        return replace(found, record=record)

    def rest(self) -> Floats:
        """Displacement [m] (q, 3) at rest at the points of the volume field."""
        points = self.problem.observation.volume_points
        return at_points(evaluation(self.body, points), self.subspace.rest())

    def stepper(self) -> Stepper:
        """Steps of a frame, each of which gives the displacement of all nodes."""
        subspace, factor = self.subspace, self.problem.factor
        squares, Q = eigh(subspace.stiffness)
        shapes, load = subspace.vectors @ Q, Q.T @ subspace.load
        moved = transitions(squares, self.model.damping, STEP)
        state = np.zeros((len(squares), 4))
        t, u = 0.0, np.zeros(len(shapes))

        def take_step() -> None:
            nonlocal t, u
            before, after = factor(np.array([t, t + STEP]))
            state[:, 2], state[:, 3] = load * before, load * (after - before) / STEP
            state[:, :2] = np.einsum("mij,mj->mi", moved, state)[:, :2]
            u = shapes @ state[:, 0]
            t += STEP

        return Stepper(take_step, lambda: u.reshape(-1, 3), STEP, len(squares))


def transitions(squares: Floats, damped: RayleighDamping, step: float) -> Floats:
    """Of displacement, velocity, load and its slope over a step [s], (m, 4, 4), by mode.

    `squares` (m,): squared frequencies; exact for a load that is linear over the step.
    """
    rate = np.zeros((len(squares), 4, 4))
    rate[:, [0, 1, 2], [1, 2, 3]] = 1.0
    rate[:, 1, 0], rate[:, 1, 1] = -squares, -(damped.mass + damped.stiffness * squares)
    return np.asarray(expm(step * rate))


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


def models(scene: Scene, _: Estimates) -> Iterator[SuperpositionModel]:
    """The one superposition of a scene."""
    chosen = scene.superposition
    yield SuperpositionModel(
        element=scene.reference.element,
        damping=reference_damping(scene),
        vectors=chosen.vectors,
        count=chosen.count,
    )


def assumptions(scene: Scene) -> list[str]:
    """On what a fixed subspace leaves out."""
    chosen = scene.superposition
    kind = "load-dependent Ritz vectors" if chosen.vectors == "ritz" else "modes of vibration"
    return [
        f"The superposition is made of {chosen.count} {kind} of the finite elements on the scene's "
        "own mesh: linear, and for this place of the load only."
    ]


KIND = ModelKind(models=models, assumptions=assumptions, any_load=False)
