"""The content of results.json, as frozen records shared by writer and readers.

Numbers are in SI units, errors relative in the L2 norm unless stated otherwise; None where a model
has no such number.
"""

from __future__ import annotations

from dataclasses import dataclass, field

SCHEMA_VERSION = 6


@dataclass(frozen=True, kw_only=True)
class CurveErrors:
    """Relative L2 errors of the two curves of a control point."""

    displacement: float
    velocity: float


@dataclass(frozen=True, kw_only=True)
class CurveOrders:
    """Observed orders of convergence of the two curves of a control point."""

    displacement: float | None
    velocity: float | None


@dataclass(frozen=True, kw_only=True)
class Check:
    """A number that passes if it does not exceed its limit, and its meaning."""

    name: str
    value: float
    limit: float
    meaning: str

    @property
    def passed(self) -> bool:
        """Whether it is within its limit; NaN is not."""
        return self.value <= self.limit


@dataclass(frozen=True, kw_only=True)
class MeshLevel:
    """One mesh of a reference; `size` of its elements is relative to the finest."""

    size: float
    elements: int
    unknowns: int
    wall_s: float


@dataclass(frozen=True, kw_only=True)
class DiscretisationError:
    """Estimated discretisation error on the finest mesh.

    `field_peak`: of the field at the peak; the rest by control point. `formal_order` of the element
    bounds the orders that the estimate takes.
    """

    field_peak: float
    field_order: float | None
    formal_order: float
    by_probe: dict[str, CurveErrors]
    order_by_probe: dict[str, CurveOrders]

    @property
    def worst(self) -> CurveErrors:
        """The largest of any control point."""
        return largest(self.by_probe)


@dataclass(frozen=True, kw_only=True)
class LargeStrain:
    """Differences of a hyperelastic solid at rest from the linear one on the same mesh."""

    law: str
    field_difference: float
    largest_strain: float
    unknowns: int


@dataclass(frozen=True, kw_only=True)
class CertifiedReduction:
    """Certified bounds on the error of a reduced motion against the unreduced model.

    For the same load, linear over the same steps; discretisation and time-step errors are not
    included. `energy`: largest bound on the error's energy norm over the largest norm of the
    motion; by control point the bound on the displacement error in relative L2 of its curve, and
    the largest [m]. Relative bounds are None of a motion, or a point, that stays where it is.
    `rest`: of the energy norm at rest under the full load. `vectors`: dimension of the Krylov space
    that bounds the error; `rounding`: contribution of rounding to `energy` where the whole load is
    applied at once.
    """

    vectors: int
    energy: float | None
    rest: float
    rounding: float
    displacement: dict[str, float | None]
    largest_m: dict[str, float]


@dataclass(frozen=True, kw_only=True)
class ToolForceRecord:
    """The largest force on a moved tool, and relative L2 errors of the force over time.

    By the mesh, the time step and the last quarter of the subspace; None where not estimated.
    """

    peak_n: float
    by_mesh: float | None
    by_steps: float | None
    by_subspace: float | None


@dataclass(frozen=True, kw_only=True)
class ContactRecord:
    """Contact of finite elements with moved tools, `forces` by the name of the tool.

    `vertices`: number of vertices that may carry pressure; `penetration_m`: deepest point of the
    surface inside a tool, since contact is enforced in the mean over each vertex.
    """

    vertices: int
    penetration_m: float
    forces: dict[str, ToolForceRecord]


@dataclass(frozen=True, kw_only=True)
class ElementsRecord:
    """What only finite elements have.

    `subspace_vectors`, `truncation` and `certified` are those of a superposition;
    `truncation_error` is the larger part of `truncation`, and `certified` None where no bound was
    requested or found. `accuracy_missed`: the requested accuracy if it was not reached. `law`: the
    hyperelastic law of a motion at large strain, None for a linear one.
    """

    element: str
    elements: int
    unknowns: int
    method: str
    subspace_vectors: int | None = None
    truncation_error: float | None = None
    truncation: CurveErrors | None = None
    certified: CertifiedReduction | None = None
    largest_rotation_rad: float | None = None
    levels: tuple[MeshLevel, ...] = ()
    mesh_error: DiscretisationError | None = None
    accuracy_missed: float | None = None
    large_strain: LargeStrain | None = None
    contact: ContactRecord | None = None
    law: str | None = None


