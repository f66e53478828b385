"""Linear finite elements with an additive multi-fidelity correction by a coarse lattice.

The finite elements represent shape, surface and load, but no geometric nonlinearity, of which a
coarse lattice gives an approximation. The motion is that of the elements in a subspace plus the
nonlinear part of the lattice's motion (`study.models.remainder`). For small loads it is that of the
elements.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from fem_reference.memory import SHARE, available
from msm.calibration import SPRING_POISSON_RATIO
from msm.damping import NodalDamping
from msm.integrators import INTEGRATORS
from msm.lattice import LatticeMesh
from msm.model import Counts, Fixed, Step
from msm.timestep import whole_steps
from study.models.corrected_errors import Errors, checks
from study.models.coupled_stepper import CoupledStepper
from study.models.damping import reference_damping
from study.models.deformed import Deformed, superposed
from study.models.finite_elements import (
    FiniteElements,
    PreparedElements,
    reference_of,
)
from study.models.lattice import LatticeModel, PreparedLattice, SpringMaterial, requested_step
from study.models.lattice_assumptions import springs
from study.models.mesh_error import MeshSolution
from study.models.model import Estimates, ModelKind, ModelRun, Simulation, Stepper, Watch
from study.models.persistence import record_fields
from study.models.remainder import FINER, ORDER, PreparedRemainder, Remainder, plus
from study.models.tissue import of_modulus
from study.problem.damping import RayleighDamping
from study.problem.problem import Problem
from study.problem.trajectory import Trajectory
from study.results.fields import Mesh
from study.results.records import ModelRecord
from study.scene import Scene
from study.system.progress import Progress, Silent

Floats = NDArray[np.float64]

TIMES = 2.0
"""Spacing of the coarse lattice, times that of the scene, where none is given."""
NODE_BYTES = 24
"""Kept of a node at a sample: displacement and velocity in single precision."""


@dataclass(frozen=True, kw_only=True)
class CorrectedLattice:
    """Finite elements and a coarse lattice of the same tissue; `fine` has the level of the mesh."""

    fine: FiniteElements
    coarse: LatticeModel
    name: str = "corrected"
    label: str = "Corrected lattice"

    def varied(self, **settings: Any) -> Self:
        """With another level of the mesh, `coarse` lattice, or other keys of its table."""
        own = {key: settings.pop(key) for key in ("level",) if key in settings}
        graded = settings.pop("coarse", "graded" if self.coarse.graded else "uniform") == "graded"
        coarse = replace(self.coarse, graded=graded)
        coarse = coarse.varied(**settings) if settings else coarse
        return replace(self, fine=self.fine.varied(**own), coarse=coarse)

    def prepare(self, problem: Problem) -> PreparedCorrected:
        """Set up elements and lattice; vectors are computed when they are needed.

        ValueError as of either, and for an integrator whose material depends on its step.
        """
        if self.coarse.lattice.integrator == "xpbd":
            raise ValueError(
                f"lattice.integrator: xpbd is softer the longer its step, and {self.name} needs a "
                "lattice whose small motions are those of its stiffness; choose another"
            )
        coarse = _weights_damped(self.coarse.prepare(problem))
        return PreparedCorrected(self, problem, self.fine.prepare(problem), coarse)


@dataclass(eq=False)
class PreparedCorrected:
    """Finite elements and coarse lattice; after a run, `best` is the solution on the last mesh."""

    model: CorrectedLattice
    problem: Problem
    fine: PreparedElements
    coarse: PreparedLattice
    best: MeshSolution | None = field(default=None, init=False)

    @property
    def critical_time_step(self) -> float:
        """Critical time step [s] of the coarse lattice, whose steps the linear parts take."""
        return self.coarse.critical_time_step

    def describe(self) -> list[str]:
        """Sizes of the mesh, then of the coarse lattice, a line each."""
        return [f"{self.model.name}: {text}" for text in self.fine.describe()] + [
            text if text.startswith(self.model.name) else f"{self.model.name}: coarse {text}"
            for text in self.coarse.describe()
        ]

    def refuse(self) -> None:
        """ValueError for what either refuses, and for more samples than the memory holds."""
        self.fine.refuse()
        self.coarse.refuse()
        samples, nodes = len(self.problem.observation.times), len(self.coarse.assembly.mass)
        wanted, limit = NODE_BYTES * samples * nodes, SHARE * available()
        if wanted > limit:
            raise ValueError(
                f"time.samples: {samples} of {nodes} nodes need {wanted / 2**30:.1f} GiB of "
                f"{limit / 2**30:.1f}; take fewer, or enlarge corrected.spacing"
            )

    @property
    def _on_level(self) -> MeshSolution:
        """The finite elements on the level of the model."""
        return _solved(self.model.fine, self.problem)

    def simulate(self, longest: float | None = None) -> Simulation:
        """The motion by the lattice's own steps, or by equal ones of at most `longest` [s]."""
        solved = self._on_level
        step: Step = requested_step(self.model.coarse.lattice)
        if longest is not None:
            interval = float(self.problem.observation.times[1])
            step = Fixed(interval / whole_steps(interval, longest))
        found = self._remainder(solved).run(step, keep_nodes=True)
        shape = self._deformed(solved)
        return Simulation(
            plus(found.trajectory, solved.found.trajectory),
            found.lattice.smallest_step,
            found.lattice.margin,
            shape.inverted_cells(found),
            shape.largest_strain(found, self.problem.observation.ends),
        )

    def _deformed(self, solved: MeshSolution) -> Deformed:
        return Deformed.of(solved, self.coarse.assembly.lattice)

    def _remainder(self, solved: MeshSolution) -> PreparedRemainder:
        """The remainder of the coarse lattice, in as many vectors as the elements needed."""
        return PreparedRemainder(self.coarse, superposed(solved).subspace.load.size)

    def rest(self) -> Floats:
        """Displacement [m] (q, 3) at rest at the points of the volume field, linearised.

        That of the elements: linearised about rest, the nonlinear part of a lattice is zero.
        """
        return self.fine.rest()

    def run(self, watch: Watch) -> ModelRun:
        """The motion, with the separate errors of its steps, mesh, vectors and coarse lattice."""
        linear = self.fine.run(Watch(watch.progress))
        assert self.fine.best is not None  # noqa: S101 - a run leaves it
        solved = self.best = self.fine.best
        prepared, shape = self._remainder(solved), self._deformed(solved)
        with watch.progress.stage(self.model.name) as advance:
            found = prepared.run(
                requested_step(self.model.coarse.lattice), advance, keep_nodes=True
            )
        self._keep_fields(found, shape, watch)
        record = replace(
            self._record(found, solved, shape),
            elements=linear.record.elements,
            time_step_errors=linear.record.time_step_errors,
        )
        whole = plus(found.trajectory, linear.trajectory)
        if whole.status == "diverged":
            return ModelRun(whole, replace(record, time_step_errors={}), notes=linear.notes)
        half = plus(self._halved(prepared, found, watch.progress), linear.trajectory)
        compared = self._compared(found, watch.progress)
        record = self._with_errors(
            record, Errors(self.problem.probes, found, whole), half, compared
        )
        notes = (*linear.notes, *_unknown(self.model.name, compared))
        sound = half if half.status == "finished" else None
        return ModelRun(whole, record, tuple(checks(record, solved)), notes, halved=sound)

    def _with_errors(
        self, record: ModelRecord, errors: Errors, half: Trajectory, compared: Trajectory | str
    ) -> ModelRecord:
        """The record with the errors of the lattice's steps and of its spacing."""
        lattice = self.model.coarse.lattice
        order = INTEGRATORS[lattice.integrator].order
        return replace(
            record,
            time_step_errors=errors.by_steps(order, half, record.time_step_errors),
            correction=errors.by_spacing(self.model.coarse.spacing, compared),
        )

    def _halved(
        self, prepared: PreparedRemainder, found: Remainder, progress: Progress
    ) -> Trajectory:
        """The remainder by half as long steps."""
        with progress.stage(f"{self.model.name}: halved steps") as advance:
            return prepared.run(Counts(2 * found.lattice.substeps), advance).trajectory

    def _compared(self, found: Remainder, progress: Progress) -> Trajectory | str:
        """The remainder of a lattice of FINER times the spacing, or why there is none."""
        coarse = self.model.coarse
        spacing = FINER * coarse.spacing
        try:
            other = _weights_damped(coarse.varied(spacing=spacing).prepare(self.problem))
            remainder = PreparedRemainder(other, found.vectors)
            with progress.stage(f"{self.model.name}: {1e3 * spacing:.3g} mm") as advance:
                compared = remainder.run(requested_step(other.model.lattice), advance).trajectory
        except ValueError as error:  # of a lattice that is too large
            return str(error)
        lost = f"its lattice of {1e3 * spacing:.3g} mm diverged"
        return compared if compared.status == "finished" else lost

    def _record(self, found: Remainder, solved: MeshSolution, shape: Deformed) -> ModelRecord:
        record = self.coarse.record(found.lattice)
        assert record.lattice is not None  # noqa: S101 - a lattice's record
        inverted = shape.inverted_cells(found)
        return replace(
            record,
            name=self.model.name,
            label=self.model.label,
            nodes=solved.found.nodes,
            wall_s=solved.found.wall + found.lattice.wall,
            largest_strain=shape.largest_strain(found, self.problem.observation.ends),
            lattice=replace(record.lattice, inverted_cells=inverted),
        )

    def _keep_fields(self, found: Remainder, shape: Deformed, watch: Watch) -> None:
        """Keep the motion of the mesh's vertices, if requested."""
        if watch.persistence is None or watch.persistence.fields is None:
            return
        mesh, times = Mesh(shape.mesh.points, shape.mesh.tetrahedra), self.problem.observation.times
        afresh = replace(watch.persistence, resume=False)
        with record_fields(afresh, self.model.name, mesh, times) as on_sample:
            for sample in found.samples:
                on_sample(sample, *shape.state(sample, found))

    def stepper(self) -> Stepper:
        """All parts at rest, stepped together; the vertices of the mesh are delivered by frames."""
        solved = self.best or self._on_level
        parts = self._remainder(solved), self._deformed(solved)
        return CoupledStepper(*parts, self.problem.factors, self.fine.model.damping).stepper()


