"""A user's scene beside the user's measurements: every model of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fem_reference.error_estimate import discretisation_error
from study.mesh.locate import locate
from study.models.estimates import estimates
from study.models.model import Model, Simulation
from study.models.table import is_tuned, models_of
from study.problem.problem import Problem
from study.problem.trajectory import Trajectory
from study.scene import Scene
from study.scene.problem import OUTSIDE, problem_of
from study.system.progress import Progress
from study.validation.comparison import ORDER, Comparison
from study.validation.user_data import Curve, UserMarkers, read_curve, read_markers

Floats = NDArray[np.float64]

NAME = "own scene"
MARKERS = "markers.csv"
COARSER_SPACING = 4.0 / 3.0
"""Spacing of a lattice over the next finer one, from which its own error is estimated."""


@dataclass(frozen=True)
class UserData:
    """Content of a folder: curves by the name of their file, and markers."""

    curves: dict[str, Curve]
    markers: UserMarkers | None
    unread: tuple[str, ...] = ()
    """Names of everything else in the folder."""


def read_folder(folder: Path) -> UserData:
    """All CSV files of a folder. ValueError for a folder without any, or a malformed file."""
    if not folder.is_dir():
        raise ValueError(f"--data {folder}: there is no such folder; give one with CSV files")
    shown = sorted(one for one in folder.iterdir() if not one.name.startswith("."))
    files = [one for one in shown if one.suffix.lower() == ".csv"]
    if not files:
        raise ValueError(
            f"--data {folder}: holds no CSV file; put a curve in it (time_s, displacement_m or "
            f"force_N), or {MARKERS}"
        )
    of_markers = [one for one in files if one.name.lower() == MARKERS]
    curves = [one for one in files if one not in of_markers]
    for found in ([one.stem for one in curves], [MARKERS for _ in of_markers]):
        twice = {name for name in found if found.count(name) > 1}
        if twice:
            raise ValueError(f"--data {folder}: holds {min(twice)} twice; rename one of them")
    markers = read_markers(of_markers[0]) if of_markers else None
    unread = tuple(one.name for one in shown if one not in files)
    return UserData({one.stem: read_curve(one) for one in curves}, markers, unread)


def comparisons(
    scene: Scene, data: UserData, progress: Progress, probe: str | None = None
) -> Iterator[Comparison]:
    """Each model of the scene beside the measurements, as rms of curves and of markers.

    `probe`: the control point of displacement curves, by default the one nearest to the tool.
    ValueError for what the scene cannot predict.
    """
    if scene.is_point:
        raise ValueError("organ.shape: a single point has no body to be measured; give an organ")
    with progress.stage("organ"):
        posed = problem_of(scene)
    problem = posed if data.markers is None else _marked(posed, data.markers)
    for curve in data.curves.values():
        refuse_unanswered(problem, curve)
    at = probe_number(problem, probe)
    for model in models_of(scene, estimates(scene) if is_tuned(scene) else {}):
        with progress.stage(model.name):
            found = model.prepare(problem).simulate().trajectory
            others = coarser(model, problem)
        for name, curve in data.curves.items():
            read = partial(seen, problem, curve=curve, probe=at)
            own = others.own_error(read(found), read)
            yield _of_curve(name, curve, model.label, read(found), own)
        if data.markers is not None:
            first, peak = len(problem.probes), problem.observation.frames[0]

            def moved(motion: Trajectory, first: int = first, peak: int = peak) -> Floats:
                return motion.displacement[peak, first:]

            own = others.own_error(moved(found), moved)
            yield _of_markers(data.markers, model.label, moved(found), own)


def _marked(problem: Problem, markers: UserMarkers) -> Problem:
    """The problem observed at the markers too, after its control points.

    ValueError naming the line of a marker outside the organ, where models have no displacement.
    """
    within = locate(problem.geometry.mesh, markers.places)[1].min(axis=1)
    if (within < OUTSIDE).any():
        worst = int(within.argmin())
        line = f"line {markers.lines[worst]}: " if markers.lines else ""
        place = ", ".join(f"{value:g}" for value in markers.places[worst])
        low, high = (
            problem.geometry.mesh.points.min(axis=0),
            problem.geometry.mesh.points.max(axis=0),
        )
        extent = " x ".join(f"{a:.3g} to {b:.3g}" for a, b in zip(low, high, strict=True))
        raise ValueError(
            f"{MARKERS}: {line}({place}) m lies outside the organ, which is {extent} m; give "
            "metres in the axes of the scene, and markers inside the organ"
        )
    _refuse_beyond(problem, markers.moved, MARKERS, markers.lines)
    probes = np.concatenate([problem.observation.probes, markers.places])
    return replace(problem, observation=replace(problem.observation, probes=probes))


def _refuse_beyond(problem: Problem, moved: Floats, where: str, lines: Sequence[int] = ()) -> None:
    """ValueError for a displacement [m] of (k, ...) that is longer than the organ."""
    longest = float(np.linalg.norm(np.ptp(problem.geometry.mesh.points, axis=0)))
    length = np.linalg.norm(moved.reshape(len(moved), -1), axis=1)
    worst = int(length.argmax())
    if length[worst] > longest:
        line = f"line {lines[worst]}: " if lines else ""
        raise ValueError(
            f"{where}: {line}a displacement of {length[worst]:.4g} m in an organ that is "
            f"{longest:.3g} m across; give metres"
        )


def probe_number(problem: Problem, name: str | None) -> int:
    """Number of a control point, by default the nearest to the tool; ValueError if unknown."""
    if name is None:
        known = problem.observation.probes[: len(problem.probes)]
        return int(np.linalg.norm(known - problem.tool.centre, axis=1).argmin())
    if name not in problem.probes:
        raise ValueError(f"--probe {name}: is not one of {', '.join(problem.probes)}")
    return problem.probes.index(name)


def refuse_unanswered(problem: Problem, curve: Curve) -> None:
    """Raise ValueError for a force without a moved tool, or times that are not simulated."""
    if curve.column == "force_N" and not problem.rigid_tools:
        raise ValueError(
            "force_N: the scene's tool is driven by force; give a curve of displacement_m, or "
            "move the tool: tool.shape and tool.displacement"
        )
    last = float(problem.observation.times[-1])
    if curve.times[0] < 0.0 or curve.times[-1] > last * (1.0 + 1e-9):
        raise ValueError(
            f"time_s: {curve.times[0]:g} to {curve.times[-1]:g} s is not within the {last:g} s "
            "simulated; enlarge time.duration or shorten the curve"
        )
    if curve.column == "displacement_m":
        _refuse_beyond(problem, curve.values, curve.column, curve.lines)


def seen(problem: Problem, trajectory: Trajectory, curve: Curve, probe: int) -> Floats:
    """The motion at the times of a curve (k,); nan after it diverged."""
    if curve.column == "force_N":
        tool = problem.rigid_tools[0]
        values = -(trajectory.tool_force[:, 0] @ tool.axis)
    else:
        values = trajectory.displacement[:, probe] @ problem.tool.direction
    return np.interp(curve.times, problem.observation.times, values)


@dataclass(frozen=True)
class Coarser:
    """A model's motions on coarser meshes or lattices, coarse to fine; their sizes over its own."""

    motions: tuple[Trajectory, ...]
    sizes: tuple[float, ...]

    def own_error(self, found: Floats, read: Callable[[Trajectory], Floats]) -> Floats | None:
        """Error of values (k, ...) read from a motion, estimated from the coarser ones.

        Its root mean square is the estimate, and its shape that of the last change. None without a
        coarser motion, or where one diverged.
        """
        if not self.motions:
            return None
        values = [np.reshape(one, (len(one), -1)) for one in (*map(read, self.motions), found)]
        if not all(np.isfinite(one).all() for one in values):
            return None
        change = values[-1] - values[-2]
        size = float(np.linalg.norm(change))
        if size == 0.0:
            return np.zeros_like(found)
        error = discretisation_error(values, (*self.sizes, 1.0), ORDER).error
        share = error * float(np.linalg.norm(values[-1])) / size
        return np.asarray(share * change).reshape(found.shape)


