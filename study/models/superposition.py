"""Finite elements in a subspace of a few vectors: cheap to step once the vectors are computed.

The vectors belong to one load pattern. A tool at another place on the organ needs others.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from fem_reference import model as fem
from fem_reference.certificate import Certificate, certificate
from fem_reference.certified import CertifiedMotion
from fem_reference.elasticity import Body
from fem_reference.elements import chosen_element
from fem_reference.grid import Projection
from fem_reference.memory import factors_fit, unknowns
from fem_reference.observation import at_points, evaluation
from fem_reference.subspace import Subspace, SubspaceMotion, modal_subspace, ritz_subspace
from fem_reference.superposition import subspace_motion
from msm.timestep import whole_steps
from study.mesh.kinds import TetrahedralMesh
from study.models.certified import Certified, bound_on_demand, certified
from study.models.damping import reference_damping
from study.models.errors import estimated_run
from study.models.model import Estimates, ModelKind, ModelRun, Simulation, Stepper, Watch
from study.problem.contact import ToolPatch
from study.problem.damping import RayleighDamping
from study.problem.problem import Problem
from study.problem.supports import Support
from study.problem.tissue import Tissue
from study.results.records import ElementsRecord
from study.scene import Scene

Floats = NDArray[np.float64]

STEP = 1.0 / 60.0
"""Longest step [s] of the load, which is linear within it."""
ORDER = 2
"""Order of the error due to these steps."""


@dataclass(frozen=True, kw_only=True)
class SuperpositionModel:
    """Finite elements in Ritz vectors or modes; `level` 0 is the scene's mesh.

    `certificate`: number of vectors for the bound on their error, 0 for no bound.
    """

    element: str
    damping: RayleighDamping
    vectors: str
    count: int
    certificate: int = 0
    level: int = 0
    name: str = "superposition"
    label: str = "Superposition"

    def varied(self, **settings: Any) -> Self:
        """The model with other vectors, another number of them or another level."""
        return replace(self, **settings)

    def prepare(self, problem: Problem) -> PreparedSuperposition:
        """Set up; body and vectors are computed when they are needed.

        ValueError if the organ has no such level.
        """
        level = problem.geometry.level(self.level)
        if level is None:
            raise ValueError(
                f"level {self.level}: the organ has no such mesh; choose another level"
            )
        return PreparedSuperposition(self, problem, level.mesh)


@dataclass(frozen=True, eq=False)
class PreparedSuperposition:
    """The body on a mesh, and its subspace."""

    model: SuperpositionModel
    problem: Problem
    mesh: TetrahedralMesh

    def refuse(self) -> None:
        """Raise ValueError for a mesh that exceeds the memory, or misses support or tool."""
        fem.refuse(self.mesh, *self._body_arguments())

    def _body_arguments(self) -> tuple[Tissue, Support, ToolPatch, str, Projection | None]:
        """What a body consists of beside its mesh."""
        problem, element = self.problem, self.model.element
        geometry = problem.geometry
        return problem.tissue, problem.foundation, problem.tool, element, geometry.project

    @cached_property
    def body(self) -> Body:
        """The body, assembled once."""
        return fem.build(self.mesh, *self._body_arguments())

    @cached_property
    def subspace(self) -> Subspace:
        """The vectors, and the body projected on them."""
        make = ritz_subspace if self.model.vectors == "ritz" else modal_subspace
        return make(self.body, self.model.count)

    @cached_property
    def certificate(self) -> Certificate:
        """What bounds its error. ValueError with the reason where there is no bound."""
        if not factors_fit(self.body.unknowns, self.body.element):
            raise ValueError(f"the memory holds no factors of {self.body.unknowns} unknowns")
        probes = evaluation(self.body, self.problem.observation.probes)
        return certificate(self.body, self.subspace, probes, self.model.certificate)

    @property
    def critical_time_step(self) -> float:
        """Critical time step [s]: infinite, since each mode is integrated exactly."""
        return float("inf")

    def describe(self) -> list[str]:
        """Unknowns and vectors, and those that certify its error."""
        kind = "Ritz vectors" if self.model.vectors == "ritz" else "modes and the rest"
        element = chosen_element(self.model.element, self.problem.tissue.highest_poisson_ratio)
        size = unknowns(self.mesh, element)
        lines = [f"{self.model.name}: {self.model.count} {kind} of {size} unknowns"]
        if self.model.certificate:
            lines.append(f"{self.model.name}: error certified by {self.model.certificate} vectors")
        return lines

    def _steps_per_sample(self, longest: float | None = None) -> int:
        return whole_steps(float(self.problem.observation.times[1]), longest or STEP)

    def simulate(self, longest: float | None = None) -> Simulation:
        """The motion, exact in the subspace for a load that is linear over each frame."""
        seen, subspace = self.problem.observation, self.subspace
        sample = float(seen.times[1])
        every = self._steps_per_sample(longest)
        where = (self.model.damping, self.problem.factor, seen, every)
        found = subspace_motion(self.body, subspace, *where)
        return Simulation(found.trajectory, sample / every, largest_strain=found.strain)

    def run(self, watch: Watch) -> ModelRun:
        """The motion, its errors due to the load's steps and the subspace, and its record."""
        found = estimated_run(self.model, self, self.problem, watch, ORDER)
        bound, notes = self._certified(found.trajectory.displacement, watch)
        elements = ElementsRecord(
            element=self.body.element,
            elements=len(self.body.mesh.tetrahedra),
            unknowns=self.body.unknowns,
            method=self.model.vectors,
            subspace_vectors=self.subspace.load.size,
            certified=None if bound is None else bound.record,
        )
        modulus, damping = self.problem.tissue.youngs_modulus, self.model.damping
        record = replace(
            found.record,
            elements=elements,
            nodes=self.body.node_count,
            small_strain_modulus_pa=modulus,
            damping_rate_per_s=damping.mass,
            stiffness_damping_s=damping.stiffness,
        )
        bounds = None if bound is None else bound.bounds
        return replace(found, record=record, notes=(*found.notes, *notes), certified=bounds)

    def _certified(self, motion: Floats, watch: Watch) -> tuple[Certified | None, tuple[str, ...]]:
        """The bound on a motion's error if requested, or a note on why there is none."""
        if not self.model.certificate:
            return None, ()
        try:
            with watch.progress.stage(f"{self.model.name}: certificate"):
                given = self.certificate
        except ValueError as error:
            return None, (f"The error of {self.model.name} is not certified: {error}.",)
        steps = self._steps_per_sample()
        return certified(given, self.model.damping, self.problem, steps, motion), ()

    def rest(self) -> Floats:
        """Displacement [m] (q, 3) at rest at the points of the volume field."""
        points = self.problem.observation.volume_points
        return at_points(evaluation(self.body, points), self.subspace.rest())

    def stepper(self) -> Stepper:
        """Steps of one frame, each of which gives the displacement of all nodes and its bound."""
        subspace = self.subspace
        motion = SubspaceMotion(subspace, self.model.damping, self.problem.factor, STEP)

        def displacement() -> Floats:
            return motion.displacement.reshape(-1, 3)

        def certified_motion() -> CertifiedMotion:
            return CertifiedMotion(self.certificate, self.model.damping, self.problem.factor, STEP)

        bound = bound_on_demand(certified_motion, lambda: motion.time)
        return Stepper(
            motion.take_step,
            displacement,
            STEP,
            subspace.load.size,
            bound=bound if self.model.certificate else None,
        )


def models(scene: Scene, _: Estimates) -> Iterator[SuperpositionModel]:
    """The one superposition of a scene."""
    chosen = scene.superposition
    yield SuperpositionModel(
        element=scene.reference.element,
        damping=reference_damping(scene),
        vectors=chosen.vectors,
        count=chosen.count,
        certificate=chosen.certificate,
    )


def assumptions(scene: Scene) -> list[str]:
    """On the limitations of a fixed subspace."""
    chosen = scene.superposition
    kind = "load-dependent Ritz vectors" if chosen.vectors == "ritz" else "modes of vibration"
    return [
        f"The superposition is made of {chosen.count} {kind} of the finite elements on the scene's "
        "own mesh: linear, and for this place of the load only."
    ]


KIND = ModelKind(
    models=models,
    assumptions=assumptions,
    any_load=False,
    supported_features=frozenset({"inclusions", "fixed-surfaces"}),
)
