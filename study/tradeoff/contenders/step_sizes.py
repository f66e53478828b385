"""The default integrator with shorter and longer steps, and at fixed rates."""

from __future__ import annotations

from collections.abc import Iterator

from study.scene import Scene
from study.tradeoff.contender import Settings
from study.tradeoff.lattice import lifts, prepare, run

__all__ = ["ANY_LOAD", "configurations", "prepare", "run"]

ANY_LOAD = True
STEPS = (
    *(("step_rate", rate) for rate in (500.0, 1000.0, 2000.0)),
    *(("step_fraction", fraction) for fraction in (0.95, 0.4, 0.2)),
)


def configurations(scene: Scene) -> Iterator[Settings]:
    """By step, at the scene's spacing; a fixed one that is too long diverges."""
    for key, value in STEPS:
        same = {"spacing": scene.lattice.spacing, "volume_term": lifts(scene)}
        yield same | {key: value}
