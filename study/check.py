"""Describe a scene or a mesh file before anything is run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from study.scene import Scene
from study.scene.file import read_scene

if TYPE_CHECKING:
    from study.problem.problem import Problem


def describe_scene(name: str, overrides: Sequence[str]) -> list[str]:
    """Lines on a scene: organ, loads, models and their steps. ValueError as of a run."""
    scene = read_scene(name, overrides)
    lines = [scene.title or name, f"models: {', '.join(scene.models)}"]
    if scene.is_point:
        from study.scene.problem import point_problem_of

        return [*lines, f"one control mass point of {point_problem_of(scene).mass:.4g} kg"]
    from study.run.organ import dimensionless
    from study.scene.problem import problem_of

    posed = problem_of(scene)
    lines += [f"note: {note}" for note in posed.geometry.notes]
    lines += [f"{key} = {value:.4g}" for key, value in dimensionless(scene, posed).items()]
    tetrahedra = len(posed.geometry.mesh.tetrahedra)
    finer = ", refined for reference.accuracy" if scene.reference.accuracy is not None else ""
    lines.append(f"finite-element mesh: {tetrahedra} tetrahedra{finer}")
    if set(scene.models) & {"basafa", "msm"}:
        lines += _lattice_lines(scene, posed)
    return lines


def _lattice_lines(scene: Scene, posed: Problem) -> list[str]:
    from msm.model import critical_time_step
    from study.run.estimates import estimates
    from study.run.lattices import assemble, contenders

    assembly = assemble(scene, posed)
    where = "lattice" if scene.lattice.springs == "lattice" else "springs on the mesh"
    lines = [f"{where}: {len(assembly.mass)} nodes, {len(assembly.springs.weight)} springs"]
    for contender in contenders(scene, assembly.lattice, estimates(scene)):
        step = critical_time_step(assembly, contender.material, scene.lattice.integrator)
        damping = contender.material.damping
        dashpots = f" and {1e3 * damping.beta:.4g} ms" if damping.beta > 0.0 else ""
        lines.append(
            f"{contender.name}: modulus {contender.modulus / 1e3:.2f} kPa, critical step "
            f"{1e3 * step:.3g} ms, damping {damping.gamma_0:.4g} 1/s{dashpots}"
        )
    return lines


def describe_mesh(path: Path, unit: str | None) -> list[str]:
    """Lines on a mesh file: what it holds, what was repaired, its quality."""
    from study.mesh.load import load_mesh

    _, report = load_mesh(path, unit)
    extent = " x ".join(f"{1e3 * length:.1f}" for length in report.extent)
    return [
        f"{path.name}: {report.kind}, unit {report.unit}, {1e3 * report.volume:.3f} L, {extent} mm",
        *(f"note: {note}" for note in report.notes),
    ]
