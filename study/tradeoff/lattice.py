"""A lattice as a contender, whatever it is made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from msm import model
from msm.assembly import arrays
from msm.calibration import SPRING_POISSON_RATIO
from msm.integrators import INTEGRATORS
from msm.lattice import LatticeMesh
from msm.linearised import farthest
from msm.stability import Follower
from msm.timestep import LOOK, Automatic, Fixed, Rate
from study.problem.problem import Problem
from study.run import lattices
from study.run.lattices import asked_step, assemble, fuzzy_tuned
from study.scene import Scene
from study.tradeoff.contender import Observed, Ready, Settings

Floats = NDArray[np.float64]
Choose = Callable[[Scene, LatticeMesh], lattices.Contender]

FRACTION = 0.8
"""Of the critical step, where nothing else is asked for."""


def of_tissue(scene: Scene, lattice: LatticeMesh) -> lattices.Contender:
    """Springs of the tissue's own modulus, so that the error is the model's, not an estimate's."""
    return fuzzy_tuned(scene, lattice, "tissue", scene.tissue.youngs_modulus)


def lifts(scene: Scene) -> bool:
    """Whether the tissue's Poisson ratio is one that springs alone do not have."""
    return scene.tissue.poisson_ratio > SPRING_POISSON_RATIO


def with_settings(scene: Scene, settings: Settings) -> Scene:
    """The scene with these keys of its table `lattice`, on a cubic lattice."""
    free = replace(scene.lattice, springs="lattice", time_step=None, step_rate=None)
    return replace(scene, lattice=replace(free, **settings))


def run(scene: Scene, posed: Problem, settings: Settings, choose: Choose = of_tissue) -> Observed:
    """The motion of a lattice with these keys of the scene's table `lattice`."""
    chosen = with_settings(scene, settings)
    assembly = assemble(chosen, posed)
    found = model.run(
        assembly,
        choose(chosen, assembly.lattice).material,
        posed.factor,
        posed.observation,
        asked_step(chosen),
        integrator=chosen.lattice.integrator,
        linear=chosen.lattice.geometry == "linear",
    )
    return Observed(found.trajectory, found.smallest_step, found.margin, found.inverted_cells)


def prepare(scene: Scene, posed: Problem, settings: Settings, choose: Choose = of_tissue) -> Ready:
    """A lattice at rest; between its steps the limit is looked at as often as in a run."""
    chosen = with_settings(scene, settings)
    assembly = assemble(chosen, posed)
    material = choose(chosen, assembly.lattice).material
    method = INTEGRATORS[chosen.lattice.integrator]
    net = arrays(assembly, material, linear=chosen.lattice.geometry == "linear")
    follower = Follower(material.law, net, method)
    u, v = np.zeros_like(net.load), np.zeros_like(net.load)
    dt, taken = _step(chosen, follower.limit(u)), 0

    def advance(count: int) -> None:
        nonlocal taken
        starts = dt * (taken + np.arange(count, dtype=np.float64))
        factors = np.stack([posed.factor(starts + at * dt) for at in method.at], axis=1)
        method.advance(material.law, net, factors, dt, u, v)
        taken += count

    def take_step() -> None:
        advance(1)
        if taken % LOOK == 0:
            farthest(u)
            follower.limit(u)

    def restart() -> None:
        nonlocal taken
        u[:], v[:], taken = 0.0, 0.0, 0

    return Ready(take_step, u.copy, dt, net.load.size, advance, restart)


def _step(scene: Scene, limit: float) -> float:
    """The step [s] that a run at rest would take, but for a whole number of them to a sample."""
    asked = asked_step(scene)
    if isinstance(asked, Automatic):
        return asked.fraction * limit
    if isinstance(asked, Rate):
        return 1.0 / asked.hertz
    assert isinstance(asked, Fixed)  # noqa: S101 - a scene has no other
    return asked.seconds
