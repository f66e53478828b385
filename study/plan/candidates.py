"""Candidates for modelling a scene, with their predicted errors and costs.

To add one, write a function of the coarse solutions (`Look`) and a line in `CANDIDATES`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from fem_reference.memory import needed
from study.models.finite_elements import FRAME_RATE
from study.models.tissue import FRACTION, lacks_poisson_ratio
from study.plan.look import GradedLook, LatticeLook, Look
from study.plan.prediction import (
    CAUTION,
    COMPARED,
    GEOMETRY,
    MESH,
    REMAINDER,
    SPACING,
    SUBSPACE,
    TRUNCATION,
    Foresight,
    Part,
    Prediction,
)
from study.scene import Lattice, Scene

SIZES = (1.0, 0.75, 0.75**2, 0.75**3)
"""Element sizes over the scene's: levels of its organ."""
SPACINGS = (2.0, 1.5, 1.25, 1.0, 0.8, 2.0 / 3.0, 0.5)
"""Lattice spacings over the scene's."""
CORRECTED = (2.0, 1.5, 1.0)
VECTORS = 16
SOLUTIONS = 3.0
"""Measured cost of the Ritz vectors, in static solutions to full accuracy."""
REFERENCES = 2.0
"""Cost of a reference with its coarser meshes, in subspaces on the scene's own mesh."""
GROWTH = 1.2
"""Exponent of the unknowns in the cost of a solution."""
STREAM = 5e9
"""Numbers per second that a product with a few vectors reads on a current machine."""


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A way to model a scene.

    `scene`: with these models and settings; `step` [s] and `step_wall` [s]: of a step; `setup` [s]:
    with a reference where the error is unknown without one; `memory` [byte]: in addition to the
    program's; `leaves_out`: what is neglected, in words.
    """

    name: str
    scene: Scene
    prediction: Prediction
    step: float
    step_wall: float
    setup: float
    memory: float
    leaves_out: tuple[str, ...] = ()

    @property
    def is_linear(self) -> bool:
        """Whether it is limited to small displacements."""
        return any(part.cause == GEOMETRY for part in self.prediction.parts)

    @property
    def wall_per_s(self) -> float:
        """Wall time per simulated second."""
        return self.step_wall / self.step

    @property
    def wall(self) -> float:
        """Wall time of the whole run [s]."""
        return self.setup + self.wall_per_s * self.scene.time.duration


@dataclass(frozen=True)
class Omitted:
    """What cannot model a scene and is no candidate, by its `name`, and the `reason`."""

    name: str
    reason: str

    def __str__(self) -> str:
        return f"{self.name}: {self.reason}"


Kind = Callable[[Scene, Look, Foresight], Iterator[Candidate]]


def candidates(scene: Scene, look: Look, foresight: Foresight) -> list[Candidate]:
    """All candidates for a motion."""
    return [one for kind in CANDIDATES.values() for one in kind(scene, look, foresight)]


# --- finite elements in a subspace ---------------------------------------------------------------


def _superpositions(scene: Scene, look: Look, foresight: Foresight) -> Iterator[Candidate]:
    for times in SIZES:
        yield superposition(scene, look, foresight, times)


def superposition(scene: Scene, look: Look, foresight: Foresight, times: float) -> Candidate:
    """Ritz vectors of linear finite elements, with `times` the scene's element size."""
    parts = (
        Part(GEOMETRY, foresight.geometry),
        Part(MESH, foresight.mesh(times * _scene_size(look))),
        Part(TRUNCATION, SUBSPACE),
    )
    found = on_elements(scene, look, times)
    return replace(
        found,
        name=f"{VECTORS} Ritz vectors of finite elements of {_mm(found.scene)}",
        prediction=Prediction(parts),
        leaves_out=("large displacements", "any other place of the load"),
    )


