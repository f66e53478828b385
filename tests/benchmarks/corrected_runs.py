"""Motions at a place of the tool on the built-in liver: linear elements, and lattices by spacing.

A run of the sweep of `tests.benchmarks.corrected_places`, which makes a table of many. What does
not depend on the place is made once in a process.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse import csr_array

from fem_reference.assembly import rows
from fem_reference.elasticity import Body, discretise, loaded_surface
from fem_reference.elements import AUTO
from fem_reference.observation import at_points, evaluation, largest_strain
from fem_reference.subspace import Subspace, ritz_subspace, superposition
from msm import model as msm
from msm.assembly import contact
from msm.model import Counts, Run
from study.models.corrected import CorrectedLattice
from study.models.damping import reference_damping
from study.models.lattice import PreparedLattice, requested_step
from study.models.remainder import PreparedRemainder
from study.models.table import model
from study.problem.problem import Problem
from study.scene import LoadHistory, Place, Scene
from study.scene.file import read_scene
from study.scene.place import resolve
from study.scene.problem import problem_of
from study.sweep.canonical import Plain

Floats = NDArray[np.float64]

FUNCTION = f"{__name__}:observe"
SPACINGS = (0.04, 0.03, 0.02, 0.015, 0.04 / 3, 0.01, 0.008, 0.02 / 3, 0.005)
"""Of the lattices [m]; the last is the truth of what the others add to the linear motion."""
CORRECTING = SPACINGS[:6]
"""Those whose linear part is taken in few vectors, as the corrected lattice takes it."""
LEVEL = 1
"""Mesh of the linear elements, one finer than that of the scene."""
VECTORS = 10
INSIDE = 16
"""Steps of the load of the linear elements in a sample."""
RAMP, DURATION, SAMPLES = 0.3, 0.8, 33
DIGITS = 7


@dataclass(frozen=True)
class Observed:
    """What one place gives, curves [m] flat, of the tool's control point (samples, 3).

    `force` [N]; `linear`: of the finite elements, and `rest` [m] (3,) of them under the full load.
    """

    force: float
    linear: list[float | None]
    rest: list[float | None]
    lattices: list[ObservedLattice]


@dataclass(frozen=True)
class ObservedLattice:
    """One lattice: its own curve, the part of it beyond itself linear, and its linear rest."""

    spacing: float
    nodes: int
    nonlinear: list[float | None]
    remainder: list[float | None]
    rest: list[float | None]
    largest_strain: float
    inverted_cells: int
    truncation: float
    status: str


def observe(at: list[float], radius: float, strain: float) -> Plain:
    """Everything at one place, loaded until the linear elements strain by so much at most."""
    unit = under_tool(at, radius, 1.0)
    body = pressed(unit)
    among = ritz_subspace(body, VECTORS)
    force = strain / largest_strain(body, among.rest())
    problem = replace(unit, tool=replace(unit.tool, force=force))
    weights = evaluation(body, problem.observation.probes)
    found = Observed(
        force,
        plain(force * linear_curve(problem, among, weights)),
        plain(force * at_points(weights, among.rest())),
        [observed(problem, spacing) for spacing in SPACINGS],
    )
    return {**vars(found), "lattices": [vars(one) for one in found.lattices]}


def scene() -> Scene:
    """The built-in liver, whatever its tool, with the damping of a lattice with volume term."""
    found = read_scene("liver")
    history = LoadHistory(kind="ramp-hold-release", ramp=RAMP, hold=6.0, release=1.0)
    return replace(
        found,
        tool=replace(found.tool, history=history),
        time=replace(found.time, duration=DURATION, samples=SAMPLES),
        lattice=replace(found.lattice, volume_term=True),
        control_points={},
    )


@lru_cache(maxsize=1)
def base() -> Problem:
    """The problem with the tool at the place of the scene."""
    return problem_of(scene())


def under_tool(at: list[float], radius: float, force: float) -> Problem:
    """The problem with the tool at a place of the side that it pushes, the control point there."""
    found = base()
    place = Place(side="anterior", at=(at[0], at[1]))
    point, _ = resolve(place, found.geometry.surface)
    tool = replace(found.tool, centre=point, radius=radius, force=force)
    return replace(
        found,
        tool=tool,
        observation=replace(found.observation, probes=point[None]),
        probes=("tool",),
    )


@lru_cache(maxsize=3)
def elements(level: int = LEVEL) -> tuple[Body, Any]:
    """The body on a level, whatever the load, and scikit-fem's basis on its facets."""
    found = base()
    on = found.geometry.level(level)
    assert on is not None
    where = (on.mesh, found.tissue, found.foundation, found.tool, AUTO, found.geometry.project)
    return discretise(*where), loaded_surface(*where)[1]


