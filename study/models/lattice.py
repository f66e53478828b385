"""A lattice of springs over the organ, or springs along the edges of its mesh."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from msm import model as msm
from msm.graded import GradedLattice
from msm.integrators import INTEGRATORS
from msm.lattice import LatticeMesh
from msm.laws import LAWS, force_law_of
from msm.model import Assembly, Automatic, Counts, Fixed, Material, Rate, Run, Step
from msm.stepper import LatticeStepper
from msm.timestep import whole_steps
from study.mesh.tetrahedra import volumes
from study.models.errors import (
    mean_velocity_error,
    place,
    rounding_checks,
    rounding_errors,
    step_checks,
    time_step_errors,
    tool_force_errors,
)
from study.models.indented_stepper import IndentedStepper
from study.models.lattice_assembly import assembled, loaded
from study.models.model import SILENT, ModelRun, Simulation, Stepper, Watch
from study.models.persistence import OnSample, checkpoint, record_fields
from study.models.region_size import RegionRequest, SizedRegion, sized_region
from study.models.spacing_error import COARSER, spacing_errors
from study.problem.heterogeneous import of_tetrahedra
from study.problem.problem import Problem
from study.problem.trajectory import Trajectory
from study.results.fields import Mesh
from study.results.records import (
    Check,
    CurveErrors,
    LatticeRecord,
    ModelRecord,
    SpacingErrors,
)
from study.scene import Lattice, Scene, graded
from study.system.progress import Advance

Floats = NDArray[np.float64]

MASS_LIMIT = 0.05
REGION_KEYS = ("spacing", "levels", "radius", "tolerance")
SUPPORTED_FEATURES = frozenset(
    {
        "moved-tools",
        "several-loads",
        "travelling-loads",
        "gravity",
        "weights",
        "inclusions",
        "fixed-surfaces",
    }
)
"""Names of `study.problem.features.FEATURES` that every uniform lattice supports."""


@dataclass(frozen=True)
class SpringMaterial:
    """Young's modulus [Pa] of a spring lattice at small strain, and the springs' material."""

    modulus: float
    material: Material


Make = Callable[[Scene, LatticeMesh], SpringMaterial]
"""Makes the spring material of a lattice from a scene and its table `lattice`."""


@dataclass(frozen=True, kw_only=True)
class LatticeModel:
    """Springs over the organ of a scene, made by `make`; `bounds` make two other stiffnesses.

    `system`: the fuzzy system that estimated the stiffness; `graded`: whether the cells are graded
    as the scene's table `region` says.
    """

    name: str
    label: str
    scene: Scene
    make: Make
    bounds: tuple[Make, Make] | None = None
    system: str | None = None
    graded: bool = False

    @property
    def spacing(self) -> float:
        """Edge [m] of its cells, or of the finest cells of a graded lattice."""
        if not self.graded:
            return self.lattice.spacing
        return self.scene.region.spacing or 0.5 * self.lattice.spacing

    @property
    def lattice(self) -> Lattice:
        """The scene's table `lattice`."""
        return self.scene.lattice

    def varied(self, **settings: Any) -> Self:
        """The model with other keys of the table `lattice`, or `region` of a graded one.

        Unless they are given, the time step is automatic and the precision double.
        """
        scene = self.scene
        if self.graded:
            own = {key: settings.pop(key) for key in REGION_KEYS if key in settings}
            scene = replace(scene, region=replace(scene.region, **own))
        free = replace(
            self.lattice, springs="lattice", precision="double", time_step=None, step_rate=None
        )
        return replace(self, scene=replace(scene, lattice=replace(free, **settings)))

    def with_spacing(self, spacing: float) -> Self:
        """The model with cells of another edge [m]."""
        lattice = replace(self.lattice, spacing=spacing)
        return replace(self, scene=replace(self.scene, lattice=lattice))

    def prepare(self, problem: Problem) -> PreparedLattice:
        """Build the lattice on the organ, and its springs."""
        if self.graded:
            for unfit in graded.unfit(self.lattice):
                raise ValueError(unfit)
            found = sized_region(problem, self._region_request(), self._of_tissue)
            plain = found.assembly
            if problem.has_further_loads:
                plain = loaded(problem, plain)
            made = self.make(self.scene, plain.lattice)
            return replace(on_lattice(self, problem, plain, made), region=found)
        plain = assembled(problem, self.lattice)
        return on_lattice(self, problem, plain, self.make(self.scene, plain.lattice))

    def _region_request(self) -> RegionRequest:
        """The table `region` as a request for a graded lattice."""
        region = self.scene.region
        how = region.levels, region.radius, region.tolerance, region.at
        return RegionRequest(self.spacing, *how, self.lattice.flexion)

    def _of_tissue(self, plain: Assembly) -> tuple[Assembly, Material]:
        made = self.make(self.scene, plain.lattice)
        return msm.of_tissue(plain, made.material, made.modulus)


