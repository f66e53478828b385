"""What the difference of a lattice from its references is made of: an error budget.

One thing after another is mended in the lattice, and each motion compared with the one before. The
differences are vectors and add up to the whole; what one has to do with the size of the whole is
its projection on it, and these add up too. What nothing named explains is left as a remainder.
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

    `error`: of this part, relative to the reference's norm, None where it is not known.
    """

    cause: str
    field: Floats
    error: float | None


@dataclass(frozen=True)
class Mending:
    """Displacement [m] (q, 3) at the peak as a lattice is mended: the stiffness first, then causes.

    `last`: what is left of the way to the reference once these are mended, at rest for finite
    elements, at the peak, with its damping, for a lattice. `nodes`: how many it has; one of others
    differs by its cells too.
    """

    causes: tuple[str, ...]
    fields: tuple[Floats, ...]
    last: Floats
    nodes: int

    @property
    def finished(self) -> bool:
        """Whether the lattice did not diverge as it was mended."""
        return all(np.isfinite(field).all() for field in (*self.fields, self.last))


@dataclass(frozen=True)
class Mended:
    """The displacement (q, 3) at the peak once the stiffness is right, and the other parts."""

    field: Floats
    others: tuple[Difference, ...]


def mending(lattice: PreparedLattice, reference: Prepared) -> Mending:
    """A lattice mended toward a reference, a lattice or else finite elements.

    ValueError for a lattice that there cannot be.
    """
    short = replace(lattice, problem=_until_peak(lattice.problem))
    if isinstance(reference, PreparedLattice):
        return _toward_benchmark(short, reference)
    return _toward_elements(short)


def error_budgets(
    mendings: Mapping[str, Mending],
    runs: Mapping[str, ModelRun],
    rest: Mapping[str, Floats],
    volumes: Floats,
) -> tuple[ErrorBudget, ...]:
    """Budgets of the lattices that are no reference, against those that a lattice is mended toward.

    Of the models that finished and have the nodes of the one that was mended; there is none where a
    lattice diverges as it is mended. `rest`: displacement [m] (q, 3) of finite elements at rest, by
    name.
    """
    sound = {n: run for n, run in runs.items() if run.trajectory.status == "finished"}
    found = list[ErrorBudget]()
    for name in (n for n, way in mendings.items() if n in sound and way.finished):
        reference, way = sound[name], mendings[name]
        mended = Mended(way.fields[0], (*_differences(way), *_last(way, reference, rest.get(name))))
        found += [
            _budget(run, reference, mended, volumes)
            for n, run in sound.items()
            if run.record.lattice is not None and n not in mendings
            if run.record.nodes == way.nodes
        ]
    return tuple(found)


def _until_peak(problem: Problem) -> Problem:
    """The same problem as far as the peak of its load, the only frame that is kept."""
    seen = problem.observation
    peak = seen.frames[0]
    return replace(problem, observation=replace(seen, times=seen.times[: peak + 1], frames=(peak,)))


def _peak(run: ModelRun) -> Floats:
    return np.asarray(run.trajectory.volume_field[0])


def _moved(lattice: PreparedLattice) -> Floats:
    """Displacement (q, 3) at the peak."""
    return np.asarray(lattice.simulate().trajectory.volume_field[0])


Changes = dict[str, dict[str, Any]]
"""Keys of a scene's table `lattice` that mend a cause."""


def _steps(lattice: PreparedLattice, modulus: float, changes: Changes) -> Iterator[PreparedLattice]:
    """The lattice with linear springs of a modulus [Pa], then with one change after another.

    The damping stays that of the scene, which eq. (2) would change with the Poisson ratio.
    """
    scene = lattice.model.scene
    damping = nodal_damping(scene, modulus)
    asked = scene.lattice
    for change in ({}, *changes.values()):
        asked = replace(asked, **change)
        changed = replace(scene, lattice=asked)
        made = of_modulus(changed, lattice.assembly.lattice, modulus=modulus)
        springs = replace(made, material=replace(made.material, damping=damping))
        model = replace(lattice.model, scene=changed)
        yield on_lattice(model, lattice.problem, lattice.plain, springs)


