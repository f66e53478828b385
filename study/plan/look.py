"""Coarse solutions of a scene: lattices and finite elements at rest under the full load.

They take seconds, and give predictions of the cost and error of expensive solutions.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fem_reference.elements import chosen_element
from fem_reference.memory import unknowns
from fem_reference.observation import at_points, evaluation, largest_strain
from fem_reference.solvers import solve_static
from msm.assembly import arrays
from msm.relaxation import relax
from msm.statics import static_displacement
from study.models.finite_elements import PreparedElements, reference_of
from study.models.lattice import LatticeModel, PreparedLattice
from study.models.table import model
from study.models.tissue import lacks_poisson_ratio
from study.problem.problem import Problem
from study.scene import Scene
from study.scene.graded import unfit

Floats = NDArray[np.float64]

SPACINGS = (2.0, 1.5, 1.0)
"""Spacings of the lattices, over that of the scene."""


class Grading(NamedTuple):
    """Sizes of the cells of a graded lattice.

    `finest`: their least edge, over the scene's spacing; `levels`: number of sizes; `reach`: radius
    of the finest cells, over that of the tool.
    """

    finest: float
    levels: int
    reach: float


GRADINGS = (
    Grading(1.0, 2, 1.0),
    Grading(2.0 / 3.0, 3, 1.5),
    Grading(0.5, 3, 0.6),
    Grading(0.5, 3, 1.0),
    Grading(0.5, 3, 1.5),
)
"""The graded lattices; the others are compared with the last."""
LEVELS = (-1, 0, 1)
MOST_UNKNOWNS = 30_000
"""Largest coarse mesh, which takes a few seconds; one is solved whatever its size."""
AT_REST = 1e-5
"""Residual of a lattice at rest, relative to its load."""
STEPS, TURNS = 40, 3
"""Steps timed together, and repetitions: the least time is used, with the least disturbance."""


@dataclass(frozen=True)
class Rest:
    """Displacement [m] at the control points (p, 3) and over the organ (q, 3)."""

    probes: Floats
    field: Floats

    def plus(self, other: Rest, times: float = 1.0) -> Rest:
        """The sum of this and `times` another."""
        return Rest(self.probes + times * other.probes, self.field + times * other.field)


@dataclass(frozen=True)
class LatticeLook:
    """A lattice of a spacing [m] at rest: linear and, if it converged, nonlinear.

    `critical`: its critical step [s]; `nbytes`: size of its arrays.
    """

    spacing: float
    nodes: int
    springs: int
    critical: float
    nbytes: int
    linear: Rest
    nonlinear: Rest | None


@dataclass(frozen=True)
class GradedLook:
    """A graded lattice of so many `levels` at rest.

    `radius` [m]: of its finest cells; `step_wall`: its step time [s].
    """

    levels: int
    radius: float
    lattice: LatticeLook
    step_wall: float


@dataclass(frozen=True)
class ElementsLook:
    """Finite elements of a `size` [m] at rest, and the time [s] of the solution."""

    level: int
    size: float
    unknowns: int
    wall: float
    rest: Rest


@dataclass(frozen=True)
class Look:
    """Solutions from coarse to fine, and the step time of the finest lattice per spring [s].

    `strain`: the largest of the finite elements.
    """

    problem: Problem
    lattices: tuple[LatticeLook, ...]
    elements: tuple[ElementsLook, ...]
    strain: float
    wall_per_spring: float
    graded: tuple[GradedLook, ...] = ()


def look(scene: Scene, problem: Problem) -> Look:
    """Solve the coarse models. ValueError where support or tool misses even the coarsest one."""
    elements, strain = _elements(scene, problem)
    lattices = [on_lattice(scene, problem, times) for times in SPACINGS]
    return Look(
        problem,
        tuple(lattice_at_rest(one) for one in lattices),
        elements,
        strain,
        _step_wall(lattices[-1]) / len(lattices[-1].assembly.springs.weight),
        tuple(_graded_at_rest(scene, problem)),
    )


def _graded_at_rest(scene: Scene, problem: Problem) -> Iterator[GradedLook]:
    """Those of GRADINGS; none for settings without support."""
    if any(unfit(scene.lattice)):
        return
    region = model(scene, "region")
    assert isinstance(region, LatticeModel)  # noqa: S101 - it is one by its kind
    for finest, levels, reach in GRADINGS:
        spacing, radius = finest * scene.lattice.spacing, reach * scene.tool.radius
        prepared = region.varied(
            spacing=spacing,
            levels=levels,
            radius=radius,
            volume_term=lacks_poisson_ratio(scene),
        ).prepare(problem)
        seen = replace(lattice_at_rest(prepared), spacing=spacing)
        yield GradedLook(levels, radius, seen, _step_wall(prepared))


def _elements(scene: Scene, problem: Problem) -> tuple[tuple[ElementsLook, ...], float]:
    found: list[ElementsLook] = []
    strain = 0.0
    for level, size, prepared in meshes(scene, problem):
        one, strain = _at_rest(prepared, level, size)
        found.append(one)
    return tuple(found), strain


def meshes(scene: Scene, problem: Problem) -> Iterator[tuple[int, float, PreparedElements]]:
    """Number, size and elements of each coarse mesh, from coarse to fine."""
    found = 0
    for level in LEVELS:
        at = problem.geometry.level(level)
        element = chosen_element(scene.reference.element, problem.tissue.highest_poisson_ratio)
        if at is None or (found and unknowns(at.mesh, element) > MOST_UNKNOWNS):
            continue
        found += 1
        yield level, at.size, reference_of(scene).varied(level=level).prepare(problem)


def _at_rest(prepared: PreparedElements, level: int, size: float) -> tuple[ElementsLook, float]:
    started = time.perf_counter()
    body = prepared.body()
    u = solve_static(body)
    wall = time.perf_counter() - started
    seen = prepared.problem.observation
    rest = Rest(
        *(at_points(evaluation(body, points), u) for points in (seen.probes, seen.volume_points))
    )
    return ElementsLook(level, size, body.unknowns, wall, rest), largest_strain(body, u)


def on_lattice(scene: Scene, problem: Problem, times: float) -> PreparedLattice:
    """A lattice of the tissue's modulus, with `times` the scene's spacing."""
    tissue = model(scene, "tissue")
    assert isinstance(tissue, LatticeModel)  # noqa: S101 - it is one by its kind
    spacing = times * scene.lattice.spacing
    return tissue.varied(spacing=spacing, volume_term=lacks_poisson_ratio(scene)).prepare(problem)


def lattice_at_rest(prepared: PreparedLattice) -> LatticeLook:
    """A lattice under the full load, linear and nonlinear."""
    assembly, material = prepared.assembly, prepared.springs.material
    net = arrays(assembly, material)
    large, how = relax(material.law, net, tolerance=AT_REST)
    return LatticeLook(
        prepared.model.lattice.spacing,
        len(assembly.mass),
        len(assembly.springs.weight),
        prepared.critical_time_step,
        sum(part.nbytes for part in net if isinstance(part, np.ndarray)),
        _seen(prepared, static_displacement(assembly, material)),
        _seen(prepared, large) if how.status == "at rest" else None,
    )


def _seen(prepared: PreparedLattice, nodal: Floats) -> Rest:
    """A nodal displacement (n, 3) at the points of observation."""
    seen, lattice = prepared.problem.observation, prepared.assembly.lattice
    places = seen.probes, seen.volume_points
    return Rest(*(np.asarray(lattice.interpolation(points)[0] @ nodal) for points in places))


def _step_wall(prepared: PreparedLattice) -> float:
    """Wall time of a step of a run [s]."""
    stepper = prepared.stepper()
    walls = []
    for _ in range(TURNS):
        started = time.perf_counter()
        for _ in range(STEPS):
            stepper.take_step()
        walls.append(time.perf_counter() - started)
    return min(walls) / STEPS
