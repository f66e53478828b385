"""Rigid registration of corresponding points."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Registered(NamedTuple):
    """Points [m] (n, 3) moved onto others; rms of the residual [m], by axis (3,) and in total."""

    points: Floats
    by_axis: Floats
    rms: float


def registered(points: Floats, onto: Floats) -> Registered:
    """Move points (n, 3) rigidly to minimise their squared distances from `onto`.

    Kabsch (1976), Acta Cryst. A32:922; without reflection. ValueError for fewer than three points,
    or sets of different sizes.
    """
    if points.shape != onto.shape or len(points) < 3:
        raise ValueError(
            f"{len(points)} and {len(onto)} points cannot be registered: give the same 3 or more"
        )
    centre, other = points.mean(axis=0), onto.mean(axis=0)
    left, _, right = np.linalg.svd((points - centre).T @ (onto - other))
    sign = np.sign(np.linalg.det(left @ right))
    turn = left @ np.diag([1.0, 1.0, sign]) @ right
    moved = (points - centre) @ turn + other
    squares = ((moved - onto) ** 2).mean(axis=0)
    return Registered(moved, np.sqrt(squares), float(np.sqrt(squares.sum())))
