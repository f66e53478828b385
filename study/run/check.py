"""Describe a scene or a mesh file before anything is run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from study.results.folder import default_folder, refuse_unwritable
from study.run.suiting import read_suited
from study.scene.file import BUILT_IN
from study.system.progress import Silent


def is_scene(target: str) -> bool:
    """Whether a name is that of a scene, and not of a mesh file."""
    from study.mesh.load import ENDINGS

    if target in BUILT_IN or target.lower().endswith(".toml"):
        return True
    if Path(target).suffix.lower() in ENDINGS:
        return False
    try:
        return not Path(target).exists()
    except OSError:  # the name is too long for a file
        return True


def describe_scene(name: str, overrides: Sequence[str], out: Path | None = None) -> list[str]:
    """Lines on a scene: organ, loads, models and their steps.

    ValueError for whatever a run of it into the folder `out` would refuse, by the same code.
    """
    scene = read_suited(name, overrides)
    refuse_unwritable(out or default_folder(name))
    lines = [scene.title or name]
    if scene.require is not None:
        from study.plan.plan import lines as told
        from study.run.planned import planned

        found = planned(scene, Silent())
        if not scene.require.moves:
            return [*lines, *told(found)]
        scene = found.scene
    lines.append(f"models: {', '.join(scene.models)}")
    from study.run.preparation import PreparedPointScene, prepare_scene

    given = prepare_scene(scene)
    if isinstance(given, PreparedPointScene):
        return [*lines, f"one control mass point of {given.problem.mass:.4g} kg"]
    from study.run.dimensionless import dimensionless

    lines += [f"note: {note}" for note in (*scene.remarks, *given.problem.notes)]
    numbers = asdict(dimensionless(scene, given.problem))
    lines += [f"{key} = {value:.4g}" for key, value in numbers.items()]
    described = (line for model in given.models.values() for line in model.describe())
    return [*lines, *dict.fromkeys(described)]


def describe_mesh(
    path: Path, unit: str | None, axes: str | None = None, pieces: str = "one"
) -> list[str]:
    """Lines on a mesh file: its content, the repairs made, and its quality."""
    from study.mesh.axes import axes_note
    from study.mesh.load import load_mesh

    _, report = load_mesh(path, unit, axes, pieces)
    extent = " x ".join(f"{1e3 * length:.1f}" for length in report.extent)
    return [
        f"{path.name}: {report.kind}, unit {report.unit}, {1e3 * report.volume:.3f} L, {extent} mm",
        *(f"note: {note}" for note in (*report.notes, axes_note(axes))),
    ]