def pressed(problem: Problem, level: int = LEVEL) -> Body:
    """The body under the tool of a problem."""
    body, surface = elements(level)
    tool = problem.tool
    form = skfem.LinearForm(lambda v, w: tool.profile(rows(w.x), rows(w.n)) * v)
    nodal = np.asarray(form.assemble(surface))
    return replace(body, load=np.outer(nodal * (tool.force / nodal.sum()), tool.direction).ravel())


def linear_curve(problem: Problem, among: Subspace, weights: csr_array) -> Floats:
    """Displacement [m] (samples, 3) of the control point, of the elements under their load."""
    times = problem.observation.times
    finely = np.linspace(0.0, times[-1], INSIDE * (len(times) - 1) + 1)
    y, _ = superposition(among, reference_damping(scene()), problem.factor, finely)
    nodes, count = weights.shape[1], among.load.size
    shapes = (weights @ among.vectors.reshape(nodes, 3 * count)).reshape(3, count)
    return np.asarray(y[::INSIDE] @ shapes.T)


@lru_cache(maxsize=len(SPACINGS))
def lattice(spacing: float) -> tuple[PreparedLattice, csr_array]:
    """The coarse lattice of a corrected lattice of a spacing [m], and its nodes' weights at the

    points of the surface.
    """
    found = model(scene(), "corrected")
    assert isinstance(found, CorrectedLattice)
    prepared = found.varied(spacing=spacing).coarse.prepare(base())
    return prepared, prepared.assembly.lattice.interpolation(base().surface_rule.points)[0]


def observed(problem: Problem, spacing: float) -> ObservedLattice:
    """One lattice under the tool of a problem."""
    prepared, weights = lattice(spacing)
    load = contact(weights, problem.surface_rule, problem.foundation, problem.tool)[1]
    assembly = replace(prepared.assembly, load=load)
    one = replace(prepared, problem=problem, assembly=assembly)
    found = by_vectors(one) if spacing in CORRECTING else by_steps(one)
    run, remainder, rest, truncation = found
    return ObservedLattice(
        spacing,
        len(assembly.mass),
        plain(run.trajectory.displacement[:, 0]),
        plain(remainder),
        plain(rest),
        run.largest_strain,
        run.inverted_cells,
        truncation,
        run.trajectory.status,
    )


class Parts(NamedTuple):
    """A lattice's run, what is beyond itself linear [m] (samples, 3), its linear rest [m] (3,)."""

    run: Run
    remainder: Floats
    rest: Floats
    truncation: float


def by_vectors(one: PreparedLattice) -> Parts:
    """With the linear lattice in few vectors."""
    prepared = PreparedRemainder(one, VECTORS)
    found, linear = prepared.run(requested_step(one.model.lattice)), prepared.linear()
    weights, _ = one.assembly.lattice.interpolation(one.problem.observation.probes)
    rest = weights @ linear.displacement(linear.load / linear.squares)
    return Parts(found.lattice, found.trajectory.displacement[:, 0], rest[0], found.truncation)


def by_steps(one: PreparedLattice) -> Parts:
    """With the linear lattice stepped as the nonlinear one, where its vectors would be dear."""
    given = (one.assembly, one.springs.material, one.problem.factor, one.problem.observation)
    whole = msm.run(*given, requested_step(one.model.lattice))
    linear = msm.run(*given, Counts(whole.substeps), linear=True)
    u, below = (run.trajectory.displacement[:, 0] for run in (whole, linear))
    return Parts(whole, u - below, np.full(3, np.nan), 0.0)


def plain(values: Floats) -> list[float | None]:
    """All entries, in seven digits, None for what is not a number."""
    return [
        float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None for value in np.ravel(values)
    ]
