"""A scene and its problem, as plain data for a run elsewhere and as objects."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from functools import lru_cache

from study.mesh.quadrature import over_volume
from study.problem.problem import Problem
from study.results.provenance import organ_sha256
from study.scene import Scene
from study.scene.file import resolved, validate
from study.scene.problem import problem_of
from study.sweep.canonical import Plain


@dataclass(frozen=True)
class Stated:
    """A scene and its problem; the field is looked at once in each tetrahedron.

    On the built-in liver that moves an error by 2 % of itself against eight points in each.
    """

    scene: Scene
    problem: Problem


def arguments(scene: Scene) -> Plain:
    """The scene as plain values, with the SHA-256 of its files of the organ if it has some."""
    return {"scene": resolved(scene), "mesh_sha256": organ_sha256(scene)}


def stated(scene: Plain, mesh_sha256: str | None) -> Stated:
    """The problem of `arguments`, kept for the next run. ValueError if its mesh has changed."""
    # In one order of keys, whichever way it came: control points are numbered by it.
    return _stated(json.dumps(scene, sort_keys=True), mesh_sha256)


@lru_cache(maxsize=2)
def _stated(scene: str, mesh: str | None) -> Stated:
    found = validate(json.loads(scene), "scene")
    if organ_sha256(found) != mesh:
        named = found.organ.mesh or "a file of its tissue"
        raise ValueError(f"organ.mesh: {named} has changed since the runs were planned")
    problem = problem_of(found)
    rule = over_volume(problem.geometry.mesh, 1)
    seen = replace(problem.observation, volume_points=rule.points)
    return Stated(found, replace(problem, volume_rule=rule, observation=seen))