@dataclass(frozen=True, kw_only=True)
class LatticeRecord:
    """What only a lattice of springs has.

    `smallest_step_margin`: smallest ratio of the critical step to the step taken; `poisson_ratio`:
    None where the mesh determines it; `rounding_errors`: of steps in single precision against the
    same in double, by control point, empty for steps in double.
    """

    springs: int
    integrator: str
    poisson_ratio: float | None
    smallest_time_step_s: float
    smallest_step_margin: float | None
    repeated_steps: int
    node_mass_kg: float
    inverted_cells: int
    precision: str = "double"
    rounding_errors: dict[str, CurveErrors] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class SpacingErrors:
    """Estimated discretisation errors of a lattice, from the same motion on a coarser one.

    A grid convergence index from a lattice of `coarser_m`, with an assumed `order` and a
    `safety_factor`; of a force that falls with refinement, the index of its logarithm. Relative L2
    of the displacement by control point and of the force of each moved tool over time, and that of
    the largest force, which is not taken smaller, since single numbers of two lattices may
    coincide. The model error of springs at any spacing is not included.
    """

    coarser_m: float
    order: float
    safety_factor: float
    displacement: dict[str, float]
    tool_force: dict[str, float] = field(default_factory=dict)
    peak_force: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class CorrectionRecord:
    """What only a corrected lattice has: its coarse lattice, and the remaining uncertainty.

    `remainder`: the nonlinear part of the lattice's motion, L2 by control point, and
    `remainder_errors`: its estimated discretisation error, from a lattice of `compared_spacing_m`;
    None and empty where not estimated; both relative to the whole motion. `vectors` of the
    linearised lattice, and `truncation_error`: of its motion by them.
    """

    spacing_m: float
    compared_spacing_m: float | None
    remainder: dict[str, CurveErrors]
    remainder_errors: dict[str, CurveErrors]
    vectors: int
    truncation_error: float


@dataclass(frozen=True, kw_only=True)
class PointRecord:
    """What only a single control mass point has."""

    stiffness_n_per_m: float
    mass_kg: float
    damping_ratio: float


@dataclass(frozen=True, kw_only=True)
class ModelRecord:
    """What a run states of every model; its last four fields are specific to a kind of model.

    `label`: its name in print; `status`: finished, diverged or not finished, with `ended_at_s` for
    the latter two, 0 if the motion never began, and `reason` and `remedy` if it is not finished;
    `system`: the fuzzy system that estimated its stiffness; `small_strain_modulus_pa`: its Young's
    modulus at small strain; `time_step_errors`: by control point, empty where not estimated.
    `tool_force_errors`: relative L2 error of the force of each rigid tool, by time step and mesh as
    far as estimated; `tool_overlap_m`: deepest overlap of body and tools, None without tools.
    `spacing_errors`: of a lattice under moved tools or several loads, None where not estimated.
    """

    name: str
    label: str
    simulated_s: float
    status: str
    ended_at_s: float | None = None
    ended_near_m: tuple[float, float, float] | None = None
    reason: str = ""
    remedy: str = ""
    system: str | None = None
    nodes: int | None = None
    time_step_s: float | None = None
    critical_time_step_s: float | None = None
    steps: int | None = None
    wall_s: float | None = None
    small_strain_modulus_pa: float | None = None
    damping_rate_per_s: float | None = None
    stiffness_damping_s: float | None = None
    largest_strain: float | None = None
    time_step_errors: dict[str, CurveErrors]
    elements: ElementsRecord | None = None
    lattice: LatticeRecord | None = None
    point: PointRecord | None = None
    correction: CorrectionRecord | None = None
    tool_force_errors: dict[str, float] = field(default_factory=dict)
    tool_overlap_m: float | None = None
    spacing_errors: SpacingErrors | None = None

    @property
    def parts(self) -> int | None:
        """Number of finite elements or of springs."""
        if self.elements is not None:
            return self.elements.elements
        if self.lattice is not None:
            return self.lattice.springs
        return None if self.point is None else 1

    @property
    def mesh_error(self) -> DiscretisationError | None:
        """Estimated discretisation error, None where there is none or it is not estimated."""
        return None if self.elements is None else self.elements.mesh_error

    @property
    def time_step_error(self) -> CurveErrors | None:
        """The largest time-step error of any control point, None where not estimated."""
        return largest(self.time_step_errors) if self.time_step_errors else None

    @property
    def inverted_cells(self) -> int:
        """Number of inverted cells of a lattice, zero for other models."""
        return 0 if self.lattice is None else self.lattice.inverted_cells


def largest(errors: dict[str, CurveErrors]) -> CurveErrors:
    """The largest errors of any control point."""
    return CurveErrors(
        displacement=max(one.displacement for one in errors.values()),
        velocity=max(one.velocity for one in errors.values()),
    )


@dataclass(frozen=True, kw_only=True)
class SystemEstimate:
    """Stiffness estimated by one fuzzy system; `interval_pa` for type-2 only."""

    estimate_pa: float
    relative_to_reference: float
    quadrature_error_pa: float
    method: str
    notes: tuple[str, ...]
    interval_pa: tuple[float, float] | None = None


