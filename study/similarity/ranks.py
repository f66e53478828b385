"""Ranks of models of which only some are known to differ."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def rank_ranges(better: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last possible rank of n models, 1 the best; `better` (n, n).

    `better[i, j]`: model i is known to be better than j. The first rank of a model follows the
    models known to be better, and its last rank precedes those known to be worse, so that two
    models not known to differ share ranks. The relation is completed transitively.
    """
    closed = better.copy()
    for k in range(len(closed)):
        closed |= np.outer(closed[:, k], closed[k])
    first, last = 1 + closed.sum(axis=0), len(closed) - closed.sum(axis=1)
    return [(int(a), int(b)) for a, b in zip(first, last, strict=True)]
