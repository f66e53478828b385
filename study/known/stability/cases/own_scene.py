"""A scene's own lattice: its critical step, its rest, and its motion under many times its load."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from msm.assembly import Assembly, Material, arrays
from msm.damping import UNDAMPED
from msm.integrators import INTEGRATORS
from msm.model import Automatic, Fixed, Run, Step, critical_time_step, run
from msm.relaxation import relax
from msm.stability import DEFAULT
from msm.statics import static_displacement
from msm.timestep import whole_steps
from study.known.case import Case
from study.known.finding import Finding, beside, value
from study.known.stability.growth import longest_stable_step
from study.problem.problem import Problem
from study.run import lattices
from study.scene import Scene
from study.scene.file import resolved, validate
from study.scene.problem import problem_of

FRACTIONS = (0.5, 0.2)
"""Of the limit at rest, of the fixed steps."""
LOADS = (1.0, 10.0, 100.0, 1000.0)
MEASURED, SOLVED = 5e-3, 1e-6
FINER = 0.02
"""Of the motion, by which symplectic Euler's steps of 0.8 and 0.2 of the limit may differ."""
HERE = "study.known.stability.cases.own_scene"


def cases(scene: Scene) -> Iterator[Case]:
    """Cases of a scene with a body. ValueError for a single control point, which has no lattice."""
    if scene.is_point:
        raise ValueError("organ.shape: a single point has no lattice; give a scene with a body")
    given = {"scene": resolved(scene), "mesh": _digest(scene)}  # another mesh, another case
    yield _case("critical step", "steps", given, MEASURED, quick=True)
    yield _case("rest under its load", "rests", given, SOLVED)
    for times in LOADS:
        yield _case(
            f"motion under {times:g} times its load", "moves", given | {"times": times}, FINER
        )


def _digest(scene: Scene) -> str:
    """Of the organ's mesh file, if it has one."""
    path = scene.organ.mesh
    return hashlib.sha256(Path(path).read_bytes()).hexdigest() if path else ""


def _case(
    title: str, function: str, settings: dict[str, Any], tolerance: float, *, quick: bool = False
) -> Case:
    return Case(
        family="scene",
        name=title,
        function=f"{HERE}:{function}",
        arguments=settings,
        tolerance=tolerance,
        seconds=240.0,
        quick=quick,
    )


@dataclass(frozen=True)
class Lattice:
    """A scene's lattice with the reference modulus, posed."""

    scene: Scene
    posed: Problem
    assembly: Assembly
    material: Material

    def moved(self, step: Step) -> Run:
        """Its motion over the scene's time."""
        return run(
            self.assembly,
            self.material,
            self.posed.factor,
            self.posed.observation,
            step,
            integrator=self.scene.lattice.integrator,
        )


def steps(scene: dict[str, Any], mesh: str) -> Finding:
    """The critical step at rest, predicted and measured."""
    one = _lattice(scene, mesh)
    material = replace(one.material, damping=UNDAMPED)
    predicted = critical_time_step(one.assembly, material)
    net = arrays(one.assembly, material, linear=True)
    net, still = net._replace(load=np.zeros_like(net.load)), np.zeros_like(net.load)
    method = INTEGRATORS[DEFAULT]
    return value(predicted, longest_stable_step(material.law, net, method, predicted, still, 1000))


def rests(scene: dict[str, Any], mesh: str) -> Finding:
    """Linear rest by conjugate gradients beside that by relaxation."""
    one = _lattice(scene, mesh)
    net = arrays(one.assembly, one.material, linear=True)
    found, ended = relax(one.material.law, net)
    if ended.status != "at rest":
        return Finding("error", message=f"relaxation: {ended.status}")
    return beside(static_displacement(one.assembly, one.material), found)


def moves(scene: dict[str, Any], mesh: str, times: float) -> Finding:
    """Motion of the control points by the automatic step beside that by the finest fixed one.

    If no fixed step completes, the automatic one may not either, and is to lose the body when the
    finest does, to within a sampling interval.
    """
    one = _lattice(scene, mesh, times)
    found = one.moved(Automatic(one.scene.lattice.step_fraction)).trajectory
    interval = float(one.posed.observation.times[1])
    limit = critical_time_step(one.assembly, one.material)
    fixed = [one.moved(_fixed(interval, part * limit)).trajectory for part in FRACTIONS]
    complete = sum(other.status == "finished" for other in fixed)
    told = f"{complete} of {len(fixed)} fixed steps complete"
    if found.diverged_at is None:
        whole = [other for other in fixed if other.status == "finished"]
        if not whole:
            return Finding("error", message=f"nothing to compare with: {told}")
        return replace(beside(whole[-1].displacement, found.displacement), message=told)
    finest = fixed[-1].diverged_at
    if complete or finest is None:
        return Finding("error", message=f"lost by its step: {told}")
    late = max(0.0, abs(found.diverged_at - finest) - interval) / finest
    return Finding("value", finest, found.diverged_at, late, f"lost by its load: {told}")


def _fixed(interval: float, longest: float) -> Fixed:
    return Fixed(interval / whole_steps(interval, longest))


def _lattice(table: dict[str, Any], mesh: str, times: float = 1.0) -> Lattice:
    scene = validate(table, "scene")
    if _digest(scene) != mesh:
        raise ValueError(f"organ.mesh: {scene.organ.mesh} has changed since the cases were listed")
    scene = replace(scene, tool=replace(scene.tool, force=times * scene.tool.force))
    posed = problem_of(scene)
    assembly = lattices.assemble(scene, posed)
    modulus = scene.tissue.youngs_modulus
    material = lattices.elastic(assembly.lattice, modulus, lattices.poisson_ratio(scene))
    damping = lattices.node_damping(scene, modulus)
    return Lattice(scene, posed, assembly, replace(material, damping=damping))
