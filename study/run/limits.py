"""What the spring lattice cannot do, whatever stiffness it is given."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fem_reference import model as fem
from fem_reference.observation import at_points, evaluation
from msm import model as lattice_model
from msm.calibration import SPRING_POISSON_RATIO
from msm.model import Assembly
from study.problem.problem import Problem
from study.progress import Progress
from study.run.lattices import elastic
from study.run.outcome import Outcome
from study.run.reference import Solved
from study.scene import Scene
from study.similarity.fields import best_factor, relative_l2

Floats = NDArray[np.float64]


def lattice_limits(
    scene: Scene,
    posed: Problem,
    solved: Solved,
    assembly: Assembly,
    outcome: Outcome,
    progress: Progress,
) -> None:
    """Compare lattice and reference at rest, both with the reference modulus.

    Against a reference with nu = 1/4 only the lattice's discretisation differs; against the scene's
    nu the springs' fixed Poisson ratio comes on top; the best factor on the field then shows what
    is left after the best possible stiffness, and the volume term what is left with it.
    """
    points, volumes = posed.volume_rule.points, posed.volume_rule.weights
    with progress.stage("limits of the lattice at rest"):
        field = _at_rest(scene, assembly, SPRING_POISSON_RATIO, points)
        body = solved.body
        truth = at_points(evaluation(body, points), solved.found.rest(body))
        tissue = replace(scene.tissue, poisson_ratio=SPRING_POISSON_RATIO)
        project = posed.geometry.project
        quarter = fem.build(body.mesh, tissue, posed.foundation, posed.tool, project=project)
        truth_at_quarter = fem.static_field(quarter, points)
    factor = best_factor(field, truth, volumes)
    nu = scene.tissue.poisson_ratio
    can_lift = nu > SPRING_POISSON_RATIO and scene.lattice.springs == "lattice"
    lifted = _at_rest(scene, assembly, nu, points) if can_lift else None
    outcome.extra["lattice_limits"] = {
        "spacing_m": assembly.lattice.spacing,
        "poisson_ratio": scene.tissue.poisson_ratio,
        "relative_l2_at_quarter": relative_l2(field, truth_at_quarter, volumes),
        "relative_l2": relative_l2(field, truth, volumes),
        "best_factor": factor,
        "relative_l2_at_best_factor": relative_l2(factor * field, truth, volumes),
        "relative_l2_with_volume_term": (
            None if lifted is None else relative_l2(lifted, truth, volumes)
        ),
    }


def _at_rest(scene: Scene, assembly: Assembly, nu: float, points: Floats) -> Floats:
    """Displacement [m] (q, 3) of the lattice with the reference modulus and this Poisson ratio."""
    material = elastic(assembly.lattice, scene.tissue.youngs_modulus, nu)
    nodal = lattice_model.static_displacement(assembly, material)
    return np.asarray(assembly.lattice.interpolation(points)[0] @ nodal)