@dataclass(frozen=True, kw_only=True)
class StiffnessSet:
    """A linguistic set of stiffness, with the elastography that places it [kPa] and its source."""

    aetiology: str
    stage: str
    severity: str
    placement: str
    centre: float
    centre_source: str
    within_stage_sd: float
    sd_kind: str
    sd_source: str
    between_study: float
    between_study_kind: str
    between_study_source: str
    between_operator: float
    between_operator_kind: str
    between_operator_source: str
    n: int | None
    sourced: str
    note: str


@dataclass(frozen=True, kw_only=True)
class FuzzyRecord:
    """The fuzzy systems and their estimates; empty for a scene without them."""

    systems: dict[str, SystemEstimate]
    rule_count: int | None = None
    stiffness_sets: tuple[StiffnessSet, ...] = ()
    surface_inputs: tuple[str, str] | None = None


@dataclass(frozen=True, kw_only=True)
class LatticeLimits:
    """Errors of springs at rest that no stiffness removes.

    Relative L2 differences of the field from the reference: with its modulus, against a reference
    of Poisson ratio 1/4, at the best factor on the field, and with a volume term.
    """

    spacing_m: float
    poisson_ratio: float
    relative_l2_at_quarter: float
    relative_l2: float
    best_factor: float
    relative_l2_at_best_factor: float
    relative_l2_with_volume_term: float | None


@dataclass(frozen=True, kw_only=True)
class BudgetPart:
    """One cause in an error budget, all relative to the reference's norm at the peak.

    `size`: L2 norm of this part; `contribution`: its projection on the total difference, which may
    be negative; contributions add up to the total. `left`: the difference that remains after
    removing this cause and those before. `error` of the part, None where unknown.
    """

    cause: str
    size: float
    contribution: float
    left: float
    error: float | None


@dataclass(frozen=True, kw_only=True)
class ErrorBudget:
    """The parts of the field difference between a model and a reference at the peak.

    `total`: relative L2; `total_error`: the reference's own discretisation error, if estimated.
    """

    model: str
    reference: str
    total: float
    total_error: float | None
    parts: tuple[BudgetPart, ...]


@dataclass(frozen=True, kw_only=True)
class Dimensionless:
    """Size of the organ, and dimensionless numbers that reveal a wrong unit."""

    extent_m: float
    volume_m3: float
    sag_rho_g_l_over_e: float
    tool_pressure_over_e: float
    tool_radius_over_spacing: float
    tool_radius_over_element_size: float


@dataclass(frozen=True, kw_only=True)
class ControlPoint:
    """Mass and spring of a scene that is a single point."""

    mass_kg: float
    rest_length_m: float


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """Provenance of the results; the study draws no random numbers, so `seed` is None.

    `tissue_sha256`: of all files of inclusions and the map of stiffness, None without any.
    """

    versions: dict[str, str | None]
    commit: str | None
    platform: str
    processor: str | None
    seed: int | None
    scene_sha256: str
    mesh_sha256: str | None
    rule_base_sha256: str | None = None
    tissue_sha256: str | None = None


@dataclass(frozen=True, kw_only=True)
class StageRecord:
    """A stage of a run: its wall time, when that was measured (UTC), and whether it was `kept`.

    A kept stage was computed by an earlier run of this program here and read from the store. Stages
    may run side by side.
    """

    name: str
    wall_s: float
    measured_at: str
    kept: bool


@dataclass(frozen=True, kw_only=True)
class ToolForce:
    """Largest axial force [N] of a rigid tool on a model's body, its time, and the tool's depth.

    `relative_error` of the force over time, L2, None where not estimated: by the time step, and for
    finite elements by mesh and subspace too. `work_j`: work of the tool on the body up to the end.
    `spacing_error` of the force over time from a coarser lattice, None for other models and where
    not estimated.
    """

    model: str
    tool: str
    peak_n: float
    peak_at_s: float
    peak_travel_m: float
    work_j: float
    relative_error: float | None
    spacing_error: float | None = None


@dataclass(frozen=True, kw_only=True)
class StudyRecord:
    """The content of results.json except for the checksums of the other files.

    `references`: names of the models that the others are compared with, in order; `workers`: number
    of processes that its stages ran in, which affects their wall times. `tools`: the force of each
    rigid tool in each model, where there are any.
    """

    title: str
    probes: tuple[str, ...]
    fuzzy: FuzzyRecord
    models: tuple[ModelRecord, ...]
    references: tuple[str, ...] = ()
    checks: tuple[Check, ...]
    warnings: tuple[str, ...]
    assumptions: tuple[str, ...]
    notes: tuple[str, ...]
    strain_limit: float
    study_wall_s: float | None
    provenance: Provenance
    dimensionless: Dimensionless | None = None
    lattice_limits: LatticeLimits | None = None
    control_point: ControlPoint | None = None
    budgets: tuple[ErrorBudget, ...] = ()
    tools: tuple[ToolForce, ...] = ()
    stages: tuple[StageRecord, ...] = ()
    workers: int = 1
    schema_version: int = SCHEMA_VERSION
