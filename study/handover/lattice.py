"""The lattices of a scene as arrays, with the curves of their runs for comparison."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from msm.assembly import arrays
from msm.forces import internal_forces
from msm.integrators import INTEGRATORS
from msm.laws import LAWS, Law, force_law_of, initial_stiffness
from msm.network import Network
from study.handover import step_lattice
from study.models.lattice import PreparedLattice
from study.problem.problem import Problem
from study.results import Results
from study.results.arrays import Arrays
from study.run.preparation import PreparedPointScene, prepare_scene
from study.scene import Scene
from study.system.progress import Progress

Floats = NDArray[np.float64]

STEPPED = "symplectic-euler"
LAWS_STEPPED = ("hooke", "basafa")
DIGITS = 1e-9
"""Largest difference of a curve of this run from the stored one, over its largest value."""
WAVE = 0.02
"""Amplitude over the shortest spring of a displacement that strains all springs and cells."""
# As msm.lattice has them: x is the highest bit, z the lowest.
CORNERS = np.array([[(c >> 2) & 1, (c >> 1) & 1, c & 1] for c in range(8)])


@dataclass(frozen=True)
class LawConstants:
    """Name of a spring law and its constants [N/m] or dimensionless."""

    name: str
    constants: dict[str, float]


@dataclass(frozen=True)
class ExportedModel:
    """A lattice model: its own arrays, its law, and Young's modulus [Pa] at small strain.

    `initial_stiffness` [N/m]: at rest, of a spring of relative stiffness 1.
    """

    name: str
    label: str
    law: LawConstants
    modulus: float
    initial_stiffness: float
    arrays: Arrays


@dataclass(frozen=True)
class ExportedLattices:
    """The arrays of the lattice that the models of a scene share, and the models."""

    title: str
    problem: Problem
    shared: Arrays
    models: tuple[ExportedModel, ...]


def lattices(scene: Scene, progress: Progress) -> ExportedLattices:
    """Arrays of all lattices of a scene, each run once more.

    ValueError naming the key of what the exported stepper does not support, or for a scene without
    a lattice.
    """
    _refuse(scene)
    found = prepare_scene(scene, progress)
    if isinstance(found, PreparedPointScene):
        raise ValueError(  # noqa: TRY004 - a scene's choice, reported as such
            "organ.shape: a point has no lattice; use liver, block or a mesh"
        )
    prepared = {name: one for name, one in found.models.items() if isinstance(one, PreparedLattice)}
    if not prepared:
        raise ValueError("models: none of them is a lattice; add msm, basafa or reading")
    shared = _shared(next(iter(prepared.values())))
    models = tuple(_model(one, progress) for one in prepared.values())
    for one, model in zip(prepared.values(), models, strict=True):
        check_forces(_network(one), one.springs.material.law, shared, model)
    return ExportedLattices(scene.title, found.problem, shared, models)


def check_forces(net: Network, law: Law, shared: Arrays, model: ExportedModel) -> None:
    """Raise ValueError unless the exported stepper has the run's forces on a wavy displacement."""
    waves = np.sin(7.0 * np.arange(net.load.size)).reshape(net.load.shape)
    u = WAVE * net.length.min() * waves
    force = np.empty_like(u)
    internal_forces(law, net, u, force)
    constants = {"name": model.law.name, **model.law.constants}
    known = shared | model.arrays
    found = step_lattice.internal_force(known, constants, u)  # type: ignore[no-untyped-call] # a script
    if np.abs(found - force).max() > DIGITS * np.abs(force).max():
        raise ValueError(
            f"--to lattice: {model.name} has forces that the exported stepper does not know; leave "
            "out what goes beyond springs, volume term and an elastic foundation"
        )


