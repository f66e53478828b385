"""Error budget: what the difference of a lattice from its references consists of.

The causes of error are removed from the lattice one after another, and each motion is compared with
the one before. The differences are vectors that add up to the total difference. The contribution of
a cause is the projection of its difference on the total; contributions add up to the norm of the
total. What no named cause explains remains as a remainder.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from msm.calibration import SPRING_POISSON_RATIO
from msm.integrators import INTEGRATORS
from study.models.damping import nodal_damping
from study.models.lattice import PreparedLattice, SpringMaterial, on_lattice
from study.models.model import ModelRun, Prepared
from study.models.tissue import of_modulus
from study.problem.problem import Problem
from study.results.records import BudgetPart, ErrorBudget
from study.scene import Lattice
from study.similarity.fields import norm

Floats = NDArray[np.float64]

ESTIMATE, LAW, POISSON, GEOMETRY = (
    "stiffness",
    "spring law",
    "Poisson ratio",
    "geometric nonlinearity",
)
SPACING, TIME_STEP, DAMPING, REMAINDER = "lattice spacing", "time step", "damping", "remainder"


@dataclass(frozen=True)
class Difference:
    """A part [m] (q, 3) of the difference of two displacement fields, by its cause.

    `error`: of this part, relative to the norm of the reference, None where it is unknown.
    """

    cause: str
    field: Floats
    error: float | None


@dataclass(frozen=True)
class Attribution:
    """Displacement fields [m] (q, 3) at the peak as causes of error are removed from a lattice.

    `fields`: with the reference's stiffness, then after removing each of the `causes` in turn.
    `last`: the lattice without any of them, at rest when the reference is finite elements; with the
    damping of the reference, at the peak, when it is a lattice. `nodes`: number of nodes; the
    budget of a lattice with another number would have an additional cause, its cells.
    """

    causes: tuple[str, ...]
    fields: tuple[Floats, ...]
    last: Floats
    nodes: int

    @property
    def finished(self) -> bool:
        """Whether none of the modified lattices diverged."""
        return all(np.isfinite(field).all() for field in (*self.fields, self.last))


@dataclass(frozen=True)
class Decomposition:
    """The displacement (q, 3) at the peak with the correct stiffness, and the remaining parts."""

    field: Floats
    others: tuple[Difference, ...]


def attribution(lattice: PreparedLattice, reference: Prepared) -> Attribution:
    """Remove the causes of error of a lattice toward a reference, a lattice or finite elements.

    ValueError for a modified lattice that cannot be built.
    """
    short = replace(lattice, problem=_until_peak_load(lattice.problem))
    if isinstance(reference, PreparedLattice):
        return _toward_benchmark(short, reference)
    return _toward_elements(short)


def error_budgets(
    attributions: Mapping[str, Attribution],
    runs: Mapping[str, ModelRun],
    rest: Mapping[str, Floats],
    volumes: Floats,
) -> tuple[ErrorBudget, ...]:
    """Error budgets of the lattices, against each reference that has an attribution.

    Lattices that are references have none, nor do models that did not finish, lattices with other
    nodes than the attributed one, or attributions in which a lattice diverged. `rest`: displacement
    [m] (q, 3) of the finite elements at rest, by name.
    """
    sound = {n: run for n, run in runs.items() if run.trajectory.status == "finished"}
    found = list[ErrorBudget]()
    for name in (n for n, way in attributions.items() if n in sound and way.finished):
        reference, way = sound[name], attributions[name]
        decomposition = Decomposition(
            way.fields[0], (*_differences(way), *_final_parts(way, reference, rest.get(name)))
        )
        found += [
            _budget(run, reference, decomposition, volumes)
            for n, run in sound.items()
            if run.record.lattice is not None and n not in attributions
            if run.record.nodes == way.nodes
        ]
    return tuple(found)


def _until_peak_load(problem: Problem) -> Problem:
    """The problem up to the peak of its load, the only frame that is recorded."""
    seen = problem.observation
    peak = seen.frames[0]
    return replace(problem, observation=replace(seen, times=seen.times[: peak + 1], frames=(peak,)))


def _peak_field(run: ModelRun) -> Floats:
    return np.asarray(run.trajectory.volume_field[0])


def _peak_displacement(lattice: PreparedLattice) -> Floats:
    """Displacement (q, 3) at the peak."""
    return np.asarray(lattice.simulate().trajectory.volume_field[0])


Changes = dict[str, dict[str, Any]]
"""Changed keys of the scene's table `lattice`, by the cause that they remove."""


def _modified_lattices(
    lattice: PreparedLattice, modulus: float, changes: Changes
) -> Iterator[PreparedLattice]:
    """The lattice with linear springs of a modulus [Pa], then with one change after another.

    The damping is that of the scene throughout; by eq. (2) it would change with the Poisson ratio.
    """
    scene = lattice.model.scene
    damping = nodal_damping(scene, modulus)
    table = scene.lattice
    for change in ({}, *changes.values()):
        table = replace(table, **change)
        changed = replace(scene, lattice=table)
        made = of_modulus(changed, lattice.assembly.lattice, modulus=modulus)
        springs = replace(made, material=replace(made.material, damping=damping))
        model = replace(lattice.model, scene=changed)
        yield on_lattice(model, lattice.problem, lattice.plain, springs)


