"""Compiled nonlinear Gauss-Seidel iteration for contact forces with Coulomb friction."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SWEEPS = 20_000
TOLERANCE = 1e-9
"""Largest change of a force in a sweep, relative to the largest force."""
LOOKED_AFTER, FALLEN, LEAST_PART = 100, 0.9, 1 / 16
"""Sweeps between two checks; a larger remaining share of the change halves the relaxation, to
LEAST_PART at least: with high friction that couples normal and tangential forces, full relaxation
need not converge."""


@numba.njit(cache=True, error_model="numpy")
def nonlinear_gauss_seidel(
    compliance: Floats, offset: Floats, friction: Floats, start: Floats
) -> Floats:
    """Forces [N] (v, 3) that meet the law at each contact point, given those at the others.

    Arguments as of `fem_reference.contact.law.frictional_forces`, without points of infinite gap.
    """
    count = len(offset)
    force = start.copy()
    gap = compliance @ force.ravel() + offset.ravel()
    part, looked = 1.0, np.inf
    for sweep in range(SWEEPS):
        largest, changed = 0.0, 0.0
        for i in range(count):
            k = 3 * i
            own = compliance[k : k + 3, k : k + 3].copy()
            free = gap[k : k + 3] - own @ force[i]
            new = _local_force(own, free, friction[i], force[i])
            change = part * (new - force[i])
            size = np.abs(change).max()
            if size > 0.0:
                for j in range(3):  # rows, as the compliance is symmetric
                    gap += change[j] * compliance[k + j]
            force[i] += change
            changed, largest = max(changed, size / part), max(largest, np.abs(new).max())
        if changed <= TOLERANCE * largest:
            break
        if sweep % LOOKED_AFTER == LOOKED_AFTER - 1:
            if changed > FALLEN * looked:
                part = max(0.5 * part, LEAST_PART)
            looked = changed
    return force


@numba.njit(cache=True, error_model="numpy")
def _local_force(own: Floats, free: Floats, friction: float, before: Floats) -> Any:
    """Force (3,) of one contact point with relative displacement free + own force."""
    stuck = np.linalg.solve(own, -free)
    if np.isinf(friction):
        return stuck
    found = np.zeros(3)
    if free[0] >= 0.0 and stuck[0] <= 0.0:
        return found
    if stuck[0] > 0.0 and np.hypot(stuck[1], stuck[2]) <= friction * stuck[0]:
        return stuck
    found[:] = before
    # Slip: the tangential force is the projection of the sticking one onto the friction disc.
    stiff = 1.0 / max(own[1, 1], own[2, 2])
    for _ in range(200):
        normal = max(0.0, -(free[0] + own[0, 1] * found[1] + own[0, 2] * found[2]) / own[0, 0])
        slip = free[1:] + own[1:, 0] * normal + own[1:, 1] * found[1] + own[1:, 2] * found[2]
        tangent = found[1:] - stiff * slip
        size, limit = np.hypot(tangent[0], tangent[1]), friction * normal
        if size > limit:
            tangent *= limit / size
        change = max(abs(normal - found[0]), np.abs(tangent - found[1:]).max())
        found[0], found[1], found[2] = normal, tangent[0], tangent[1]
        if change <= 1e-13 * (abs(normal) + 1e-300):
            break
    return found
