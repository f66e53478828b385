"""What Mindlin's formula for a dragged sphere neglects, by boundary elements of the half space.

The formula has tangential forces along the drag alone, and lets what slips move across it. Here
each square of the surface obeys Coulomb's law with both components, on an incompressible half
space, on which normal and tangential tractions do not act on each other's displacements.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import fftconvolve

SHEAR, FRICTION, SQUARES = 1.0, 0.3, 32
SHARE = 0.5  # of the force at which all of it slides


def influences(width):
    """Displacements (2, 2, m, m) of squares by a unit traction on that in the middle.

    Cerruti's along and across the traction (Johnson 1985, eq. 3.75 with nu 1/2), integrated.
    """
    k = width * np.arange(-SQUARES, SQUARES + 1)
    found = np.zeros((2, 2, len(k), len(k)))
    for i in (-1, 1):
        for j in (-1, 1):
            x, y = np.meshgrid(k + 0.5 * i * width, k + 0.5 * j * width, indexing="ij")
            along, across = y * np.arcsinh(x / np.abs(y)), x * np.arcsinh(y / np.abs(x))
            found[0, 0] += i * j * (2.0 * along + across)  # of 1 / R + x^2 / R^3
            found[1, 1] += i * j * (along + 2.0 * across)
            found[[0, 1], [1, 0]] -= i * j * np.hypot(x, y)  # of x y / R^3
    return found / (4.0 * np.pi * SHEAR)


def pressure(width):
    """Hertz's, of radius 1 and size 1 in the middle, in the mean of each square."""
    fine = (np.arange(8 * SQUARES) + 0.5) / 8 * width - 0.5 * SQUARES * width
    whole = np.sqrt(np.maximum(1.0 - np.add.outer(fine**2, fine**2), 0.0))
    return whole.reshape(SQUARES, 8, SQUARES, 8).mean(axis=(1, 3))


def dragged(*, across):
    """Tangential force over that of sliding, where Mindlin's is SHARE; with forces across or not.

    The tractions minimise the energy in their cones: projected gradients, after Nesterov.
    """
    width = 2.04 / SQUARES
    limit, by = FRICTION * pressure(width), influences(width)
    load = limit.sum() * width**2
    # Mindlin's stiffness 8 G a / (2 - nu), and the way at which his force is that share.
    aside = 1.5 * load / (8.0 * SHEAR / 1.5) * (1.0 - (1.0 - SHARE) ** (2.0 / 3.0))

    def displacement(q):
        each = fftconvolve(by, q[None], axes=(2, 3))
        return each[:, :, SQUARES : 2 * SQUARES, SQUARES : 2 * SQUARES].sum(axis=1)

    stiff = 1.0 / (2.0 * np.abs(by[0]).sum())
    q = ahead = np.zeros((2, SQUARES, SQUARES))
    pace = 1.0
    for _ in range(400):
        new = ahead - stiff * (displacement(ahead) - np.array([aside, 0.0])[:, None, None])
        new[1] *= across
        new *= np.minimum(1.0, limit / np.maximum(np.hypot(*new), 1e-300))
        after = 0.5 * (1.0 + np.sqrt(1.0 + 4.0 * pace**2))
        ahead, q, pace = new + (pace - 1.0) / after * (new - q), new, after
    return q[0].sum() * width**2 / load


def test_slip_across_a_drag_adds_a_thousandth_to_mindlins_force():
    """Without it the formula is met up to the squares' error."""
    along, both = dragged(across=False), dragged(across=True)
    assert along == pytest.approx(SHARE, rel=2e-3)
    assert 1e-3 < both / along - 1.0 < 2e-3
