"""Ranks of models of which only some are known to differ."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def rank_ranges(better: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last rank that each of n models may have, 1 the best; `better` (n, n).

    `better[i, j]`: model i is known to be better than j. A model has the first rank left by those
    known to be better and the last one left by those known to be worse, so two that are not known
    to differ share a rank, and nothing is rounded into groups. Who is better than one that is
    better than a third is better than the third.
    """
    closed = better.copy()
    for k in range(len(closed)):
        closed |= np.outer(closed[:, k], closed[k])
    first, last = 1 + closed.sum(axis=0), len(closed) - closed.sum(axis=1)
    return [(int(a), int(b)) for a, b in zip(first, last, strict=True)]
