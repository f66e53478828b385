"""The effect of lattice discretisation on a ranking: draws repeated on finer lattices."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from study.robustness.rows import Finer
from study.robustness.summary import TIE, wilson

Floats = NDArray[np.float64]

TIMES = 2.0
"""Refinement factor: the discretisation error falls to between a quarter and a half."""


def changes(
    coarse: Floats, fine: Floats, columns: Sequence[tuple[str, str]], times: float = TIMES
) -> Iterator[Finer]:
    """A row per measure, from scores (draws, contenders, measures) of the same draws on both.

    Draws in which a motion diverged on either lattice are omitted; there are no rows if none
    remain.
    """
    whole = np.isfinite(coarse).all(axis=(1, 2)) & np.isfinite(fine).all(axis=(1, 2))
    for m, column in enumerate(columns):
        pair = coarse[whole, :, m], fine[whole, :, m]
        told = np.logical_and(*(_lead(scores) >= TIE for scores in pair))
        if not told.any():
            continue
        one, other = (scores[told] for scores in pair)
        count = int((one.argmax(axis=1) != other.argmax(axis=1)).sum())
        low, high = wilson(count, len(one))
        yield Finer(
            *column,
            times,
            len(one),
            count / len(one),
            low,
            high,
            float(np.median(_lead(one))),
            float(np.median(np.abs(one - other).max(axis=1))),
        )


def _lead(scores: Floats) -> Floats:
    """Highest score minus the next, (draws,)."""
    ordered = np.sort(scores, axis=1)
    return np.asarray(ordered[:, -1] - ordered[:, -2])
