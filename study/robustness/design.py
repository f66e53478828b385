"""The draws: Saltelli's design for Sobol indices, on SciPy's scrambled Sobol points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from study.robustness.unknowns import UNKNOWNS, Unknown, groups

Floats = NDArray[np.float64]


def check_size(size: int) -> None:
    """Raise ValueError unless the size is a power of two, as balanced Sobol points need."""
    if size < 2 or size & (size - 1):
        raise ValueError(f"size: {size} is no power of two; give 256, 4096 or the like")


def check_seed(seed: int) -> None:
    """ValueError for a seed below zero, of which there is no sequence."""
    if seed < 0:
        raise ValueError(f"seed: {seed} is negative; give 0 or more")


def shares(seed: int, size: int, unknowns: Sequence[Unknown] = UNKNOWNS) -> Floats:
    """Shares (size, groups + 2, unknowns) of the unknowns' ranges.

    The first two points of each row are the independent points A and B; the others are A with the
    values of one group of unknowns taken from B. ValueError unless `size` is a power of two.
    """
    from scipy.stats import qmc

    check_size(size)
    count, together = len(unknowns), groups(unknowns)
    points = qmc.Sobol(2 * count, seed=seed).random(size)
    found = np.repeat(points[:, None, :count], len(together) + 2, axis=1)
    found[:, 1] = points[:, count:]
    for i, places in enumerate(together.values()):
        found[:, i + 2, places] = points[:, [count + place for place in places]]
    return found