def _differences(way: Attribution) -> Iterator[Difference]:
    """The effect of each change; time-step errors largely cancel, so none is stated."""
    for cause, (before, after) in zip(way.causes, pairwise(way.fields), strict=True):
        yield Difference(cause, before - after, None)


def _final_parts(
    way: Attribution, reference: ModelRun, rest: Floats | None
) -> Iterator[Difference]:
    """The parts that need the reference's own motion, or its displacement at rest."""
    if rest is not None:
        yield Difference(SPACING, way.last - rest, _own_error(reference))
    else:
        yield Difference(DAMPING, way.fields[-1] - way.last, None)
        yield Difference(LAW, way.last - _peak_field(reference), None)


def _toward_elements(lattice: PreparedLattice) -> Attribution:
    """Give the lattice the tissue's constants, make it linear, then compare it at rest.

    The effect of the spacing is evaluated at rest, where both methods solve the same equations.
    """
    tissue, table = lattice.problem.tissue, lattice.model.lattice
    changes: Changes = {}
    if table.law is not None:
        changes[LAW] = {"law": None}
    if not table.volume_term and _allows_volume_term(table, tissue.poisson_ratio):
        changes[POISSON] = {"volume_term": True}
    if table.geometry == "nonlinear":
        changes[GEOMETRY] = {"geometry": "linear"}
    steps = list(_modified_lattices(lattice, tissue.youngs_modulus, changes))
    moved, nodes = tuple(map(_peak_displacement, steps)), len(lattice.assembly.mass)
    return Attribution(tuple(changes), moved, steps[-1].rest(), nodes)


def _toward_benchmark(lattice: PreparedLattice, benchmark: PreparedLattice) -> Attribution:
    """Give the lattice the benchmark's modulus, then its damping, then its law."""
    changes: Changes = {}
    if lattice.model.lattice.volume_term:
        changes[POISSON] = {"volume_term": False}
    if lattice.model.lattice.law is not None:
        changes[LAW] = {"law": None}
    steps = list(_modified_lattices(lattice, benchmark.springs.modulus, changes))
    damped = _with_damping_of(steps[-1], benchmark)
    moved, nodes = tuple(map(_peak_displacement, steps)), len(lattice.assembly.mass)
    return Attribution(tuple(changes), moved, _peak_displacement(damped), nodes)


def _with_damping_of(lattice: PreparedLattice, other: PreparedLattice) -> PreparedLattice:
    damping = other.springs.material.damping
    material = replace(lattice.springs.material, damping=damping)
    return replace(lattice, springs=SpringMaterial(lattice.springs.modulus, material))


def _allows_volume_term(lattice: Lattice, poisson_ratio: float) -> bool:
    return lattice.springs == "lattice" and poisson_ratio > SPRING_POISSON_RATIO


def _own_error(run: ModelRun) -> float | None:
    """Estimated discretisation error of the reference's field at the peak."""
    error = run.record.mesh_error
    return None if error is None else error.field_peak


def _budget(
    run: ModelRun, reference: ModelRun, decomposition: Decomposition, volumes: Floats
) -> ErrorBudget:
    """The parts of one lattice's difference, the remainder last."""
    whole = _peak_field(run) - _peak_field(reference)
    parts = [
        Difference(ESTIMATE, _peak_field(run) - decomposition.field, None),
        *decomposition.others,
    ]
    if reference.record.lattice is None:  # two lattices have nearly the same time-step error
        parts = [*_time_step_part(run), *parts]
    left = whole - np.sum([part.field for part in parts], axis=0)
    parts.append(Difference(REMAINDER, left, _own_error(reference)))
    return ErrorBudget(
        model=run.record.name,
        reference=reference.record.name,
        total=norm(whole, volumes) / norm(_peak_field(reference), volumes),
        total_error=_own_error(reference),
        parts=tuple(_shares(parts, whole, _peak_field(reference), volumes)),
    )


def _time_step_part(run: ModelRun) -> Iterator[Difference]:
    """The time-step error by Richardson extrapolation, for a run repeated with half the step."""
    record = run.record.lattice
    if run.halved is None or record is None:
        return
    share = 1.0 / (1.0 - 0.5 ** INTEGRATORS[record.integrator].order)
    yield Difference(TIME_STEP, share * (_peak_field(run) - run.halved.volume_field[0]), None)


def _shares(
    parts: Sequence[Difference], whole: Floats, truth: Floats, volumes: Floats
) -> Iterator[BudgetPart]:
    """For each part its norm, its contribution, and the norm of what remains after removing it."""
    scale, size = norm(truth, volumes), norm(whole, volumes)
    left = whole
    for part in parts:
        left = left - part.field
        along = float(volumes @ (part.field * whole).sum(axis=1)) / size
        yield BudgetPart(
            cause=part.cause,
            size=norm(part.field, volumes) / scale,
            contribution=along / scale,
            left=norm(left, volumes) / scale,
            error=part.error,
        )