def on_elements(scene: Scene, look: Look, times: float) -> Candidate:
    """A subspace of finite elements and its cost, without its error."""
    chosen = replace(
        scene.reference, element_size=times * scene.reference.element_size, accuracy=None
    )
    last = look.elements[-1]
    count = last.unknowns * (last.size / (times * _scene_size(look))) ** 3
    return Candidate(
        name="finite elements",
        scene=replace(scene, models=("superposition",), reference=chosen),
        prediction=Prediction(()),
        step=1.0 / FRAME_RATE,
        step_wall=VECTORS * count / STREAM,
        setup=SOLUTIONS * last.wall * (count / last.unknowns) ** GROWTH,
        memory=needed(int(count), "p2", stepping=False),
    )


def _scene_size(look: Look) -> float:
    """Size of the scene's own mesh, in the unit of its levels."""
    base = look.problem.geometry.level(0)
    assert base is not None  # noqa: S101 - the organ was built of it
    return base.size


def _mm(scene: Scene) -> str:
    return f"{1e3 * scene.reference.element_size:.3g} mm"


# --- lattices ------------------------------------------------------------------------------------


def _lattices(scene: Scene, look: Look, foresight: Foresight) -> Iterator[Candidate]:
    for times in SPACINGS:
        spacing = times * scene.lattice.spacing
        found = lattice(scene, look, spacing)
        compared = foresight.mesh(look.elements[-1].size)
        parts = (Part(SPACING, foresight.spacing(spacing)), Part(COMPARED, compared / CAUTION))
        yield replace(found, prediction=Prediction(parts))


def lattice_settings(scene: Scene, spacing: float) -> Lattice:
    """The scene's table of a lattice of a spacing [m], with steps that follow the limit."""
    return replace(
        scene.lattice,
        spacing=spacing,
        springs="lattice",
        volume_term=lacks_poisson_ratio(scene),
        time_step=None,
        step_rate=None,
    )


def lattice(scene: Scene, look: Look, spacing: float) -> Candidate:
    """The lattice of the tissue's modulus at a spacing [m], stepped explicitly, and its cost."""
    seen = _nearest(look, spacing)
    finer = seen.spacing / spacing
    chosen = replace(lattice_settings(scene, spacing), step_fraction=FRACTION)
    return Candidate(
        name=lattice_name(spacing),
        scene=replace(scene, models=("fem", "tissue"), lattice=chosen),
        prediction=Prediction(()),
        step=FRACTION * seen.critical / finer,
        step_wall=look.wall_per_spring * seen.springs * finer**3,
        setup=REFERENCES * on_elements(scene, look, 1.0).setup,
        memory=seen.nbytes * finer**3,
    )


def lattice_name(spacing: float) -> str:
    """Of a uniform lattice of a spacing [m]."""
    return f"lattice of {1e3 * spacing:.3g} mm"


def _nearest(look: Look, spacing: float) -> LatticeLook:
    return min(look.lattices, key=lambda one: abs(one.spacing - spacing))


# --- a coarse lattice corrected by finite elements ------------------------------------------------


def _corrected(scene: Scene, look: Look, foresight: Foresight) -> Iterator[Candidate]:
    for size in SIZES:
        for times in CORRECTED:
            yield corrected(scene, look, foresight, size, times * scene.lattice.spacing)


def corrected(
    scene: Scene, look: Look, foresight: Foresight, size: float, spacing: float
) -> Candidate:
    """A coarse lattice, and the difference of finite elements from its own linear motion."""
    coarse = lattice(scene, look, spacing)
    parts = (Part(REMAINDER, foresight.remainder(spacing)),)
    found = _sum(scene, look, foresight, size, coarse, parts)
    chosen = replace(scene.corrected, spacing=spacing, coarse="uniform")
    return replace(found, scene=replace(found.scene, corrected=chosen))


