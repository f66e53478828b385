"""The problem that all contenders solve, as plain data for a run elsewhere and as objects."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from study.mesh.quadrature import over_volume
from study.problem.problem import Problem
from study.results.provenance import mesh_sha256
from study.scene import Scene
from study.scene.file import resolved, validate
from study.scene.problem import problem_of
from study.sweep.canonical import Plain

Floats = NDArray[np.float64]

SAMPLING = 0.05
"""Interval [s] of samples: a whole number of frames at 60 Hz and of steps at 1 kHz."""
FEWEST_SAMPLES = 16
DIGITS = 8
TIDY_DIGITS = 12


@dataclass(frozen=True)
class Stated:
    """A scene and its problem; the field is looked at once in each tetrahedron.

    On the built-in liver that moves an error by 2 % of itself against eight points in each.
    """

    scene: Scene
    problem: Problem


def sampled(scene: Scene) -> Scene:
    """The scene at samples that frames and steps of the usual rates divide.

    What is left of its duration beyond them is cut off. A scene too short for that keeps its own.
    ValueError if it is a single mass point.
    """
    if scene.is_point:
        raise ValueError(
            'organ.shape: "point" has no displacement field to be accurate in; choose a scene with '
            "an organ"
        )
    free = replace(scene.lattice, time_step=None, step_rate=None)  # contenders have their own
    scene = replace(scene, lattice=free)
    count = int(scene.time.duration / SAMPLING * (1.0 + 1e-9))
    if count + 1 < FEWEST_SAMPLES:
        return scene
    return replace(
        scene, time=replace(scene.time, duration=tidy(count * SAMPLING), samples=count + 1)
    )


def arguments(scene: Scene) -> Plain:
    """The scene as plain values, with the SHA-256 of its mesh file if it has one."""
    return {"scene": resolved(scene), "mesh_sha256": mesh_sha256(scene.organ.mesh)}


def stated(scene: Plain, mesh_sha256: str | None) -> Stated:
    """The problem of `arguments`, kept for the next run. ValueError if its mesh has changed."""
    # In one order of keys, whichever way it came: control points are numbered by it.
    return _stated(json.dumps(scene, sort_keys=True), mesh_sha256)


@lru_cache(maxsize=2)
def _stated(scene: str, mesh: str | None) -> Stated:
    found = validate(json.loads(scene), "scene")
    if mesh_sha256(found.organ.mesh) != mesh:
        raise ValueError(f"organ.mesh: {found.organ.mesh} has changed since the runs were planned")
    problem = problem_of(found)
    rule = over_volume(problem.geometry.mesh, 1)
    seen = replace(problem.observation, volume_points=rule.points)
    return Stated(found, replace(problem, volume_rule=rule, observation=seen))


def tidy(value: float) -> float:
    """The value without the rounding of a product, as it would be written in a scene."""
    return float(f"{value:.{TIDY_DIGITS}g}")


def plain(values: Floats) -> list[float]:
    """All entries, in eight digits."""
    return [float(f"{value:.{DIGITS}g}") for value in values.ravel()]
