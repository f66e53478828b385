"""A block of draws: the stiffness that each fuzzy system gives, motions, and scores."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msm.oscillators import RAMP, SINUSOID, STEP, Load, Oscillator, move
from study.robustness.design import shares
from study.robustness.patient import SYSTEMS, estimates
from study.robustness.unknowns import Draw, draws
from study.scene.schema import BasafaConstants, Damping
from study.similarity.batch import COLUMNS, scores
from study.sweep.canonical import Plain

Floats = NDArray[np.float64]

SAMPLES = 201
KINDS = {"step": STEP, "ramp-hold-release": RAMP, "sinusoid": SINUSOID}
CORNERS = (0.1, 0.7, 0.8)
"""Ends of ramp, hold and release over the time span, as in the built-in scenes."""
PERIODS = 2.0
"""Periods of a sinusoid in the time span."""
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
    return plain(found)


def plain(found: Block) -> dict[str, Plain]:
    """A block as JSON lists; None for a score that does not exist."""
    scored = np.round(found.scores.reshape(len(found.scores), -1), 8)
    return {
        "estimates": np.round(found.estimates, 2).tolist(),
        "scores": [[x if math.isfinite(x) else None for x in row] for row in scored.tolist()],
    }


def evaluated(drawn: Sequence[Draw]) -> Block:
    """Estimates and scores of draws; NaN where a motion diverged or cannot be scored."""
    moduli = estimates(drawn)
    found = np.full((len(drawn), len(SYSTEMS), len(COLUMNS)), np.nan)
    for i, draw in enumerate(drawn):
        found[i] = _scores(draw, moduli[i])
    return Block(moduli, found)


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
