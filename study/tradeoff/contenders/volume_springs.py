"""Springs with the volume term, which has the tissue's Poisson ratio."""

from __future__ import annotations

from collections.abc import Iterator

from study.scene import Scene
from study.tradeoff.contender import Settings
from study.tradeoff.lattice import FRACTION, lifts, prepare, run

__all__ = ["ANY_LOAD", "configurations", "prepare", "run"]

ANY_LOAD = True
SPACINGS = (2.0, 1.75, 1.5, 1.25, 1.0, 0.8, 2.0 / 3.0, 0.5)
"""Times that of the scene."""


def configurations(scene: Scene) -> Iterator[Settings]:
    """By spacing; none for a tissue whose Poisson ratio springs have already."""
    for times in SPACINGS if lifts(scene) else ():
        spacing = times * scene.lattice.spacing
        yield {"spacing": spacing, "volume_term": True, "step_fraction": FRACTION}
