"""A scene's own models: critical step and rest of its lattices, motion under multiples of its load.

The cases run the lattice of the tissue's modulus, with the law, geometry and integrator of the
scene, and the models that the scene names beside the reference and those of fuzzy estimates, which
are the same lattice at other moduli.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from msm.assembly import arrays
from msm.damping import UNDAMPED
from msm.integrators import INTEGRATORS
from msm.laws import Law, stiffness
from msm.model import critical_time_step
from msm.relaxation import relax
from study.known.case import Case
from study.known.finding import Finding, at_most, beside, value
from study.known.stability.growth import EXPLICIT, measured_limit
from study.models.lattice import LatticeModel, PreparedLattice
from study.models.model import Prepared
from study.models.table import kind, model
from study.problem.problem import Problem
from study.results.provenance import organ_sha256
from study.run.preparation import prepare_models
from study.scene import Scene
from study.scene.file import resolved, validate
from study.scene.problem import problem_of
from study.sweep.canonical import Plain

FRACTIONS = (0.5, 0.2)
"""Equal steps over the critical step at rest, or over the model's own step."""
LOADS = (1.0, 10.0, 100.0, 1000.0)
MEASURED, SOLVED = 5e-3, 1e-6
FINER = 0.02
"""Admissible difference of symplectic Euler at 0.8 and 0.2 of the limit, over the motion."""
WATCHED = {"runge-kutta-4": 1600, "split-volume": 400}
"""Steps that show growth just above the limit, where 1000 are too few or too expensive."""
LEAPS, LEAP = 40, 1e3
"""Number of implicit steps to rest, and the length of each over the explicit limit."""
NEAR_REST = 1e-9
HERE = "study.known.stability.cases.user_scene"


def cases(scene: Scene) -> Iterator[Case]:
    """Cases of a scene with an organ. ValueError for a single control point, without a lattice."""
    _refuse_point(scene)
    for name in tried(scene):
        given = {"name": name, "scene": resolved(scene), "mesh": organ_sha256(scene)}
        if isinstance(model(scene, name), LatticeModel):
            if scene.lattice.integrator in EXPLICIT:
                yield _case(f"{name}, critical step", "steps", given, MEASURED, quick=True)
            yield _case(f"{name}, rest under its load", "rests", given, SOLVED)
        for times in LOADS:
            title = f"{name}, motion under {times:g} times its load"
            yield _case(title, "moves", given | {"times": times}, FINER)


def refuse(scene: Scene) -> None:
    """Raise ValueError for a scene with a model that cannot be prepared, before any case is run."""
    _refuse_point(scene)
    free = _free(scene)
    prepare_models((model(free, name) for name in tried(free)), problem_of(free))


def _refuse_point(scene: Scene) -> None:
    if scene.is_point:
        raise ValueError("organ.shape: a single point has no lattice; give a scene with a body")


def _free(scene: Scene) -> Scene:
    """The scene with steps that follow the stability limit."""
    return replace(scene, lattice=replace(scene.lattice, time_step=None, step_rate=None))


def tried(scene: Scene) -> list[str]:
    """Kinds of models that are run for a scene."""
    others = (n for n in scene.models if n != "fem" and not kind(n).patient_specific)
    return list(dict.fromkeys(("tissue", *others)))


def _case(
    title: str, function: str, settings: Plain, tolerance: float, *, quick: bool = False
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


def steps(name: str, scene: Plain, mesh: str | None) -> Finding:
    """The critical step at rest, predicted and measured, without damping.

    For a law with a corner at rest the prediction may be shorter, since motions involve both
    slopes.
    """
    one, _ = _lattice(name, scene, mesh)
    integrator = one.model.lattice.integrator
    material = replace(one.springs.material, damping=UNDAMPED)
    predicted = float(critical_time_step(one.assembly, material, integrator))
    arguments = (one.assembly, material, integrator, predicted, WATCHED.get(integrator, 1000))
    measured = measured_limit(*arguments, linear=one.linear)
    if _has_corner(material.law):
        return at_most(measured, predicted, "a law with a corner at rest", "value")
    return value(predicted, measured)


def _has_corner(law: Law) -> bool:
    return not np.isclose(stiffness(law, -NEAR_REST), stiffness(law, NEAR_REST), rtol=1e-6)


def rests(name: str, scene: Plain, mesh: str | None) -> Finding:
    """Rest under the full load, by relaxation and by long implicit steps."""
    one, _ = _lattice(name, scene, mesh)
    material = replace(one.springs.material, damping=UNDAMPED)  # which the rest does not depend on
    law, net = material.law, arrays(one.assembly, material, linear=one.linear)
    found, ended = relax(law, net)
    if ended.status != "at rest":
        return Finding("error", message=f"relaxation: {ended.status}")
    method, dt = INTEGRATORS["implicit-euler"], LEAP * _explicit_limit(one)
    u, v = np.zeros((2, *net.load.shape))
    method.advance(law, net, np.ones((LEAPS, len(method.at))), dt, u, v)
    return beside(u, found)


def _explicit_limit(one: PreparedLattice) -> float:
    return float(critical_time_step(one.assembly, one.springs.material, "velocity-verlet"))


def moves(name: str, scene: Plain, mesh: str | None, times: float) -> Finding:
    """Motion of the control points by the model's own steps and by the finest equal ones.

    If no equal step completes, the model's own steps need not either; they must then diverge at the
    same time as the finest, within one sampling interval.
    """
    one, problem = _prepared(name, scene, mesh, times)
    own = one.simulate()
    found, interval = own.trajectory, float(problem.observation.times[1])
    longest = min(one.critical_time_step, own.step / FRACTIONS[0])
    equal = [one.simulate(part * longest).trajectory for part in FRACTIONS]
    complete = sum(other.status == "finished" for other in equal)
    message = f"{complete} of {len(equal)} fixed steps complete"
    if found.ended_at is None:
        whole = [other for other in equal if other.status == "finished"]
        if not whole:
            return Finding("error", message=f"nothing to compare with: {message}")
        return replace(beside(whole[-1].displacement, found.displacement), message=message)
    finest = equal[-1].ended_at
    if complete or finest is None:
        return Finding("error", message=f"lost by its step: {message}")
    late = max(0.0, abs(found.ended_at - finest) - interval) / finest
    return Finding("value", finest, found.ended_at, late, f"lost by its load: {message}")


def _lattice(name: str, scene: Plain, mesh: str | None) -> tuple[PreparedLattice, Problem]:
    found, problem = _prepared(name, scene, mesh)
    assert isinstance(found, PreparedLattice)  # noqa: S101 - only lattices have these cases
    return found, problem


def _prepared(
    name: str, table: Plain, mesh: str | None, times: float = 1.0
) -> tuple[Prepared, Problem]:
    """A model of a scene whose steps follow the limit, under `times` the load."""
    scene = validate(table, "scene")
    if organ_sha256(scene) != mesh:
        raise ValueError(f"organ.mesh: {scene.organ.mesh} has changed since the cases were listed")
    scene = replace(_free(scene), tool=replace(scene.tool, force=times * scene.tool.force))
    problem = problem_of(scene)
    return model(scene, name).prepare(problem), problem
