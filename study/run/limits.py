"""What the spring lattice cannot do, whatever stiffness it is given."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from msm.calibration import LARGEST_POISSON_RATIO, SPRING_POISSON_RATIO
from study.models.finite_elements import PreparedElements
from study.models.model import Prepared
from study.models.tissue import models
from study.problem.problem import Problem
from study.progress import Progress
from study.results.records import LatticeLimits
from study.scene import Scene
from study.similarity.fields import best_factor, relative_l2

Floats = NDArray[np.float64]


def lattice_limits(
    scene: Scene, problem: Problem, reference: Prepared, progress: Progress
) -> LatticeLimits:
    """Compare lattice and reference at rest, both with the tissue's modulus.

    Against a reference with nu = 1/4 only the lattice's discretisation differs; against the
    tissue's nu the springs' fixed Poisson ratio comes on top; the best factor on the field then
    shows what is left after the best possible stiffness, and the volume term what is left with it.
    """
    assert isinstance(reference, PreparedElements)  # noqa: S101 - the model of that name
    volumes, nu = problem.volume_rule.weights, problem.tissue.poisson_ratio
    with progress.stage("limits of the lattice at rest"):
        spacing, field = _at_rest(scene, problem, volume_term=False)
        truth, quarter = reference.rest(), reference.rest_at(SPRING_POISSON_RATIO)
    factor = best_factor(field, truth, volumes)
    is_cubic = scene.lattice.springs == "lattice"
    can_have_term = is_cubic and SPRING_POISSON_RATIO < nu <= LARGEST_POISSON_RATIO
    return LatticeLimits(
        spacing_m=spacing,
        poisson_ratio=nu,
        relative_l2_at_quarter=relative_l2(field, quarter, volumes),
        relative_l2=relative_l2(field, truth, volumes),
        best_factor=factor,
        relative_l2_at_best_factor=relative_l2(factor * field, truth, volumes),
        relative_l2_with_volume_term=(
            relative_l2(_at_rest(scene, problem, volume_term=True)[1], truth, volumes)
            if can_have_term
            else None
        ),
    )


def _at_rest(scene: Scene, problem: Problem, *, volume_term: bool) -> tuple[float, Floats]:
    """Spacing [m] and displacement [m] (q, 3) of linear springs of the tissue's modulus."""
    lattice = replace(scene.lattice, volume_term=volume_term, law=None)
    (model,) = models(replace(scene, lattice=lattice), {})
    prepared = model.prepare(problem)
    return prepared.assembly.lattice.spacing, prepared.rest()
