"""The patient of a draw: readings, and the stiffness that each fuzzy system gives for them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fuzzy.liver.knowledge import parameters
from fuzzy.liver.settings import LiverSettings
from fuzzy.liver.stiffness import NORMAL_LIVER, evaluate
from fuzzy.liver.table1 import AETIOLOGIES
from fuzzy.systems.options import InferenceOptions
from study.robustness.organ_unknowns import OrganDraw
from study.robustness.unknowns import STAGES, Draw

Floats = NDArray[np.float64]

SYSTEMS = ("mamdani", "sugeno", "interval-type-2")


Drawn = Draw | OrganDraw
"""Draws that have patient and fuzzy systems under the same names."""


def estimates(drawn: Sequence[Drawn]) -> Floats:
    """Stiffness [Pa] (n, 3) of draws by each of SYSTEMS."""
    return np.stack([_estimates(drawn, system) for system in SYSTEMS], axis=1)


def _estimates(drawn: Sequence[Drawn], system: str) -> Floats:
    """Stiffness [Pa] (n,); draws with the same settings are evaluated together."""
    groups = defaultdict[tuple[LiverSettings, tuple[str, ...]], list[int]](list)
    for i, draw in enumerate(drawn):
        settings = _settings(draw, system)
        present = draw.aetiologies if settings.missing.silences else AETIOLOGIES
        groups[settings, present].append(i)
    found = np.empty(len(drawn))
    for (settings, present), rows in groups.items():
        X = np.array([_readings(drawn[i]) for i in rows])
        found[rows] = evaluate(X, system, settings, present)[0]
    return found


def _settings(draw: Drawn, system: str) -> LiverSettings:
    """Settings of a draw; those that this system does not have stay at their defaults."""
    options = InferenceOptions(draw.sampled.sampling, draw.sampled.samples)
    settings = LiverSettings(knowledge=draw.knowledge, options=options)
    if draw.knowledge == STAGES:
        settings = replace(
            settings,
            reading=draw.placed.reading,
            placement=draw.placed.placement,
            consequent=draw.consequent,
            absent=draw.absent,
        )
    if system == "sugeno":
        return replace(
            settings, options=replace(options, sugeno_aggregation=draw.sugeno_aggregation)
        )
    if system == "interval-type-2":
        return replace(
            settings,
            footprint=draw.footprint,
            footprint_factor=draw.footprint_factor,
            options=replace(options, reducer=draw.reducer),
        )
    return settings


def _readings(draw: Drawn) -> list[float]:
    """A reading [Pa] of each aetiology, a normal liver's where it has none."""
    row = [NORMAL_LIVER] * len(AETIOLOGIES)
    for name, reading in readings(draw).items():
        row[AETIOLOGIES.index(name)] = reading
    return row


def readings(draw: Drawn) -> dict[str, float]:
    """The existing readings [Pa], alternately larger and smaller by the disagreement."""
    low, high = (parameters()[key] * 1e3 for key in ("input_low", "input_high"))
    names = draw.aetiologies
    off = [
        1.0 if len(names) == 1 else draw.disagreement ** (0.5 - k % 2) for k in range(len(names))
    ]
    return {
        name: min(max(draw.stiffness * factor, low), high)
        for name, factor in zip(names, off, strict=True)
    }
