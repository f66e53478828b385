"""Springs alone, which have Poisson ratio 1/4 whatever the tissue's."""

from __future__ import annotations

from collections.abc import Iterator

from study.scene import Scene
from study.tradeoff.contender import Settings
from study.tradeoff.lattice import FRACTION, prepare, run

__all__ = ["ANY_LOAD", "configurations", "prepare", "run"]

ANY_LOAD = True
SPACINGS = (2.0, 1.5, 1.0, 0.75)
"""Times that of the scene."""


def configurations(scene: Scene) -> Iterator[Settings]:
    """By spacing."""
    for times in SPACINGS:
        spacing = times * scene.lattice.spacing
        yield {"spacing": spacing, "volume_term": False, "step_fraction": FRACTION}
