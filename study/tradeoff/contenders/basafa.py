"""The Basafa benchmark, which has the stiffness of Table II and not that of the tissue."""

from __future__ import annotations

from collections.abc import Iterator

from msm.lattice import LatticeMesh
from study.problem.problem import Problem
from study.run import lattices
from study.scene import Scene
from study.tradeoff import lattice
from study.tradeoff.contender import Observed, Ready, Settings

ANY_LOAD = True
SPACINGS = (2.0, 1.5, 1.0)
"""Times that of the scene."""


def configurations(scene: Scene) -> Iterator[Settings]:
    """By spacing."""
    for times in SPACINGS:
        yield {"spacing": times * scene.lattice.spacing, "step_fraction": lattice.FRACTION}


def run(scene: Scene, posed: Problem, settings: Settings) -> Observed:
    """The whole motion."""
    return lattice.run(scene, posed, settings, _choose)


def prepare(scene: Scene, posed: Problem, settings: Settings) -> Ready:
    """Set up to take steps."""
    return lattice.prepare(scene, posed, settings, _choose)


def _choose(scene: Scene, built: LatticeMesh) -> lattices.Contender:
    return lattices.benchmark(scene, built.spacing)