def on_lattice(
    model: LatticeModel, problem: Problem, plain: Assembly, made: SpringMaterial
) -> PreparedLattice:
    """Give springs to a lattice of homogeneous tissue, and its heterogeneity to the springs.

    A stiffness estimate is that of the surrounding tissue; inclusions keep their own modulus.
    """
    assembly, material = msm.of_tissue(plain, made.material, made.modulus)
    return PreparedLattice(model, problem, assembly, replace(made, material=material), plain)


@dataclass(frozen=True, eq=False)
class PreparedLattice:
    """A lattice on its organ.

    `plain`: the same lattice of homogeneous tissue, from which other springs are made; `region`:
    the extent of the finest cells of a graded lattice.
    """

    model: LatticeModel
    problem: Problem
    assembly: Assembly
    springs: SpringMaterial
    plain: Assembly
    region: SizedRegion | None = None

    @property
    def linear(self) -> bool:
        """Whether forces are linearised for small displacements."""
        return self.model.lattice.geometry == "linear"

    @property
    def single(self) -> bool:
        """Whether steps are taken in single precision."""
        return self.model.lattice.precision == "single"

    @cached_property
    def critical_time_step(self) -> float:
        """Longest stable step [s] at rest; infinite for an integrator without a limit."""
        integrator = self.model.lattice.integrator
        return float(msm.critical_time_step(self.assembly, self.springs.material, integrator))

    def refuse(self) -> None:
        """Raise ValueError for unsuitable time steps, at the bounds of the stiffness too."""
        for make in (None, *(self.model.bounds or ())):
            one = self if make is None else self._with(make)
            lattice = self.model.lattice
            msm.refuse(
                one.assembly,
                one.springs.material,
                self.problem.observation,
                requested_step(lattice),
                integrator=lattice.integrator,
                linear=self.linear,
                single=self.single,
            )

    def _with(self, make: Make) -> PreparedLattice:
        """The same lattice with other springs."""
        made = make(self.model.scene, self.assembly.lattice)
        return on_lattice(self.model, self.problem, self.plain, made)

    def describe(self) -> list[str]:
        """Nodes and springs, then modulus, critical step and damping."""
        where = "lattice" if self.model.lattice.springs == "lattice" else "springs on the mesh"
        damping = self.springs.material.damping
        dashpots = f" and {1e3 * damping.beta:.4g} ms" if damping.beta > 0.0 else ""
        nodes, count = len(self.assembly.mass), len(self.assembly.springs.weight)
        step = self.critical_time_step
        limit = f"{1e3 * step:.3g} ms" if np.isfinite(step) else "none"
        return [
            f"{where}: {nodes} nodes, {count} springs",
            *self._sizes(),
            f"{self.model.name}: law {self._law()}, modulus {self.springs.modulus / 1e3:.2f} kPa, "
            f"critical step {limit}, damping {damping.gamma_0:.4g} 1/s{dashpots}",
        ]

    def _sizes(self) -> Iterator[str]:
        """Cells of each size and radius of a graded lattice; nothing of a uniform one."""
        found, lattice = self.region, self.assembly.lattice
        if found is None:
            return
        assert isinstance(lattice, GradedLattice)  # noqa: S101 - it has a region
        cells = ", ".join(
            f"{len(one.cells)} of {1e3 * one.spacing:.3g} mm" for one in lattice.levels
        )
        apart = (
            "as given"
            if found.apart is None
            else f"at rest {100 * found.apart:.2g} % off the finest cells throughout"
        )
        yield (
            f"{self.model.name}: cells {cells}, {lattice.hanging} hanging nodes; the finest reach "
            f"{1e3 * found.radius:.3g} mm, {apart}"
        )

    def _law(self) -> str:
        """Name of the springs' law in the table `LAWS`."""
        kind = force_law_of(self.springs.material.law)
        return next(name for name, found in LAWS.items() if found is kind)

    def simulate(self, longest: float | None = None) -> Simulation:
        """The motion by the scene's steps, or by equal steps of at most `longest` [s]."""
        step: Step = requested_step(self.model.lattice)
        if longest is not None:
            interval = float(self.problem.observation.times[1])
            step = Fixed(interval / whole_steps(interval, longest))
        found = self._integrate(step)
        return Simulation(found.trajectory, found.smallest_step, found.margin, found.inverted_cells)

    def moved(self, step: Step | None = None) -> Run:
        """The motion by the scene's or the given steps, without an error estimate."""
        return self._integrate(requested_step(self.model.lattice) if step is None else step)

    def run(self, watch: Watch) -> ModelRun:
        """The motion, its errors, and the motion at both bounds of the stiffness interval."""
        found, errors, half = self._run(watch), {}, None
        rounding: dict[str, CurveErrors] = {}
        finished = found.trajectory.status == "finished"
        if finished:
            half = self._halved(found, watch)
            order = INTEGRATORS[self.model.lattice.integrator].order
            errors = time_step_errors(order, self.problem.probes, found.trajectory, half)
            rounding = self._rounding(found, watch)
        sound = half if half is not None and half.status == "finished" else None
        record = replace(self.record(found, rounding), time_step_errors=errors)
        if sound is not None:
            order = INTEGRATORS[self.model.lattice.integrator].order
            names = tuple(tool.name for tool in self.problem.rigid_tools)
            forces = tool_force_errors(order, names, found.trajectory, sound)
            record = replace(record, tool_force_errors=forces)
        by_spacing, why = self._by_spacing(found, watch) if finished else (None, ())
        record = replace(record, spacing_errors=by_spacing)
        checks = (self._mass(), *self._step_checks(found, half, errors))
        if finished and self.single:
            checks += tuple(rounding_checks(self.model.name, rounding))
        bounds = self._bounds(watch)
        notes = (*why, *self._lost_bounds(bounds))
        return ModelRun(found.trajectory, record, checks, notes, bounds, sound)

    def rest(self) -> Floats:
        """Displacement [m] (q, 3) at rest at the points of the volume field, linearised.

        ValueError where further loads act, since the linearised rest state is defined for one load
        only.
        """
        if self.problem.has_further_loads:
            raise ValueError(
                "the linearised rest of a lattice is defined for one load on a weightless body only"
            )
        nodal = msm.static_displacement(self.assembly, self.springs.material)
        points = self.problem.observation.volume_points
        return np.asarray(self.assembly.lattice.interpolation(points)[0] @ nodal)

    def stepper(self) -> Stepper:
        """The lattice at rest; the stability limit is checked as often as in a run.

        Under moved tools it restarts where they are deepest.
        """
        lattice = self.model.lattice
        motion = LatticeStepper(
            self.assembly,
            self.springs.material,
            self.problem.factor,
            lattice.integrator,
            linear=self.linear,
            single=self.single,
        )
        dt = _step(lattice, motion.limit_at_rest)
        if self.problem.rigid_tools:
            seen = self.problem.observation
            deep = IndentedStepper(
                motion, float(seen.times[seen.frames[0]]), partial(_step, lattice)
            )
            steps = deep.take_step, motion.u.copy, dt, motion.u.size, deep.advance, deep.restart
            return Stepper(*steps)
        return Stepper(
            partial(motion.take_step, dt),
            motion.u.copy,
            dt,
            motion.u.size,
            partial(motion.advance, dt=dt),
            motion.restart,
            take_many=partial(motion.take_steps, dt=dt),
        )

    def _run(self, watch: Watch) -> Run:
        name, lattice = self.model.name, self.assembly.lattice
        mesh, times = Mesh(lattice.nodes, lattice.cells), self.problem.observation.times
        with (
            watch.progress.stage(name) as advance,
            record_fields(watch.persistence, name, mesh, times) as on_sample,
        ):
            return self._integrate(
                requested_step(self.model.lattice), advance, watch, name, on_sample=on_sample
            )

    def _halved(self, found: Run, watch: Watch) -> Trajectory:
        name = self.model.name
        with watch.progress.stage(f"{name}: halved steps") as advance:
            step = Counts(2 * found.substeps)
            return self._integrate(step, advance, watch, f"{name}-halved").trajectory

    def _step_checks(
        self, found: Run, half: Trajectory | None, errors: dict[str, CurveErrors]
    ) -> Iterator[Check]:
        """Checks of the steps of a finished motion."""
        if half is None:
            return
        order = INTEGRATORS[self.model.lattice.integrator].order
        mean = mean_velocity_error(order, self.problem, found.trajectory, half)
        yield from step_checks(self.model.name, errors, mean)

    def _by_spacing(self, found: Run, watch: Watch) -> tuple[SpacingErrors | None, tuple[str, ...]]:
        """Discretisation errors from a coarser lattice, or a note on why there are none.

        Only under moved tools or several loads, where there may be no finite-element reference.
        """
        model = self.model
        if not self.problem.has_further_loads or model.graded or model.lattice.springs != "lattice":
            return None, ()
        try:
            coarser = model.with_spacing(COARSER * model.spacing).prepare(self.problem)
            with watch.progress.stage(f"{model.name}: coarser lattice") as advance:
                step = requested_step(model.lattice)
                coarse = coarser._integrate(
                    step, advance, watch, f"{model.name}-coarser"
                ).trajectory
        except ValueError as error:  # a support or a load misses the coarser lattice
            return None, (_unknown_by_spacing(model, str(error)),)
        errors = spacing_errors(self.problem, model.spacing, coarse, found.trajectory)
        if errors is None:
            return None, (_unknown_by_spacing(model, "the coarser lattice diverged"),)
        return errors, ()

    def _rounding(self, found: Run, watch: Watch) -> dict[str, CurveErrors]:
        """Rounding errors against the same steps in double precision; empty for double."""
        if not self.single:
            return {}
        name, scene = f"{self.model.name}-double", self.model.scene
        other = replace(scene, lattice=replace(scene.lattice, precision="double"))
        double = replace(self, model=replace(self.model, scene=other))
        with watch.progress.stage(f"{self.model.name}: double precision") as advance:
            whole = double._integrate(Counts(found.substeps), advance, watch, name).trajectory
        return rounding_errors(self.problem.probes, found.trajectory, whole)

    def _bounds(self, watch: Watch) -> tuple[Trajectory, Trajectory] | None:
        if self.model.bounds is None:
            return None
        low, high = self.model.bounds
        return self._bound(low, "lower", watch), self._bound(high, "upper", watch)

    def _bound(self, make: Make, side: str, watch: Watch) -> Trajectory:
        name = self.model.name
        other = self._with(make)
        with watch.progress.stage(f"{name}: {side} bound") as advance:
            step = requested_step(self.model.lattice)
            return other._integrate(step, advance, watch, f"{name}-{side}").trajectory

    def _lost_bounds(self, bounds: tuple[Trajectory, Trajectory] | None) -> tuple[str, ...]:
        return tuple(
            f"The run of {self.model.name} at the {side} bound of its interval diverged at "
            f"{run.ended_at:g} s: its band ends there."
            for side, run in zip(("lower", "upper"), bounds or (), strict=False)
            if run.status == "diverged"
        )

    def _integrate(
        self,
        step: Step,
        advance: Advance = lambda _: None,
        watch: Watch = SILENT,
        state_name: str = "",
        on_sample: OnSample = lambda *_: None,
    ) -> Run:
        return msm.run(
            self.assembly,
            self.springs.material,
            self.problem.factor,
            self.problem.observation,
            step,
            advance,
            integrator=self.model.lattice.integrator,
            linear=self.linear,
            single=self.single,
            checkpoint=checkpoint(watch.persistence, state_name),
            on_sample=on_sample,
        )

    def _mass(self) -> Check:
        expected = _mass_of(self.problem)
        expected += sum(weight.mass for weight in self.problem.weights)
        return Check(
            name="lattice: mass",
            value=abs(float(self.assembly.mass.sum()) / expected - 1.0),
            limit=MASS_LIMIT,
            meaning="mass of the lattice against that of the finite-element mesh",
        )

    def record(self, found: Run, rounding: dict[str, CurveErrors] | None = None) -> ModelRecord:
        """The record of a run with the given rounding errors, without time-step errors."""
        model, trajectory, damping = self.model, found.trajectory, self.springs.material.damping
        return ModelRecord(
            name=model.name,
            label=model.label,
            system=model.system,
            simulated_s=float(self.problem.observation.times[-1]),
            status=trajectory.status,
            ended_at_s=trajectory.ended_at,
            ended_near_m=place(trajectory),
            nodes=len(self.assembly.mass),
            time_step_s=found.largest_step,
            critical_time_step_s=_finite(found.critical_time_step),
            steps=found.steps,
            wall_s=found.wall,
            small_strain_modulus_pa=self.springs.modulus,
            damping_rate_per_s=damping.gamma_0,
            stiffness_damping_s=damping.beta,
            largest_strain=found.largest_strain,
            time_step_errors={},
            tool_overlap_m=found.overlap if self.problem.rigid_tools else None,
            lattice=LatticeRecord(
                springs=len(self.assembly.springs.weight),
                integrator=model.lattice.integrator,
                poisson_ratio=self._poisson_ratio(),
                smallest_time_step_s=found.smallest_step,
                smallest_step_margin=_finite(found.margin),
                repeated_steps=found.repeated_steps,
                node_mass_kg=self._node_mass(),
                inverted_cells=found.inverted_cells,
                precision=model.lattice.precision,
                rounding_errors=rounding or {},
            ),
        )

    def _poisson_ratio(self) -> float | None:
        """Poisson ratio of the springs; None where the mesh determines it."""
        if self.model.lattice.springs == "tetrahedra":
            return None
        return self.springs.material.poisson_ratio

    def _node_mass(self) -> float:
        """Mass [kg] of an inner node of the cubic lattice, or the mean over a mesh."""
        if self.model.lattice.springs == "tetrahedra":
            return float(self.assembly.mass.mean())
        return self.problem.tissue.density * self.model.spacing**3


def _unknown_by_spacing(model: LatticeModel, why: str) -> str:
    return f"The error of {model.name} by its spacing is not estimated: {why}."


def _mass_of(problem: Problem) -> float:
    """Mass [kg] of the organ on its tetrahedral mesh."""
    density, mesh = problem.tissue.density, problem.geometry.mesh
    made = of_tetrahedra(mesh, problem.tissue)
    if made is None:
        return problem.geometry.volume * density
    return float(volumes(mesh) @ made.density(density))


def requested_step(lattice: Lattice) -> Step:
    """How a scene wants time steps to be chosen."""
    if lattice.time_step is not None:
        return Fixed(lattice.time_step)
    if lattice.step_rate is not None:
        return Rate(lattice.step_rate)
    return Automatic(lattice.step_fraction)


def _step(lattice: Lattice, limit: float) -> float:
    """The step [s] of a run at rest, before it is shortened to divide the sampling interval."""
    if lattice.time_step is not None:
        return lattice.time_step
    if lattice.step_rate is not None:
        return 1.0 / lattice.step_rate
    return lattice.step_fraction * limit


def _finite(value: float) -> float | None:
    """The value, or None where an integrator has no limit."""
    return float(value) if np.isfinite(value) else None
