"""What a run records for its figures: the surface at intermediate times, and a section."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from study.mesh.cut import cut
from study.models.model import ModelRun
from study.problem.problem import Problem
from study.problem.trajectory import Trajectory
from study.results.arrays import Arrays

Floats = NDArray[np.float64]

FRAMES = 9
"""Number of samples at which the surface is recorded."""
STRAIGHT = 0.05
"""Largest deviation of a load from linear interpolation between frames, relative to its maximum."""


@dataclass(frozen=True)
class VisualOutput:
    """Where and when a run is recorded for its figures.

    `samples`: those at which the surface is recorded, the peak first and the final one last.
    `points` [m] (c, 3) and `triangles`: the section through the tool's axis. `held` and `loaded`
    (m,): the share of the area of each surface triangle that a support holds, or that a tool loads
    or would touch.
    """

    samples: tuple[int, ...]
    points: Floats
    triangles: NDArray[np.int64]
    held: Floats
    loaded: Floats


def visual_output(problem: Problem) -> VisualOutput:
    """The frames, the section and the marked surface of a problem."""
    (peak, last), tool = problem.observation.frames, problem.tool
    between = set(_frames(_loads(problem), {0, peak, last})) - {peak, last}
    points, triangles = cut(problem.geometry.mesh, tool.centre, _across(problem))
    return VisualOutput((peak, *sorted(between), last), points, triangles, *_acted_on(problem))


def _loads(problem: Problem) -> Floats:
    """Every load and the travel of every tool over the samples (samples, k), each at most 1."""
    times = problem.observation.times
    ways = [np.linalg.norm(one.travel(times), axis=1) for one in problem.rigid_tools]
    found = np.column_stack([problem.factors(times), *ways])
    return np.asarray(found / np.maximum(np.abs(found).max(axis=0), np.finfo(float).tiny))


def _frames(loads: Floats, given: set[int]) -> list[int]:
    """Samples that best interpolate the loads linearly; then those that halve the widest gaps."""
    found, samples = sorted(given), np.arange(len(loads))
    while len(found) < min(FRAMES, len(loads)):
        lines = np.stack([np.interp(samples, found, one[found]) for one in loads.T], axis=1)
        away = np.abs(loads - lines).max(axis=1)
        if away.max() > STRAIGHT:
            found = sorted({*found, int(away.argmax())})
            continue
        widest = int(np.diff(found).argmax())
        found = sorted({*found, (found[widest] + found[widest + 1]) // 2})
    return found


def with_visual_output(problem: Problem, found: VisualOutput) -> Problem:
    """The problem with an observation that includes the visual output."""
    seen = problem.observation
    surface = np.vstack([seen.surface_points, found.points])
    seen = replace(seen, frames=found.samples, surface_points=surface)
    return replace(problem, observation=seen)


def _across(problem: Problem) -> Floats:
    """Normal of the section: the plane of the push and the body's largest extent across it."""
    points, push = problem.geometry.surface.points, problem.tool.direction
    away = points - points.mean(axis=0)
    away = away - np.outer(away @ push, push)
    longest = np.linalg.eigh(away.T @ away)[1][:, -1]
    normal = np.cross(push, longest)
    return np.asarray(normal / np.linalg.norm(normal))


def _acted_on(problem: Problem) -> tuple[Floats, Floats]:
    """Shares of the area of each triangle that are held, and loaded."""
    rule, tools = problem.surface_rule, [problem.tool, *(one.tool for one in problem.loads)]
    given = rule.points, rule.normals
    held = (problem.foundation.density(*given) > 0.0) | problem.foundation.fixed(*given).any(axis=1)
    loaded = np.any([tool.profile(*given) > 0.0 for tool in tools], axis=0)
    areas = rule.weights.reshape(len(problem.geometry.surface.triangles), -1)
    held, loaded = (
        (areas * which.reshape(areas.shape)).sum(axis=1) / areas.sum(axis=1)
        for which in (held, loaded)
    )
    return held, loaded


def with_end_fields_only(run: ModelRun) -> ModelRun:
    """The run with its volume fields, which are large, at the peak and the end only."""
    bounds = None if run.bounds is None else (_ends(run.bounds[0]), _ends(run.bounds[1]))
    halved = None if run.halved is None else _ends(run.halved)
    return replace(run, trajectory=_ends(run.trajectory), bounds=bounds, halved=halved)


def _ends(one: Trajectory) -> Trajectory:
    return replace(one, volume_field=one.volume_field[[0, -1]])


def visual_arrays(found: VisualOutput, name: str, field: Floats) -> Arrays:
    """Arrays of a model's field (frames, s + c, 3): on the surface, in the section, and as a film.

    Surface and section [m] are at the peak and at the end. The film is in single precision, at all
    recorded samples in order.
    """
    count = field.shape[1] - len(found.points)
    order = np.unique(found.samples, return_index=True)[1]
    return {
        name: field[[0, -1], :count],
        f"cut.{name}": field[[0, -1], count:],
        f"film.{name}": field[order, :count].astype(np.float32),
    }