@lru_cache(maxsize=1)
def _solved(fine: FiniteElements, problem: Problem) -> MeshSolution:
    """Elements on their level, for all lattices beside them."""
    return fine.prepare(problem).solved_on(None, Silent())


def _unknown(name: str, compared: Trajectory | str) -> Iterator[str]:
    """A note where the error of the coarse lattice cannot be estimated."""
    if isinstance(compared, str):
        yield f"The spacing error of {name} is not estimated: {compared}."


def models(scene: Scene, _: Estimates) -> Iterator[CorrectedLattice]:
    """The one corrected lattice, of the tissue's modulus."""
    reference = reference_of(scene).varied(method="ritz-vectors", large_strain="none")
    fine = replace(reference, name="corrected, linear part", label="Linear part")
    yield CorrectedLattice(fine=fine, coarse=_coarse(scene))


def _coarse(scene: Scene) -> LatticeModel:
    """A nonlinear lattice of the organ, with the volume term where the Poisson ratio needs it."""
    graded = scene.corrected.coarse == "graded"
    spacing = scene.corrected.spacing or TIMES * scene.lattice.spacing
    lattice = replace(
        scene.lattice,
        springs="lattice",
        spacing=spacing,
        geometry="nonlinear",
        volume_term=scene.tissue.poisson_ratio > SPRING_POISSON_RATIO,
    )
    make = partial(_springs, damping=reference_damping(scene))
    region = replace(
        scene.region,
        spacing=scene.region.spacing or 0.5 * scene.lattice.spacing,
        radius=scene.region.radius or scene.tool.radius,  # displacements are large at the tool
    )
    changed = replace(scene, lattice=lattice, region=region)
    return LatticeModel(
        name="corrected", label="Coarse lattice", scene=changed, make=make, graded=graded
    )


