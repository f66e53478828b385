"""Control mass points on one spring, eqs. (1) and (5)-(9), compiled for large samples.

The motion is that of `msm.control_point`, whose standard solver takes milliseconds per point. A
compiled Rosenbrock method solves it here: linearly implicit, since the benchmark may have 25 times
critical damping, and with an adaptive step for any sample of the parameters.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]

STEP, RAMP, SINUSOID = 0, 1, 2
"""Load histories: constant; up, held and down again; a sine from zero."""
TOLERANCE = 1e-8
"""Error of a step relative to the largest displacement and velocity so far."""
LARGEST_COUNT = 200_000
"""Number of steps above which a motion counts as diverged."""

# ROS4 with an L-stable choice of gamma: Hairer and Wanner, Solving Ordinary Differential Equations
# II, table IV.7.2 (order 4, embedded order 3), in the form that needs no product with a Jacobian.
_GAMMA = 0.57282
_A21, _A31, _A32 = 2.0, 1.867943637803922, 0.2344449711399156
_C21, _C31, _C32 = -7.137615036412310, 2.580708087951457, 0.6515950076447975
_C41, _C42, _C43 = -2.137148994382534, -0.3214669691237626, -0.6949742501781779
_B1, _B2, _B3, _B4 = 2.255570073418735, 0.2870493262186792, 0.4353179431840180, 1.093502252409163
_E1, _E2, _E3, _E4 = (
    -0.2815431932141155,
    -0.07276199124934920,
    -0.1082196201495311,
    -1.093502252409163,
)
_T2, _T3 = 1.14564000000000000, 0.65521686381559
_D1, _D2, _D3, _D4 = 0.57282, -1.769193891319233, 0.7592633437920482, -0.1049021087100450


class Oscillator(NamedTuple):
    """A mass point [kg] on a spring of a rest length [m].

    `k1`, `k2` [N/m], `x_c`: eqs. (6), (7) per rest length, k2 = 0 for a linear spring; `c0` [N s/m]
    and `c1` [N s/m^2]: eq. (9); `start` [m]: initial displacement.
    """

    mass: float
    rest_length: float
    k1: float
    k2: float
    x_c: float
    c0: float
    c1: float
    start: float


class Load(NamedTuple):
    """A force [N] over time: STEP, RAMP or SINUSOID.

    `corners` [s]: ends of ramp, hold and release of a RAMP; `omega` [rad/s] of a SINUSOID.
    """

    kind: int
    force: float
    corners: tuple[float, float, float]
    omega: float


@njit(cache=True)
def force_at(load: Load, t: float) -> tuple[float, float]:
    """Force [N] and its rate [N/s] at a time [s]; at a corner, the limit from the right."""
    if load.kind == STEP:
        return load.force, 0.0
    if load.kind == SINUSOID:
        phase = load.omega * t
        return load.force * math.sin(phase), load.force * load.omega * math.cos(phase)
    up, held, down = load.corners
    if t < up:
        return load.force * t / up, load.force / up
    if t < held:
        return load.force, 0.0
    if t < down:
        return load.force * (down - t) / (down - held), -load.force / (down - held)
    return 0.0, 0.0


@njit(cache=True)
def _spring(p: Oscillator, x: float) -> tuple[float, float]:
    """Force [N] and slope [N/m] of eqs. (6), (7) at a displacement [m]."""
    strain = x / p.rest_length
    size = abs(strain)
    if size <= p.x_c:
        force = p.k1 * strain + p.k2 * strain**3
        return p.rest_length * force, p.k1 + 3.0 * p.k2 * strain**2
    b = p.k1 + 3.0 * p.k2 * p.x_c**2
    a = p.k1 * p.x_c + p.k2 * p.x_c**3
    return p.rest_length * (a + b * (size - p.x_c)) * (1.0 if strain > 0.0 else -1.0), b


@njit(cache=True)
def _acceleration(p: Oscillator, load: Load, t: float, x: float, v: float) -> float:
    return (force_at(load, t)[0] - _spring(p, x)[0] - (p.c0 + p.c1 * abs(x)) * v) / p.mass


@njit(cache=True)
def _step(
    p: Oscillator, load: Load, t: float, x: float, v: float, h: float
) -> tuple[float, float, float, float]:
    """Displacement and velocity after a step h, and the estimated error of each.

    The 2 x 2 systems with I / (h gamma) - J of x' = v, v' = a are solved in closed form.
    """
    d = 1.0 / (h * _GAMMA)
    sign = 1.0 if x > 0.0 else -1.0
    a_x = -(_spring(p, x)[1] + p.c1 * sign * v) / p.mass
    a_v = -(p.c0 + p.c1 * abs(x)) / p.mass
    a_t = force_at(load, t)[1] / p.mass
    det = d * (d - a_v) - a_x

    r = _acceleration(p, load, t, x, v) + h * _D1 * a_t
    k1x, k1v = ((d - a_v) * v + r) / det, (a_x * v + d * r) / det

    x2, v2 = x + _A21 * k1x, v + _A21 * k1v
    q = v2 + _C21 * k1x / h
    r = _acceleration(p, load, t + _T2 * h, x2, v2) + _C21 * k1v / h + h * _D2 * a_t
    k2x, k2v = ((d - a_v) * q + r) / det, (a_x * q + d * r) / det

    x3, v3 = x + _A31 * k1x + _A32 * k2x, v + _A31 * k1v + _A32 * k2v
    a3 = _acceleration(p, load, t + _T3 * h, x3, v3)
    q = v3 + (_C31 * k1x + _C32 * k2x) / h
    r = a3 + (_C31 * k1v + _C32 * k2v) / h + h * _D3 * a_t
    k3x, k3v = ((d - a_v) * q + r) / det, (a_x * q + d * r) / det

    q = v3 + (_C41 * k1x + _C42 * k2x + _C43 * k3x) / h
    r = a3 + (_C41 * k1v + _C42 * k2v + _C43 * k3v) / h + h * _D4 * a_t
    k4x, k4v = ((d - a_v) * q + r) / det, (a_x * q + d * r) / det

    return (
        x + _B1 * k1x + _B2 * k2x + _B3 * k3x + _B4 * k4x,
        v + _B1 * k1v + _B2 * k2v + _B3 * k3v + _B4 * k4v,
        abs(_E1 * k1x + _E2 * k2x + _E3 * k3x + _E4 * k4x),
        abs(_E1 * k1v + _E2 * k2v + _E3 * k3v + _E4 * k4v),
    )


@njit(cache=True)
def move(p: Oscillator, load: Load, duration: float, samples: int) -> Floats:
    """Displacement [m] and velocity [m/s] (2, samples) at equally spaced times of the duration [s].

    NaN after a divergence. Steps end at samples, so the corners of the load must be samples.
    """
    out = np.full((2, samples), np.nan)
    x, v, interval = p.start, 0.0, duration / (samples - 1)
    out[0, 0], out[1, 0] = x, v
    h, count = interval, 0
    size_x, size_v = abs(x), 0.0
    for i in range(1, samples):
        done = 0.0
        while done < interval:
            count += 1
            h = min(h, interval - done)
            x1, v1, error_x, error_v = _step(p, load, (i - 1) * interval + done, x, v, h)
            scale_x, scale_v = max(size_x, abs(x1), 1e-15), max(size_v, abs(v1), 1e-15)
            error = max(error_x / scale_x, error_v / scale_v) / TOLERANCE
            if not (error < 1e30) or count > LARGEST_COUNT:
                return out
            if error <= 1.0:
                done = interval if interval - done - h < 1e-9 * interval else done + h
                x, v, size_x, size_v = x1, v1, scale_x, scale_v
            h *= min(4.0, max(0.2, 0.9 * max(error, 1e-12) ** -0.25))
        out[0, i], out[1, i] = x, v
    return out
