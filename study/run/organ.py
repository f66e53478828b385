"""Run every model that a scene with a mesh names; import only those."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from study.mesh.tetrahedra import mean_edge
from study.problem.problem import Problem
from study.progress import Progress
from study.run.outcome import Outcome
from study.scene import Scene

if TYPE_CHECKING:
    from fuzzy.liver.stiffness import StiffnessEstimate
    from study.run.keeping import Keeping

GRAVITY = 9.81


def run_organ(
    scene: Scene,
    posed: Problem,
    estimates: dict[str, StiffnessEstimate],
    progress: Progress,
    keeping: Keeping | None = None,
) -> Outcome:
    """Run the finite elements, the benchmark and one lattice per estimate."""
    from study.run.lattices import assemble, run_lattices

    outcome = Outcome(notes=list(posed.geometry.notes))
    outcome.extra["dimensionless"] = dimensionless(scene, posed)
    has_lattice = bool(set(scene.models) & {"basafa", "msm"})
    if has_lattice:
        with progress.stage("lattice"):
            assembly = assemble(scene, posed)
    if "fem" in scene.models:
        from study.run.reference import run_reference

        solved = run_reference(scene, posed, outcome, progress, keeping)
        if "msm" in scene.models:
            from study.run.limits import lattice_limits

            lattice_limits(scene, posed, solved, assembly, outcome, progress)
    if has_lattice:
        run_lattices(scene, posed, assembly, estimates, outcome, progress, keeping)
    return outcome


def spacing(scene: Scene, posed: Problem) -> float:
    """Spacing of the lattice, or mean edge of the mesh that springs run along [m]."""
    if scene.lattice.springs == "tetrahedra":
        return mean_edge(posed.geometry.mesh)
    return scene.lattice.spacing


def dimensionless(scene: Scene, posed: Problem) -> dict[str, float]:
    """Numbers that show a mistaken unit before anything is run."""
    extent = float(np.ptp(posed.geometry.surface.points, axis=0).max())
    modulus, radius = scene.tissue.youngs_modulus, scene.tool.radius
    return {
        "extent_m": extent,
        "volume_m3": posed.geometry.volume,
        "sag_rho_g_l_over_e": scene.tissue.density * GRAVITY * extent / modulus,
        "tool_pressure_over_e": scene.tool.force / (np.pi * radius**2) / modulus,
        "tool_radius_over_spacing": radius / spacing(scene, posed),
        "tool_radius_over_element_size": radius / scene.reference.element_size,
    }
