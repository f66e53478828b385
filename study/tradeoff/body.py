"""The finite-element body of a contender."""

from __future__ import annotations

from fem_reference import model as fem
from fem_reference.elasticity import Body
from study.problem.damping import RayleighDamping
from study.problem.problem import Problem
from study.run.lattices import damping_rates
from study.scene import Scene

FRAME_RATE = 60.0
"""Steps per second [Hz], of which a sample takes a whole number."""


def build(scene: Scene, posed: Problem, element: str, level: int, method: str) -> Body:
    """The body on a level of the organ's meshes. ValueError if there is no such level."""
    found = posed.geometry.level(level)
    if found is None:
        raise ValueError(f"level {level}: the organ has no such mesh; choose another level")
    where = (posed.foundation, posed.tool, element, posed.geometry.project)
    return fem.build(found.mesh, scene.tissue, *where, method)


def damping(scene: Scene) -> RayleighDamping:
    """That of the reference."""
    return RayleighDamping(*damping_rates(scene))
