"""Dynamic time warping within a band, as ISO/TS 18571 uses it to compare magnitudes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
Choices = NDArray[np.uint8]

STEPS = ((1, 0), (0, 1), (1, 1))
"""Steps of (i, j) along a path; of equally cheap ones the first is taken."""


def warping_path(x: Floats, y: Floats, half_width: int) -> tuple[Indices, Indices]:
    """Pairs (i, j) from both starts to both ends with the least sum of (x_i - y_j)^2.

    `x`, `y` have shape (n,); pairs keep |i - j| <= `half_width`. Steps are (1, 0), (0, 1) and (1,
    1), all with weight one; of equally cheap steps the first named is taken, so the path is unique.
    """
    steps, first = _cheapest_steps(x, y, half_width)
    return _trace_back(steps, first)


def _cheapest_steps(x: Floats, y: Floats, half_width: int) -> tuple[Choices, Indices]:
    """Number in `STEPS` of the best step into each cell (i, j), with i + j = k in row k.

    Row k begins at i = first[k]. Its cells depend on the two previous rows only, so costs are kept
    for three rows, and memory grows with the band: one byte per cell.
    """
    n = len(x)
    rank = np.arange(2 * n - 1)
    first = np.maximum(np.maximum(0, rank - n + 1), (rank - half_width + 1) // 2)
    last = np.minimum(np.minimum(n - 1, rank), (rank + half_width) // 2)
    steps = np.zeros((len(rank), int((last - first).max()) + 1), dtype=np.uint8)
    # By i + 1, with a border that no path crosses.
    before, last_but_one, row = (np.full(n + 2, np.inf) for _ in range(3))
    before[1] = (x[0] - y[0]) ** 2
    for k, a, b in zip(range(1, len(first)), first[1:], last[1:] + 1, strict=True):
        totals = np.stack([before[a:b], before[a + 1 : b + 1], last_but_one[a:b]])
        best = totals.argmin(axis=0)
        steps[k, : b - a] = best
        row[a + 1 : b + 1] = (x[a:b] - y[k - b + 1 : k - a + 1][::-1]) ** 2 + totals.min(axis=0)
        row[a], row[b + 1] = np.inf, np.inf  # what an older row left beside the band
        before, last_but_one, row = row, before, last_but_one
    return steps, first


def _trace_back(steps: Choices, first: Indices) -> tuple[Indices, Indices]:
    i = j = len(steps) // 2
    path = [(i, j)]
    while i or j:
        k = i + j
        down, along = STEPS[steps[k, i - first[k]]]
        i, j = i - down, j - along
        path.append((i, j))
    pairs = np.array(path[::-1])
    return pairs[:, 0], pairs[:, 1]
