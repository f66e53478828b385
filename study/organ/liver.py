"""The built-in liver: a smooth implicit shape of adult size, a test shape and not an anatomy.

Axes: x from the patient's right (-) to left (+), y from anterior (-) to posterior (+), z upwards.
Two blended ellipsoidal lobes are cut by a visceral hollow, a dorsal plane, the groove of the vena
cava, the ligament notch and the gallbladder fossa. Lengths below are metres before scaling.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

UNSCALED_VOLUME = 2.0261e-3
"""Volume [m^3] of the shape before scaling: grid integration at 0.75 mm, converged to 2e-4."""

_HALF_EXTENT = np.array([0.15, 0.12, 0.12])
_VISCERAL_NORMAL = np.array([0.380, 0.300, -0.875])


def signed_function(points: Array, volume: float) -> Array:
    """Negative inside a liver of the given volume [m^3]; points [m], shape (..., 3).

    It has the unit of a length but is only roughly a distance: its gradient is 0.57-1.13 near the
    surface.
    """
    scale = _scale(volume)
    return scale * _unscaled(np.asarray(points, dtype=float) / scale)


def bounding_box(volume: float) -> tuple[Array, Array]:
    """Corners [m] of a box that holds the liver with a margin."""
    half = _HALF_EXTENT * _scale(volume)
    return -half, half


def _scale(volume: float) -> float:
    return float(np.cbrt(volume / UNSCALED_VOLUME))


def _unscaled(p: Array) -> Array:
    x, y, z = p[..., 0], p[..., 1], p[..., 2]
    right = _ellipsoid(p, (-0.045, 0.0, 0.0), (0.078, 0.070, 0.082), beta=0.10)
    left = _ellipsoid(p, (0.055, -0.018, 0.022), (0.078, 0.046, 0.034), beta=0.22, gamma=0.15)
    body = _smooth_min(right, left, 0.030)

    visceral = p @ _VISCERAL_NORMAL - 0.026 - 2.2 * ((x - 0.02) ** 2 + y**2)
    body = _smooth_max(body, visceral, 0.014)
    dorsal = y - 0.058
    body = _smooth_max(body, dorsal, 0.012)
    vena_cava = 0.020 - np.hypot(x - 0.012, y - 0.066)
    body = _smooth_max(body, vena_cava, 0.010)
    ligament = 0.011 - np.hypot(x - 0.022, 0.55 * (z + 0.012)) - np.maximum(0.0, y + 0.020)
    body = _smooth_max(body, ligament, 0.010)
    gallbladder = -_ellipsoid(p, (-0.012, -0.028, -0.046), (0.018, 0.036, 0.016), beta=0.2)
    return _smooth_max(body, gallbladder, 0.008)


def _ellipsoid(
    p: Array,
    centre: tuple[float, float, float],
    radii: tuple[float, float, float],
    beta: float,
    gamma: float = 0.0,
) -> Array:
    """First-order distance to an ellipsoid turned about y by beta, then about z by gamma [rad]."""
    cb, sb, cg, sg = np.cos(beta), np.sin(beta), np.cos(gamma), np.sin(gamma)
    about_y = np.array([[cb, 0.0, sb], [0.0, 1.0, 0.0], [-sb, 0.0, cb]])
    about_z = np.array([[cg, sg, 0.0], [-sg, cg, 0.0], [0.0, 0.0, 1.0]])
    q = (p - np.array(centre)) @ (about_z @ about_y).T
    r = np.array(radii)
    k0 = np.linalg.norm(q / r, axis=-1)
    k1 = np.linalg.norm(q / r**2, axis=-1)
    return np.asarray(k0 * (k0 - 1.0) / np.maximum(k1, 1e-12))


def _smooth_min(a: Array, b: Array, k: float) -> Array:
    h = np.clip(0.5 + (b - a) / (2.0 * k), 0.0, 1.0)
    return b * (1.0 - h) + a * h - k * h * (1.0 - h)


def _smooth_max(a: Array, b: Array, k: float) -> Array:
    return -_smooth_min(-a, -b, k)