def _sum(
    scene: Scene,
    look: Look,
    foresight: Foresight,
    size: float,
    coarse: Candidate,
    parts: tuple[Part, ...],
) -> Candidate:
    """A coarse lattice with these errors, and finite elements with `times` the scene's size."""
    fine = on_elements(scene, look, size)
    own = (Part(MESH, foresight.mesh(size * _scene_size(look))), Part(TRUNCATION, SUBSPACE))
    return Candidate(
        name=f"{coarse.name}, corrected by finite elements of {_mm(fine.scene)}",
        scene=replace(fine.scene, models=("corrected",)),
        prediction=Prediction((*parts, *own)),
        step=coarse.step,
        step_wall=coarse.step_wall + 2.0 * fine.step_wall,
        setup=fine.setup,
        memory=2.0 * coarse.memory + fine.memory,
        leaves_out=("any other place of the load",),
    )


# --- graded lattices, alone and corrected ---------------------------------------------------------


def _regions(scene: Scene, look: Look, foresight: Foresight) -> Iterator[Candidate]:
    compared = foresight.mesh(look.elements[-1].size)
    for one in look.graded:
        found = region(scene, look, one)
        parts = (Part(SPACING, foresight.graded(one)), Part(COMPARED, compared / CAUTION))
        yield replace(found, prediction=Prediction(parts))


def region(scene: Scene, look: Look, one: GradedLook) -> Candidate:
    """One of the solved graded lattices, stepped explicitly, and its cost."""
    seen = one.lattice
    plain = lattice(scene, look, scene.lattice.spacing)
    graded = replace(scene.region, spacing=seen.spacing, radius=one.radius, levels=one.levels)
    return replace(
        plain,
        name=f"lattice of {1e3 * seen.spacing:.3g} mm to {1e3 * one.radius:.3g} mm from the tool "
        "and coarser beyond",
        scene=replace(plain.scene, models=("fem", "region"), region=graded),
        step=FRACTION * seen.critical,
        step_wall=one.step_wall,
        memory=float(seen.nbytes),
        leaves_out=("small cells away from the tool",),
    )


def _corrected_regions(scene: Scene, look: Look, foresight: Foresight) -> Iterator[Candidate]:
    """All except the one that gives the others' error."""
    for size in SIZES:
        for one in look.graded[:-1]:
            coarse = region(scene, look, one)
            parts = (Part(REMAINDER, foresight.graded_remainder(one)),)
            chosen = replace(scene.corrected, spacing=None, coarse="graded")
            found = _sum(scene, look, foresight, size, coarse, parts)
            given = replace(found.scene, corrected=chosen, region=coarse.scene.region)
            yield replace(found, scene=given)


CANDIDATES: dict[str, Kind] = {
    "superposition": _superpositions,
    "corrected": _corrected,
    "corrected-graded": _corrected_regions,
    "region": _regions,
    "lattice": _lattices,
}


# --- at rest --------------------------------------------------------------------------------------


def resting(scene: Scene, look: Look, foresight: Foresight) -> Iterator[Candidate]:
    """Candidates for rest under the full load: finite elements, and their correction."""
    for times in SIZES:
        found = on_elements(scene, look, times)
        wall = found.setup / SOLUTIONS
        mesh = Part(MESH, foresight.mesh(times * _scene_size(look)))
        chosen = replace(found, scene=replace(found.scene, models=("fem",)), setup=wall)
        yield replace(
            chosen,
            name=f"finite elements of {_mm(found.scene)}, solved once",
            prediction=Prediction((Part(GEOMETRY, foresight.geometry), mesh)),
            leaves_out=("large displacements", "inertia and damping"),
        )
        remainder = Part(REMAINDER, foresight.remainder(scene.lattice.spacing))
        yield replace(
            chosen,
            name=f"finite elements of {_mm(found.scene)}, and large displacements by a lattice of "
            f"{1e3 * scene.lattice.spacing:.3g} mm",
            prediction=Prediction((remainder, mesh)),
            setup=2.0 * wall,  # the lattice is at rest after some hundred steps
            leaves_out=("inertia and damping",),
        )
