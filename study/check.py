"""Describe a scene or a mesh file before anything is run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from study.scene.file import read_scene


def describe_scene(name: str, overrides: Sequence[str]) -> list[str]:
    """Lines on a scene: organ, loads, models and their steps. ValueError as of a run."""
    scene = read_scene(name, overrides)
    lines = [scene.title or name, f"models: {', '.join(scene.models)}"]
    if scene.is_point:
        from study.scene.problem import point_problem_of

        return [*lines, f"one control mass point of {point_problem_of(scene).mass:.4g} kg"]
    from study.models.estimates import estimates
    from study.models.table import is_tuned, models_of
    from study.run.dimensionless import dimensionless
    from study.scene.problem import problem_of

    problem = problem_of(scene)
    lines += [f"note: {note}" for note in problem.geometry.notes]
    numbers = asdict(dimensionless(scene, problem))
    lines += [f"{key} = {value:.4g}" for key, value in numbers.items()]
    models = models_of(scene, estimates(scene) if is_tuned(scene) else {})
    described = (line for model in models for line in model.prepare(problem).describe())
    return [*lines, *dict.fromkeys(described)]


def describe_mesh(path: Path, unit: str | None) -> list[str]:
    """Lines on a mesh file: what it holds, what was repaired, its quality."""
    from study.mesh.load import load_mesh

    _, report = load_mesh(path, unit)
    extent = " x ".join(f"{1e3 * length:.1f}" for length in report.extent)
    return [
        f"{path.name}: {report.kind}, unit {report.unit}, {1e3 * report.volume:.3f} L, {extent} mm",
        *(f"note: {note}" for note in report.notes),
    ]
