"""Scene: all inputs of a study of one organ under its tools, in SI units.

A scene is written as TOML; `study.scene.file` reads, checks and writes it. The annotations state
the unit and the allowed range of each quantity.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

from study.annotation.choice import Choice
from study.annotation.quantity import Quantity
from study.problem.history import LoadHistory
from study.problem.tissue import Tissue
from study.scene.law import SpringLaw

Length = Annotated[float, Quantity("m", 1e-6, 10.0)]
Share = Annotated[float, Quantity("", 0.0, 1.0)]
Reading = Annotated[float, Quantity("Pa", 500.0, 150e3)]
Coordinate = Annotated[float, Quantity("m", -10.0, 10.0)]

Number = Annotated[float, Quantity("", -1e12, 1e12)]
Component = Annotated[float, Quantity("", -1.0, 1.0)]

TOOL_POINT, END_POINT = "tool", "tool-end"
"""Names of the default control points: at the tool, and where its path ends."""

Side = Literal["right", "left", "anterior", "posterior", "inferior", "superior"]
SystemName = Annotated[str, Choice("fuzzy.systems.kinds:SYSTEMS")]
ModelName = Annotated[str, Choice("study.models.table:MODELS")]
IntegratorName = Annotated[str, Choice("msm.integrators:INTEGRATORS", ("symplectic-euler",))]
ElementName = Annotated[str, Choice("fem_reference.elements:CHOICES", ("auto",))]
MethodName = Annotated[str, Choice("fem_reference.model:METHODS", ("ritz-vectors",))]
LargeStrain = Annotated[str, Choice("fem_reference.laws:LARGE_STRAIN", ("neo-hookean",))]
SuitedKey = Literal[
    "support.depth",
    "support.stiffness",
    "tool.radius",
    "tool.force",
    "tool.displacement",
    "lattice.spacing",
    "reference.element_size",
]
Quantities = Literal["rest", "history", "field", "peak-force"]
Aetiology = Annotated[str, Choice("fuzzy.liver.table1:AETIOLOGIES")]


@dataclass(frozen=True, kw_only=True)
class Place:
    """A place on or in the organ, given in one of three ways.

    `side` and `at`: seen from that side, two fractions of the bounding box along its other axes (in
    the order x, y, z), on the first surface met. `fraction`: three fractions of the bounding box.
    `point`: coordinates [m]. The last two move to the nearest surface if `snap` is set.
    """

    side: Side | None = None
    at: tuple[Share, Share] | None = None
    fraction: tuple[Share, Share, Share] | None = None
    point: tuple[Coordinate, Coordinate, Coordinate] | None = None
    snap: bool = True


@dataclass(frozen=True, kw_only=True)
class Organ:
    """The shape: a built-in one, or a mesh file, which takes precedence.

    `volume` scales the built-in liver, `size` is the block's. `point` is a single control mass
    point without a mesh; its `mass`, if not given, is such that eq. (2) at the scene's damping
    ratio meets the benchmark's gamma_0. For a mesh file: its length `unit`; its `axes`, the sides
    of the patient to which x, y and z point, for example RAS, with LPS as default; whether the
    largest of several `pieces` is kept or they are refused; keys of the scene to `suit` to it
    (`study.run.suiting`): in a built-in scene those that are not overridden.
    """

    shape: Literal["liver", "block", "point"] = "liver"
    volume: Annotated[float, Quantity("m^3", 1e-9, 10.0)] = 1.5e-3
    size: tuple[Length, Length, Length] = (0.12, 0.08, 0.06)
    mass: Annotated[float, Quantity("kg", 1e-6, 100.0)] | None = None
    mesh: str | None = None
    unit: str | None = None
    axes: str | None = None
    pieces: Literal["one", "largest"] = "one"
    suit: tuple[SuitedKey, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Support:
    """What holds the surface that faces `side`, down to `depth` from its extreme point.

    Or, with a `place`, the surface within a `radius` of it, whatever its orientation. A foundation
    is elastic, its `stiffness` a traction per displacement [Pa/m]; a clamped surface is fixed, a
    sliding one is fixed along the line to `side`.
    """

    kind: Annotated[str, Choice("study.problem.supports:KINDS")] = "foundation"
    side: Side = "posterior"
    depth: Length = 0.03
    place: Place | None = None
    radius: Length | None = None
    stiffness: Annotated[float, Quantity("Pa/m", 1.0, 1e12)] = 2e6


@dataclass(frozen=True, kw_only=True)
class Inclusion:
    """Tissue with another stiffness than the surrounding tissue, to which an estimate refers.

    A ball of a `radius` or an ellipsoid of `semi_axes` along x, y and z about a `place`, or the
    inside of a closed `mesh`, in its `unit` and `axes` as for the organ's file. Poisson ratio and
    density are those of the surrounding tissue unless given.
    """

    youngs_modulus: Annotated[float, Quantity("Pa", 10.0, 1e9)]
    poisson_ratio: Annotated[float, Quantity("", 0.0, 0.49999)] | None = None
    density: Annotated[float, Quantity("kg/m^3", 100.0, 20_000.0)] | None = None
    place: Place | None = None
    radius: Length | None = None
    semi_axes: tuple[Length, Length, Length] | None = None
    mesh: str | None = None
    unit: str | None = None
    axes: str | None = None


@dataclass(frozen=True, kw_only=True)
class StiffnessMap:
    """A modulus at each voxel of a NIfTI image, as from elastography.

    `quantity` in a `unit`; Young's modulus follows from a shear modulus with the tissue's Poisson
    ratio. The image's own affine maps voxels to millimetres in RAS. Where it has no value, or none
    above zero, the surrounding tissue applies, or the scene is refused, as `elsewhere` says.
    """

    file: str
    quantity: Literal["youngs-modulus", "shear-modulus"]
    unit: Literal["Pa", "kPa", "MPa"]
    elsewhere: Literal["around", "refused"] = "around"


@dataclass(frozen=True, kw_only=True)
class OrganTissue(Tissue):
    """The tissue of the organ and its heterogeneity; an inclusion takes precedence over the map."""

    inclusion: tuple[Inclusion, ...] = ()
    stiffness_map: StiffnessMap | None = None

    @property
    def highest_poisson_ratio(self) -> float:
        """The largest of all parts."""
        return max([self.poisson_ratio, *(one.poisson_ratio or 0.0 for one in self.inclusion)])


@dataclass(frozen=True, kw_only=True)
class Waypoint:
    """Position of a tool at a time: along its direction, or as an offset in x, y and z.

    For a rigid tool the position of its tip. A blunt tool has offsets only, whose part across its
    push counts.
    """

    time: Annotated[float, Quantity("s", 0.0, 3600.0)]
    travel: Coordinate | None = None
    offset: tuple[Coordinate, Coordinate, Coordinate] | None = None


@dataclass(frozen=True, kw_only=True)
class Tool:
    """A tool: where it touches, which way it faces (inwards by default), and what drives it.

    A blunt tool is a smooth pressure of a given `force`, over time as its `history`; on a `path` it
    travels over the surface, starting at its `place`. The other shapes are rigid and moved: by a
    `displacement` along the direction, over time as its `history`, or on a `path` of straight
    pieces; their tip starts at `place`, with a `clearance` from the surface. `contact`: bonded to
    what they touch at the start, or unilateral, with Coulomb's coefficient `friction`.
    """

    place: Place = field(default_factory=lambda: Place(side="anterior", at=(0.3, 0.5)))
    direction: tuple[Component, Component, Component] | None = None
    shape: Annotated[str, Choice("study.problem.rigid:TOOLS")] = "blunt"
    radius: Length = 0.025
    force: Annotated[float, Quantity("N", 1e-9, 1e3)] = 0.5
    displacement: Annotated[float, Quantity("m", -10.0, 10.0)] | None = None
    path: tuple[Waypoint, ...] = ()
    clearance: Annotated[float, Quantity("m", 0.0, 1.0)] = 0.0
    contact: Annotated[str, Choice("study.problem.rigid:CONTACTS")] = "sliding"
    friction: Annotated[float, Quantity("", 0.0, 10.0)] = 0.0
    history: LoadHistory = field(default_factory=LoadHistory)

    @property
    def is_moved(self) -> bool:
        """Whether it is a rigid tool, whose force is a result."""
        return self.shape != "blunt"

    @property
    def travels(self) -> bool:
        """Whether it is a blunt tool whose place changes."""
        return not self.is_moved and bool(self.path)


@dataclass(frozen=True, kw_only=True)
class Gravity:
    """Gravity of an `acceleration` `towards` a side of the organ.

    `given`: whether the shape is that of the unloaded organ, or that at rest under gravity.
    """

    acceleration: Annotated[float, Quantity("m/s^2", 0.0, 1000.0)] = 0.0
    towards: Side = "posterior"
    given: Literal["unloaded", "loaded"] = "unloaded"


@dataclass(frozen=True, kw_only=True)
class AttachedWeight:
    """A body of a mass attached to a patch of the surface."""

    place: Place
    mass: Annotated[float, Quantity("kg", 1e-9, 100.0)]
    radius: Length = 0.01


@dataclass(frozen=True, kw_only=True)
class Patient:
    """Elastography reading per aetiology [Pa]; `fuzzy.absent` says what a missing one means."""

    hcv: Reading | None = None
    hbv: Reading | None = None
    ald: Reading | None = None
    cld: Reading | None = None
    nafld: Reading | None = None


@dataclass(frozen=True, kw_only=True)
class Fuzzy:
    """The fuzzy systems that estimate the stiffness, and the interpretations of the paper they use.

    `knowledge`: the base of sets and rules. For the base severity: `reading` of Table I by name,
    `consequent` of a combination, `placement` of the sets on elastography data. `footprint` of
    uncertainty and its factor on the published spread, the meaning of an `absent` reading; then how
    the systems are evaluated. `surface`: the two readings of the output surfaces.
    `sensitivity_readings`: readings over which each of these choices is varied. `rule_base`: a
    fuzzy system of the user's (.fis or .json) instead, which answers in `unit` to `inputs`, its
    readings by name in its own units.
    """

    systems: tuple[SystemName, ...] = ("mamdani", "sugeno", "interval-type-2")
    knowledge: Annotated[str, Choice("fuzzy.liver.bases:KNOWLEDGE")] = "freed"
    reading: str = "R1"
    consequent: Annotated[str, Choice("fuzzy.liver.rules:CONSEQUENTS")] = "max"
    placement: Annotated[str, Choice("fuzzy.liver.knowledge:PLACEMENTS")] = "stage-mean"
    footprint: Annotated[str, Choice("fuzzy.liver.settings:FOOTPRINTS")] = "uncertain-mean"
    footprint_factor: Annotated[float, Quantity("", 0.0, 3.0)] = 1.0
    absent: Annotated[str, Choice("fuzzy.liver.settings:ABSENT")] = "auto"
    sampling: Annotated[str, Choice("fuzzy.systems.quadrature:SAMPLINGS")] = "matlab"
    samples: Annotated[int, Quantity("", 11, 100_001)] = 101
    sugeno_aggregation: Annotated[str, Choice("fuzzy.systems.system:MERGES")] = "sum"
    reducer: Annotated[str, Choice("fuzzy.systems.type_reduction:REDUCERS")] = "karnik-mendel"
    out_of_range: Annotated[str, Choice("fuzzy.systems.options:OUT_OF_RANGE")] = "clamp"
    surface: tuple[Aetiology, Aetiology] = ("hcv", "hbv")
    sensitivity_readings: Annotated[int, Quantity("", 0, 4096)] = 256
    rule_base: str | None = None
    inputs: dict[str, Number] = field(default_factory=dict)
    unit: Annotated[str, Choice("study.scene.answer_units:UNITS")] = "kPa"


@dataclass(frozen=True, kw_only=True)
class Lattice:
    """Mass-spring lattice: spacing, share of axial stiffness in flexion and in body diagonals.

    `springs`: those of a cubic lattice of this spacing, or one along each edge of the organ's
    finite-element mesh. `law` of the fuzzy-tuned springs, linear if none is given. `volume_term`
    gives these models the tissue's Poisson ratio; without it every cubic lattice of springs has
    1/4. `geometry`: whether forces follow the deformed lattice. `precision` of the steps; the error
    of single precision is measured by a second run in double. The step is at most `step_fraction`
    of the critical one, which is updated as the body deforms, unless `time_step` or `step_rate`
    fixes it.
    """

    springs: Literal["lattice", "tetrahedra"] = "lattice"
    spacing: Length = 0.01
    flexion: Annotated[float, Quantity("", 0.0, 0.9)] = 0.2
    body_diagonals: Annotated[float, Quantity("", 0.0, 0.9)] = 0.0
    law: SpringLaw | None = None
    volume_term: bool = False
    geometry: Literal["nonlinear", "linear"] = "nonlinear"
    integrator: IntegratorName = "symplectic-euler"
    precision: Literal["double", "single"] = "double"
    step_fraction: Annotated[float, Quantity("", 1e-4, 10.0)] = 0.8
    time_step: Annotated[float, Quantity("s", 1e-9, 10.0)] | None = None
    step_rate: Annotated[float, Quantity("Hz", 0.1, 1e9)] | None = None


@dataclass(frozen=True, kw_only=True)
class Damping:
    """Damping of the fuzzy-tuned models and of the reference; the benchmark has that of eq. (9).

    `ratio`: zeta of eq. (2); `mass` and `stiffness`: Rayleigh's alpha and beta, C = alpha M +
    beta K. `reference_spacing`: where k and m of eq. (2) and Table II are taken.
    """

    kind: Literal["eq-2", "rayleigh"] = "eq-2"
    ratio: Annotated[float, Quantity("", 0.0, 100.0)] = 0.9
    mass: Annotated[float, Quantity("s^-1", 0.0, 1e6)] = 0.0
    stiffness: Annotated[float, Quantity("s", 0.0, 100.0)] = 0.0
    reference_spacing: Length = 5.5e-3


@dataclass(frozen=True, kw_only=True)
class BasafaConstants:
    """Table II: constants of eqs. (5)-(9) at `damping.reference_spacing`."""

    k1: Annotated[float, Quantity("N", 1e-9, 1e6)] = 0.05
    k2: Annotated[float, Quantity("N", 0.0, 1e9)] = 10.0
    x_c: Annotated[float, Quantity("", 1e-6, 10.0)] = 0.2
    gamma_0: Annotated[float, Quantity("N*s/m", 0.0, 1e6)] = 2.0
    gamma_1: Annotated[float, Quantity("N*s/m^2", 0.0, 1e9)] = 1000.0


@dataclass(frozen=True, kw_only=True)
class Reference:
    """Finite-element reference: elements, their size (edge of the mesh lattice), time method.

    With `accuracy`, a relative error, the mesh is refined until the displacement of each control
    point is estimated to be as accurate. `element`: auto is quadratic, with a pressure field above
    a Poisson ratio of 0.48. `method`: superposition of load-dependent Ritz vectors or of `modes`
    modes of vibration, or steps of TR-BDF2 or HHT-alpha. `steps_per_sample`: of these, or for the
    load of a superposition 16 times as many; by default as many steps as the motion needs, however
    often it is sampled. `large_strain`: law of a static solution for comparison, where strains
    exceed the validity of linear elasticity.
    """

    element: ElementName = "auto"
    element_size: Length = 0.017
    accuracy: Annotated[float, Quantity("", 1e-4, 1.0)] | None = None
    refinement: Literal["auto", "uniform", "graded"] = "auto"
    method: MethodName = "ritz-vectors"
    modes: Annotated[int, Quantity("", 1, 1000)] = 100
    steps_per_sample: Annotated[int, Quantity("", 1, 100)] | None = None
    large_strain: LargeStrain = "neo-hookean"


@dataclass(frozen=True, kw_only=True)
class Superposition:
    """Settings of the model of that name: Ritz vectors or modes, and their number.

    `certificate`: vectors of a longer Krylov space that bounds the error of these few; 0 for no
    bound.
    """

    vectors: Literal["ritz", "modal"] = "ritz"
    count: Annotated[int, Quantity("", 1, 400)] = 16
    certificate: Annotated[int, Quantity("", 0, 1000)] = 128


@dataclass(frozen=True, kw_only=True)
class Corrected:
    """Settings of the model of that name: `spacing` of its coarse lattice.

    By default twice `lattice.spacing`. `coarse`: uniform, or graded as the table `region` says,
    without a `spacing`.
    """

    spacing: Length | None = None
    coarse: Literal["uniform", "graded"] = "uniform"


@dataclass(frozen=True, kw_only=True)
class Region:
    """Settings of the model of that name: `spacing` of its finest cells.

    By default half of `lattice.spacing`. They extend to `radius` from the tools and from the
    control points `at`, or as far as `tolerance` requires, a relative difference from the finest
    cells throughout. Beyond, cells double up to `levels` sizes in all.
    """

    spacing: Length | None = None
    levels: Annotated[int, Quantity("", 1, 6)] = 3
    radius: Length | None = None
    tolerance: Annotated[float, Quantity("", 1e-4, 1.0)] = 0.02
    at: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Time:
    """Simulated time and number of equally spaced samples, both ends included."""

    duration: Annotated[float, Quantity("s", 1e-6, 3600.0)] = 10.0
    samples: Annotated[int, Quantity("", 16, 20_001)] = 201


@dataclass(frozen=True, kw_only=True)
class Require:
    """Requirements of a scene, from which `study.plan` derives what is modelled.

    `quantities`: the rest under the full load, the history of the motion, the largest force of
    moved tools, and with "field" the whole organ beside the control points `at`, all by default.
    `error`: relative, the largest of these; `rate`: states per second in real time; `memory` in
    addition to the program's own.
    """

    quantities: tuple[Quantities, ...] = ("history",)
    at: tuple[str, ...] = ()
    error: Annotated[float, Quantity("", 1e-4, 1.0)] | None = None
    rate: Annotated[float, Quantity("Hz", 0.1, 1e5)] | None = None
    memory: Annotated[float, Quantity("byte", 1e6, 1e13)] | None = None

    @property
    def moves(self) -> bool:
        """Whether a motion is required, and not only the state at rest."""
        return not {"history", "peak-force"}.isdisjoint(self.quantities)


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A whole scene. `models`: `msm` stands for one mass-spring model per fuzzy system.

    `tool`: the first, or in a file [[tool]], each of several; `further_tools` are the others;
    likewise `support`. `remarks`: sentences that are added to the notes of its results.
    """

    __pydantic_config__ = {"extra": "forbid"}  # noqa: RUF012 - pydantic's name; nested ones inherit

    title: str = ""
    models: tuple[ModelName, ...] = ("fem", "basafa", "msm")
    organ: Organ = field(default_factory=Organ)
    support: Support = field(default_factory=Support)
    further_supports: tuple[Support, ...] = ()
    tool: Tool = field(default_factory=Tool)
    further_tools: tuple[Tool, ...] = ()
    gravity: Gravity = field(default_factory=Gravity)
    weight: tuple[AttachedWeight, ...] = ()
    tissue: OrganTissue = field(default_factory=OrganTissue)
    patient: Patient = field(default_factory=Patient)
    fuzzy: Fuzzy = field(default_factory=Fuzzy)
    lattice: Lattice = field(default_factory=Lattice)
    damping: Damping = field(default_factory=Damping)
    basafa: BasafaConstants = field(default_factory=BasafaConstants)
    reference: Reference = field(default_factory=Reference)
    superposition: Superposition = field(default_factory=Superposition)
    corrected: Corrected = field(default_factory=Corrected)
    region: Region = field(default_factory=Region)
    time: Time = field(default_factory=Time)
    control_points: dict[str, Place] = field(default_factory=dict)
    require: Require | None = None
    renders: bool = True
    remarks: tuple[str, ...] = ()

    @property
    def tools(self) -> tuple[Tool, ...]:
        """All tools."""
        return (self.tool, *self.further_tools)

    @property
    def probes(self) -> tuple[str, ...]:
        """Names of the control points of an organ; without an end for a path that returns."""
        path = self.tool.path
        ends = (END_POINT,) if self.tool.travels and path[-1].offset != path[0].offset else ()
        return tuple(self.control_points) or (TOOL_POINT, *ends)

    @property
    def supports(self) -> tuple[Support, ...]:
        """All supports."""
        return (self.support, *self.further_supports)

    @property
    def features(self) -> tuple[str, ...]:
        """Features that not every model supports: names of `study.problem.features.FEATURES`."""
        asked = {
            "moved-tools": any(tool.is_moved for tool in self.tools),
            "several-loads": any(not tool.is_moved for tool in self.further_tools),
            "travelling-loads": any(tool.travels for tool in self.tools),
            "gravity": self.gravity.acceleration > 0.0,
            "weights": bool(self.weight),
            "inclusions": bool(self.tissue.inclusion) or self.tissue.stiffness_map is not None,
            "fixed-surfaces": any(one.kind != "foundation" for one in self.supports),
        }
        return tuple(name for name, present in asked.items() if present)

    @property
    def is_graded(self) -> bool:
        """Whether meshes of the reference are finer where the error comes from."""
        asked = self.reference.refinement
        grades = self.organ.mesh is not None or any(tool.is_moved for tool in self.tools)
        return asked == "graded" or (asked == "auto" and grades)

    @property
    def is_point(self) -> bool:
        """Whether it is a single control mass point, without an organ."""
        return self.organ.shape == "point" and self.organ.mesh is None
