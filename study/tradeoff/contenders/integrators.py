"""Every other integrator on the same lattice, at the scene's spacing and coarser."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from msm.integrators import INTEGRATORS
from msm.stability import DEFAULT
from study.scene import Scene
from study.tradeoff.contender import Settings
from study.tradeoff.lattice import FRACTION, lifts, prepare, run

__all__ = ["ANY_LOAD", "configurations", "prepare", "run"]

ANY_LOAD = True
RATES = (60.0, 250.0)
"""Steps per second [Hz] of integrators without a limit."""
SPACINGS = (2.0, 1.0)
"""Times that of the scene."""


def configurations(scene: Scene) -> Iterator[Settings]:
    """By integrator, spacing and, where nothing limits the step, by step."""
    for name, method in INTEGRATORS.items():
        bounded = bool(np.isfinite(method.oscillation))
        steps = [("step_fraction", FRACTION)] if bounded else [("step_rate", r) for r in RATES]
        for times in SPACINGS if name != DEFAULT else ():
            for key, value in steps:
                spacing = times * scene.lattice.spacing
                same = {"spacing": spacing, "volume_term": lifts(scene), "integrator": name}
                yield same | {key: value}
