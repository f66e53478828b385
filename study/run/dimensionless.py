"""Dimensionless numbers that reveal a wrong unit before anything is run."""

from __future__ import annotations

import numpy as np

from study.mesh.tetrahedra import mean_edge
from study.problem.problem import Problem
from study.results.records import Dimensionless
from study.scene import Scene

GRAVITY = 9.81


def dimensionless(scene: Scene, problem: Problem) -> Dimensionless:
    """Size, self-weight deflection and tool of a problem, relative to stiffness and spacing."""
    extent = float(np.ptp(problem.geometry.surface.points, axis=0).max())
    modulus, radius = problem.tissue.youngs_modulus, problem.tool.radius
    return Dimensionless(
        extent_m=extent,
        volume_m3=problem.geometry.volume,
        sag_rho_g_l_over_e=problem.tissue.density * GRAVITY * extent / modulus,
        tool_pressure_over_e=problem.tool.force / (np.pi * radius**2) / modulus,
        tool_radius_over_spacing=radius / _spacing(scene, problem),
        tool_radius_over_element_size=radius / scene.reference.element_size,
    )


def _spacing(scene: Scene, problem: Problem) -> float:
    """Spacing of the lattice, or mean edge of the mesh along whose edges the springs run [m]."""
    if scene.lattice.springs == "tetrahedra":
        return mean_edge(problem.geometry.mesh)
    return scene.lattice.spacing
