"""A block of draws: stiffness that each fuzzy system gives, motions, and scores."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fuzzy.liver.knowledge import parameters
from fuzzy.liver.settings import LiverSettings
from fuzzy.liver.stiffness import NORMAL_LIVER, evaluate
from fuzzy.liver.table1 import AETIOLOGIES
from fuzzy.systems.options import InferenceOptions
from msm.oscillators import RAMP, SINUSOID, STEP, Load, Oscillator, move
from study.robustness.design import shares
from study.robustness.unknowns import STAGES, Draw, draws
from study.scene.schema import BasafaConstants, Damping
from study.similarity.batch import COLUMNS, scores
from study.sweep.canonical import Plain

Floats = NDArray[np.float64]

SYSTEMS = ("mamdani", "sugeno", "interval-type-2")
SAMPLES = 201
KINDS = {"step": STEP, "ramp-hold-release": RAMP, "sinusoid": SINUSOID}
CORNERS = (0.1, 0.7, 0.8)
"""Of the span: ends of ramp, hold and release. The built-in scenes have the same shares."""
PERIODS = 2.0
"""Of a sinusoid in the span."""
TABLE_II, RATIO = BasafaConstants(), Damping().ratio


class Block(NamedTuple):
    """Stiffness [Pa] (n, 3) by each of SYSTEMS, and scores (n, 3, measures) of their motions."""

    estimates: Floats
    scores: Floats


def run(seed: int, size: int, first: int, count: int) -> dict[str, Plain]:
    """Estimates and scores of a block of the design, as plain lists."""
    found = evaluated(
        draws(shares(seed, size)[first : first + count].reshape(-1, len(Draw._fields)))
    )
    return {
        "estimates": np.round(found.estimates, 2).tolist(),
        "scores": np.round(found.scores.reshape(len(found.scores), -1), 8).tolist(),
    }


def evaluated(drawn: Sequence[Draw]) -> Block:
    """Estimates and scores of draws; a score is NaN where a motion diverged or cannot be scored."""
    estimates = np.stack([_estimates(drawn, system) for system in SYSTEMS], axis=1)
    found = np.full((len(drawn), len(SYSTEMS), len(COLUMNS)), np.nan)
    for i, draw in enumerate(drawn):
        found[i] = _scores(draw, estimates[i])
    return Block(estimates, found)


def _estimates(drawn: Sequence[Draw], system: str) -> Floats:
    """Stiffness [Pa] (n,); draws with the same settings are answered together."""
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


def _settings(draw: Draw, system: str) -> LiverSettings:
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


def _readings(draw: Draw) -> list[float]:
    """A reading [Pa] of each aetiology: every other one larger or smaller by the disagreement."""
    row = [NORMAL_LIVER] * len(AETIOLOGIES)
    low, high = (parameters()[key] * 1e3 for key in ("input_low", "input_high"))
    for k, name in enumerate(draw.aetiologies):
        off = 1.0 if len(draw.aetiologies) == 1 else draw.disagreement ** (0.5 - k % 2)
        row[AETIOLOGIES.index(name)] = min(max(draw.stiffness * off, low), high)
    return row


def _load(draw: Draw) -> Load:
    up, held, down = (share * draw.span for share in CORNERS)
    force = draw.strain * TABLE_II.k1
    return Load(KINDS[draw.history], force, (up, held, down), math.tau * PERIODS / draw.span)


def _benchmark(draw: Draw) -> Oscillator:
    """Eqs. (6), (7), (9) with Table II on a spring of the draw's rest length."""
    h, table = draw.rest_length, TABLE_II
    start = draw.start * h
    return Oscillator(
        draw.mass, h, table.k1 / h, table.k2 / h, table.x_c, table.gamma_0, table.gamma_1, start
    )


def _tuned(draw: Draw, modulus: float) -> Oscillator:
    """Eqs. (1), (2) with the stiffness of a Young's modulus [Pa]."""
    h = draw.rest_length
    k = draw.conversion * modulus * h
    gamma = 2.0 * RATIO * math.sqrt(k * draw.mass)
    return Oscillator(draw.mass, h, k, 0.0, 1.0, gamma, 0.0, draw.start * h)


def _scores(draw: Draw, moduli: Floats) -> Floats:
    """Scores (3, measures) of the tuned motions against the benchmark's."""
    load = _load(draw)
    truth = move(_benchmark(draw), load, draw.span, SAMPLES)
    found = np.full((len(moduli), len(COLUMNS)), np.nan)
    if not np.isfinite(truth).all() or np.ptp(truth[0]) == 0.0:
        return found
    for row, modulus in zip(found, moduli, strict=True):
        motion = move(_tuned(draw, float(modulus)), load, draw.span, SAMPLES)
        if np.isfinite(motion).all():
            row[:] = scores(motion[0], motion[1], truth[0], truth[1])
    return found
