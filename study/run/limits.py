"""What the spring lattice cannot do, whatever stiffness it is given."""

from __future__ import annotations

from dataclasses import replace

from fem_reference import model as fem
from fem_reference.elasticity import Body
from msm import model as lattice_model
from msm.calibration import POISSON_RATIO, reference_stiffness
from msm.lattice import interpolation
from msm.laws import Hooke
from msm.model import Assembly
from study.progress import Progress
from study.run.comparison import best_factor, relative_l2
from study.run.outcome import Outcome
from study.run.posed import Posed
from study.scene import Scene


def lattice_limits(
    scene: Scene,
    posed: Posed,
    body: Body,
    assembly: Assembly,
    outcome: Outcome,
    progress: Progress,
) -> None:
    """Compare lattice and reference at rest, both with the reference modulus.

    Against a reference with nu = 1/4 only the lattice's discretisation differs; against the scene's
    nu the springs' fixed Poisson ratio comes on top; the best factor on the field then shows what
    is left after the best possible stiffness.
    """
    points, volumes = posed.volume_rule.points, posed.volume_rule.weights
    with progress.stage("limits of the lattice at rest"):
        law = Hooke(reference_stiffness(scene.tissue.youngs_modulus, scene.lattice.spacing))
        nodal = lattice_model.static_displacement(assembly, law)
        field = interpolation(assembly.lattice, points)[0] @ nodal
        truth = fem.static_field(body, points)
        tissue = replace(scene.tissue, poisson_ratio=POISSON_RATIO)
        quarter = fem.build(posed.geometry.mesh, tissue, posed.foundation, posed.tool)
        truth_at_quarter = fem.static_field(quarter, points)
    factor = best_factor(field, truth, volumes)
    outcome.extra["lattice_limits"] = {
        "spacing_m": scene.lattice.spacing,
        "poisson_ratio": scene.tissue.poisson_ratio,
        "relative_l2_at_quarter": relative_l2(field, truth_at_quarter, volumes),
        "relative_l2": relative_l2(field, truth, volumes),
        "best_factor": factor,
        "relative_l2_at_best_factor": relative_l2(factor * field, truth, volumes),
    }