def _springs(scene: Scene, mesh: LatticeMesh, *, damping: RayleighDamping) -> SpringMaterial:
    """Springs of the scene's law and the tissue's modulus, damped as the elements are."""
    made = of_modulus(scene, mesh, modulus=scene.tissue.youngs_modulus)
    damped = NodalDamping(damping.mass, beta=damping.stiffness)
    return replace(made, material=replace(made.material, damping=damped))


def _weights_damped(lattice: PreparedLattice) -> PreparedLattice:
    """The lattice with attached weights damped as tissue, as in the elements and the modes."""
    plain, loads = lattice.assembly, lattice.assembly.external_loads
    if loads is None or not loads.attached_mass.any():
        return lattice
    damped = replace(loads, attached_mass=np.zeros_like(loads.attached_mass))
    return replace(lattice, assembly=replace(plain, external_loads=damped))


def assumptions(scene: Scene) -> list[str]:
    """On what the sum neglects, and how its errors are estimated."""
    coarse = _coarse(scene)
    sizes = " and more" if coarse.graded else ""
    of = "path" if any(tool.travels for tool in scene.tools) else "place"
    return [
        "The corrected lattice is the linear finite elements plus the nonlinear part of a lattice "
        f"of {1e3 * coarse.spacing:.3g} mm{sizes}, for this {of} of the load only. Its errors are "
        "estimates, none of them a bound: that of the nonlinear part by its spacing, from a "
        f"lattice of {FINER:.2g} times the spacing at an assumed order of {ORDER:g}; that of the "
        "linear part by its mesh and by its vectors.",
        *springs(coarse.scene),
    ]


KIND = ModelKind(
    models=models,
    assumptions=assumptions,
    follows_law=True,
    any_load=False,
    supported_features=frozenset(
        {
            "several-loads",
            "travelling-loads",
            "gravity",
            "weights",
            "inclusions",
            "fixed-surfaces",
        }
    ),
)
