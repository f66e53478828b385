"""Exact motion of damped oscillators under a load that comes and goes smoothly."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def factor(times: Floats, period: float) -> Floats:
    """Share of the full load at times [s], (1 - cos(2 pi t / period)) / 2."""
    return np.asarray(0.5 * (1.0 - np.cos(2.0 * np.pi * times / period)))


def response(
    stiffness: Floats, damping: Floats, times: Floats, period: float
) -> tuple[Floats, Floats]:
    """Displacement and velocity (times, m) from rest of y'' + c y' + k y = factor(t).

    The sum of the rest under the mean load, the steady oscillation, and two exponentials that
    satisfy the initial conditions; c^2 = 4 k is excluded.
    """
    w = 2.0j * np.pi / period
    steady = -0.5 / (stiffness + damping * w + w**2)
    root = np.sqrt(0.25 * damping**2 - stiffness + 0j)
    first, second = -0.5 * damping + root, -0.5 * damping - root
    start, speed = 0.5 / stiffness + steady.real, (w * steady).real
    a, b = (speed - second * start) / (second - first), (first * start - speed) / (second - first)
    terms = ((steady, w), (a, first), (b, second))
    waves = [(c * np.exp(np.outer(times, s)), s) for c, s in terms]
    displacement = 0.5 / stiffness + sum(wave.real for wave, _ in waves)
    velocity = sum((wave * s).real for wave, s in waves)
    return np.asarray(displacement), np.asarray(velocity)
