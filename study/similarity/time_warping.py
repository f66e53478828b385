"""Dynamic time warping inside a band, as ISO/TS 18571 uses it to compare magnitudes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]


def warping_path(x: Floats, y: Floats, half_width: int) -> tuple[Indices, Indices]:
    """Pairs (i, j) from both starts to both ends of least summed (x_i - y_j)^2.

    `x`, `y` have shape (n,); pairs keep |i - j| <= `half_width`. Steps are (1, 0), (0, 1) and
    (1, 1), all of weight one; of equally cheap steps the first named is taken, so the path is
    unique.
    """
    return _trace_back(_accumulate(_banded_cost(x, y, half_width), half_width))


def _banded_cost(x: Floats, y: Floats, half_width: int) -> Floats:
    """Squared differences behind a border row and column; infinite outside the band."""
    index = np.arange(len(x))
    inside = np.abs(index[:, None] - index) <= half_width
    cost = np.full((len(x) + 1, len(x) + 1), np.inf)
    cost[1:, 1:][inside] = ((x[:, None] - y) ** 2)[inside]
    cost[0, 0] = 0.0
    return cost


def _accumulate(cost: Floats, half_width: int) -> Floats:
    """Least summed cost of reaching each cell, overwriting `cost`.

    Cells with the same i + j need only the two antidiagonals before them, and lie at a constant
    stride in memory: each antidiagonal is one array operation.
    """
    n = len(cost) - 1
    flat = cost.reshape(-1)
    for k in range(2, 2 * n + 1):  # k = i + j, counted from the border
        first = max(1, k - n, (k - half_width + 1) // 2)
        last = min(n, k - 1, (k + half_width) // 2)
        start, stop = first * n + k, last * n + k + 1
        left, up, corner = (flat[start - s : stop - s : n] for s in (1, n + 1, n + 2))
        flat[start:stop:n] += np.minimum(np.minimum(left, up), corner)
    return cost


def _trace_back(total: Floats) -> tuple[Indices, Indices]:
    i = j = len(total) - 1
    path = [(i, j)]
    while (i, j) != (1, 1):
        i, j = min(((i - 1, j), (i, j - 1), (i - 1, j - 1)), key=lambda cell: total[cell])
        path.append((i, j))
    pairs = np.array(path[::-1]) - 1
    return pairs[:, 0], pairs[:, 1]