def _differences(way: Mending) -> Iterator[Difference]:
    """What each change did; the steps' errors cancel in part, and are not told for a difference."""
    for cause, (before, after) in zip(way.causes, pairwise(way.fields), strict=True):
        yield Difference(cause, before - after, None)


def _last(way: Mending, reference: ModelRun, rest: Floats | None) -> Iterator[Difference]:
    """The parts that need the reference's own motion, or its displacement at rest."""
    if rest is not None:
        yield Difference(SPACING, way.last - rest, _own_error(reference))
    else:
        yield Difference(DAMPING, way.fields[-1] - way.last, None)
        yield Difference(LAW, way.last - _peak(reference), None)


def _toward_elements(lattice: PreparedLattice) -> Mending:
    """As the lattice gets the tissue's constants and becomes linear; then at rest.

    What the spacing costs is told at rest, where both solve the same equations.
    """
    tissue, asked = lattice.problem.tissue, lattice.model.lattice
    changes: Changes = {}
    if asked.law is not None:
        changes[LAW] = {"law": None}
    if not asked.volume_term and _can_have_term(asked, tissue.poisson_ratio):
        changes[POISSON] = {"volume_term": True}
    if asked.geometry == "nonlinear":
        changes[GEOMETRY] = {"geometry": "linear"}
    steps = list(_steps(lattice, tissue.youngs_modulus, changes))
    moved, nodes = tuple(map(_moved, steps)), len(lattice.assembly.mass)
    return Mending(tuple(changes), moved, steps[-1].rest(), nodes)


def _toward_benchmark(lattice: PreparedLattice, benchmark: PreparedLattice) -> Mending:
    """As the lattice gets the benchmark's modulus, then its damping and its law."""
    changes: Changes = {}
    if lattice.model.lattice.volume_term:
        changes[POISSON] = {"volume_term": False}
    if lattice.model.lattice.law is not None:
        changes[LAW] = {"law": None}
    steps = list(_steps(lattice, benchmark.springs.modulus, changes))
    damped = _damped_as(steps[-1], benchmark)
    moved, nodes = tuple(map(_moved, steps)), len(lattice.assembly.mass)
    return Mending(tuple(changes), moved, _moved(damped), nodes)


def _damped_as(lattice: PreparedLattice, other: PreparedLattice) -> PreparedLattice:
    damping = other.springs.material.damping
    material = replace(lattice.springs.material, damping=damping)
    return replace(lattice, springs=SpringMaterial(lattice.springs.modulus, material))


def _can_have_term(lattice: Lattice, poisson_ratio: float) -> bool:
    return lattice.springs == "lattice" and poisson_ratio > SPRING_POISSON_RATIO


def _own_error(run: ModelRun) -> float | None:
    """Estimated error of the reference's field at the peak by its mesh."""
    error = run.record.mesh_error
    return None if error is None else error.field_peak


def _budget(run: ModelRun, reference: ModelRun, mended: Mended, volumes: Floats) -> ErrorBudget:
    """The parts of one lattice's difference, the remainder last."""
    whole = _peak(run) - _peak(reference)
    parts = [Difference(ESTIMATE, _peak(run) - mended.field, None), *mended.others]
    if reference.record.lattice is None:  # a lattice has much the same error by its steps
        parts = [*_by_time_step(run), *parts]
    left = whole - np.sum([part.field for part in parts], axis=0)
    parts.append(Difference(REMAINDER, left, _own_error(reference)))
    return ErrorBudget(
        model=run.record.name,
        reference=reference.record.name,
        total=norm(whole, volumes) / norm(_peak(reference), volumes),
        total_error=_own_error(reference),
        parts=tuple(_shares(parts, whole, _peak(reference), volumes)),
    )


def _by_time_step(run: ModelRun) -> Iterator[Difference]:
    """What steps cost a run that was repeated with half as long ones, by Richardson."""
    record = run.record.lattice
    if run.halved is None or record is None:
        return
    share = 1.0 / (1.0 - 0.5 ** INTEGRATORS[record.integrator].order)
    yield Difference(TIME_STEP, share * (_peak(run) - run.halved.volume_field[0]), None)


def _shares(
    parts: Sequence[Difference], whole: Floats, truth: Floats, volumes: Floats
) -> Iterator[BudgetPart]:
    """Size, contribution and what is left once this part and those before are mended."""
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
