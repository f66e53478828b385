"""Limits of a spring lattice: the error that remains whatever stiffness it is given."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from msm.calibration import LARGEST_POISSON_RATIO, SPRING_POISSON_RATIO
from study.models.model import Prepared
from study.models.tissue import models
from study.problem.problem import Problem
from study.results.records import LatticeLimits
from study.scene import Scene
from study.similarity.fields import best_factor, relative_l2

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class LatticeAtRest:
    """Displacement [m] (q, 3) at rest of linear springs with the tissue's modulus.

    `spacing` [m]; `with_volume_term`: with the volume term, None where the lattice cannot have one.
    """

    spacing: float
    field: Floats
    with_volume_term: Floats | None


@dataclass(frozen=True)
class ReferenceAtRest:
    """Displacement [m] (q, 3) of a reference at rest; `at_quarter`: with Poisson ratio 1/4."""

    field: Floats
    at_quarter: Floats | None = None


@runtime_checkable
class HasVariablePoissonRatio(Protocol):
    """A prepared model of an isotropic solid that can be solved for another Poisson ratio."""

    def rest_at(self, poisson_ratio: float) -> Floats:
        """Displacement [m] (q, 3) at rest under the full load, after a run and on its mesh."""


def lattice_at_rest(scene: Scene, problem: Problem) -> LatticeAtRest:
    """Solve the springs at rest. ValueError for a lattice that cannot be built."""
    nu = problem.tissue.poisson_ratio
    is_cubic = scene.lattice.springs == "lattice"
    can_have_term = is_cubic and SPRING_POISSON_RATIO < nu <= LARGEST_POISSON_RATIO
    spacing, field = _at_rest(scene, problem, volume_term=False)
    term = _at_rest(scene, problem, volume_term=True)[1] if can_have_term else None
    return LatticeAtRest(spacing, field, term)


def reference_at_rest(reference: Prepared, *, at_quarter: bool) -> ReferenceAtRest:
    """Solve a reference at rest, after a run and on its mesh.

    Also with Poisson ratio 1/4 if `at_quarter` is set and the model supports it.
    """
    if at_quarter and isinstance(reference, HasVariablePoissonRatio):
        return ReferenceAtRest(reference.rest(), reference.rest_at(SPRING_POISSON_RATIO))
    return ReferenceAtRest(reference.rest())


def lattice_limits(
    lattice: LatticeAtRest, reference: ReferenceAtRest, poisson_ratio: float, volumes: Floats
) -> LatticeLimits:
    """Compare lattice and reference at rest, both with the tissue's modulus.

    Against a reference with nu = 1/4 only the discretisation of the lattice differs. Against the
    tissue's nu the fixed Poisson ratio of the springs comes on top. The best scale factor on the
    field shows what remains at the best possible stiffness, and the volume term what remains with
    it.
    """
    field, truth, term = lattice.field, reference.field, lattice.with_volume_term
    assert reference.at_quarter is not None  # noqa: S101 - as was asked
    factor = best_factor(field, truth, volumes)
    return LatticeLimits(
        spacing_m=lattice.spacing,
        poisson_ratio=poisson_ratio,
        relative_l2_at_quarter=relative_l2(field, reference.at_quarter, volumes),
        relative_l2=relative_l2(field, truth, volumes),
        best_factor=factor,
        relative_l2_at_best_factor=relative_l2(factor * field, truth, volumes),
        relative_l2_with_volume_term=None if term is None else relative_l2(term, truth, volumes),
    )


def _at_rest(scene: Scene, problem: Problem, *, volume_term: bool) -> tuple[float, Floats]:
    """Spacing [m], and displacement [m] (q, 3) of linear springs of the tissue's modulus."""
    lattice = replace(scene.lattice, volume_term=volume_term, law=None)
    (model,) = models(replace(scene, lattice=lattice), {})
    prepared = model.prepare(problem)
    return prepared.assembly.lattice.spacing, prepared.rest()