def _refuse(scene: Scene) -> None:
    """Raise for what the exported stepper does not support, naming the key to change."""
    lattice = scene.lattice
    for is_asked, message in (
        (bool(scene.features), f"it has {', '.join(scene.features)}; leave these out"),
        (lattice.integrator != STEPPED, f'set lattice.integrator to "{STEPPED}"'),
        (lattice.geometry == "linear", 'set lattice.geometry to "nonlinear"'),
        (lattice.precision == "single", 'set lattice.precision to "double"'),
        (
            scene.damping.kind == "rayleigh" and scene.damping.stiffness > 0.0,
            "set damping.stiffness to 0",
        ),
    ):
        if is_asked:
            raise ValueError(
                f"--to lattice: the exported stepper does not follow this scene: {message}"
            )


def _network(one: PreparedLattice) -> Network:
    return arrays(one.assembly, one.springs.material, linear=one.linear)


def _shared(one: PreparedLattice) -> Arrays:
    problem, net, lattice = one.problem, _network(one), one.assembly.lattice
    weights, _ = lattice.interpolation(problem.observation.probes)
    rows = np.repeat(np.arange(len(net.mass)), np.diff(net.row).astype(np.int64))
    return {
        "nodes": lattice.nodes,
        "mass": net.mass,
        "ends": net.ends.astype(np.int64),
        "rest": net.rest,
        "scale": net.scale,
        "foundation": net.value,
        "foundation_row": rows,
        "foundation_column": net.column.astype(np.int64),
        "load": net.load,
        "probes": weights.toarray(),
        "push": np.asarray(problem.tool.direction),
        "times": problem.observation.times,
    }


def _model(one: PreparedLattice, progress: Progress) -> ExportedModel:
    law, material = one.springs.material.law, one.springs.material
    name = next(key for key, kind in LAWS.items() if kind is force_law_of(law))
    if name not in LAWS_STEPPED:
        raise ValueError(
            f"--to lattice: {one.model.name} has springs of law {name}, which the exported stepper "
            f"does not know; set lattice.law to one of {', '.join(LAWS_STEPPED)}"
        )
    net = _network(one)
    with progress.stage(one.model.name):
        found = one.moved()
    if found.trajectory.status != "finished":
        raise ValueError(
            f"--to lattice: {one.model.name} diverges; leave it out of models, or choose a smaller "
            "lattice.step_fraction"
        )
    return ExportedModel(
        name=one.model.name,
        label=one.model.label,
        law=LawConstants(name, _constants(law)),
        modulus=one.springs.modulus,
        initial_stiffness=initial_stiffness(law),
        arrays={
            "gamma_0": np.array(material.damping.gamma_0),
            "gamma_1": np.array(material.damping.gamma_1),
            "cells": net.cells.astype(np.int64),
            "bulk": net.bulk,
            "slopes": (2.0 * CORNERS - 1.0) / (4.0 * net.spacing),
            "substeps": found.substeps,
            "factors": _factors(one.problem, found.substeps),
            "curve": found.trajectory.displacement @ one.problem.tool.direction,
        },
    )


def _constants(law: Law) -> dict[str, float]:
    """Constants of a law by the names that its named tuple has."""
    return {key: float(x) for key, x in zip(type(law).__annotations__, law, strict=True)}


def _factors(problem: Problem, substeps: NDArray[np.int64]) -> Floats:
    """Share of the load at every step of a run, at the times at which its integrator needs it."""
    (at,) = INTEGRATORS[STEPPED].at
    times = problem.observation.times
    interval = float(times[1] - times[0])
    starts = [
        start + interval / count * np.arange(count)
        for start, count in zip(times[:-1], substeps, strict=True)
    ]
    return np.concatenate(
        [
            problem.factor(found + at * interval / count)
            for found, count in zip(starts, substeps, strict=True)
        ]
    )


def check_curves(found: ExportedLattices, results: Results) -> None:
    """Raise ValueError unless each model moves as in its results, up to their printed digits."""
    for model in found.models:
        stored = np.stack(
            [results.curve(model.name, probe).displacement for probe in found.problem.probes], 1
        )
        curve = model.arrays["curve"]
        if (
            stored.shape != curve.shape
            or np.abs(stored - curve).max() > DIGITS * np.abs(curve).max()
        ):
            raise ValueError(
                f"--to lattice: {model.name} moves otherwise than its results say, which another "
                "version or machine made; run the scene again"
            )