def coarser(model: Model, problem: Problem) -> Coarser:
    """The motions of a model on two coarser meshes or lattices, or as many as there are."""
    found = [
        (one.trajectory, size)
        for settings, size in _coarser_settings(model, problem)
        if (one := _simulated(model, problem, settings)) is not None
    ]
    motions, sizes = zip(*found, strict=True) if found else ((), ())
    return Coarser(tuple(motions), tuple(sizes))


def _coarser_settings(model: Model, problem: Problem) -> Iterator[tuple[dict[str, float], float]]:
    """Settings, and the size of elements or cells over the model's own, coarse to fine."""
    lattice, levels = getattr(model, "lattice", None), problem.geometry.level
    base = levels(0)
    for step in (2, 1):
        if lattice is not None:
            ratio = COARSER_SPACING**step
            yield {"spacing": ratio * lattice.spacing}, ratio
        elif base is not None and (level := levels(-step)) is not None:
            yield {"level": -step}, level.size / base.size


def _simulated(model: Model, problem: Problem, settings: dict[str, float]) -> Simulation | None:
    try:
        return model.varied(**settings).prepare(problem).simulate()
    except (TypeError, ValueError):  # the model has no such setting, or refuses it
        return None


def _of_curve(name: str, curve: Curve, label: str, found: Floats, own: Floats | None) -> Comparison:
    """Root mean squares of the measured curve and of the model's difference from it."""
    spread = curve.uncertainty
    return Comparison(
        problem=NAME,
        case=name,
        faces="as in the scene",
        model=label,
        quantity=f"rms error of the {curve.column.partition('_')[0]}",
        unit=curve.unit,
        measured=0.0,
        uncertainty=np.nan if spread is None else _rms(spread),
        found=_rms(found - curve.values),
        numerical=np.nan if own is None else _rms(own),
        note=f"rms of the curve {_rms(curve.values):.4g} {curve.unit}",
    )


def _of_markers(markers: UserMarkers, label: str, moved: Floats, own: Floats | None) -> Comparison:
    """Comparison of the markers when the load is largest."""
    spread = markers.uncertainty
    return Comparison(
        problem=NAME,
        case="markers",
        faces="as in the scene",
        model=label,
        quantity="rms error of the markers",
        unit="m",
        measured=0.0,
        uncertainty=np.nan if spread is None else float(np.sqrt(3.0)) * _rms(spread),
        found=_rms(moved - markers.moved),
        numerical=np.nan if own is None else _rms(own),
        note=f"rms of the markers {_rms(markers.moved):.4g} m",
    )


def _rms(values: Floats) -> float:
    """Root mean square of numbers (k,), or of the lengths of vectors (k, 3)."""
    return float(np.sqrt((values**2).sum() / len(values)))
