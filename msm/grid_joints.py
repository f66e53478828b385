"""Coupling of the grids of a graded lattice, compiled.

A node has a place in the grid of each cell size of which it is a corner. One of them, the primary
place, carries the motion. The others are copies, which follow it and pass their forces to it. A
copy of a hanging node follows the masters of the node (`msm.hanging`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msm.kernel import inner_kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Joints(NamedTuple):
    """Copies with their masters, and the foundation, which couples grids.

    The displacement at the place `copy[k]` is the sum of those at `master[p]` times `part[p]`, p
    from `first[k]` to `first[k + 1]`. Foundation in compressed rows: `value[p]` [N/m] couples the
    place `held[r]` to the place `column[p]`, p from `row[r]` to `row[r + 1]`.
    """

    copy: Ints
    first: Ints
    master: Ints
    part: Floats
    held: Ints
    row: Ints
    column: Ints
    value: Floats


@inner_kernel()
def follow(joints: Joints | None, x: Floats) -> None:
    """Interpolate x (3, m) at the copies from their masters."""
    if joints is None:
        return
    for k in range(joints.copy.shape[0]):
        a, b, c = 0.0, 0.0, 0.0
        for p in range(joints.first[k], joints.first[k + 1]):
            j, share = joints.master[p], joints.part[p]
            a, b, c = a + share * x[0, j], b + share * x[1, j], c + share * x[2, j]
        i = joints.copy[k]
        x[0, i], x[1, i], x[2, i] = a, b, c


@inner_kernel()
def share_out(joints: Joints | None, force: Floats) -> None:
    """Move the forces (3, m) on copies to their masters."""
    if joints is None:
        return
    for k in range(joints.copy.shape[0]):
        i = joints.copy[k]
        a, b, c = force[0, i], force[1, i], force[2, i]
        force[0, i], force[1, i], force[2, i] = 0.0, 0.0, 0.0
        for p in range(joints.first[k], joints.first[k + 1]):
            j, share = joints.master[p], joints.part[p]
            force[0, j] += share * a
            force[1, j] += share * b
            force[2, j] += share * c


@inner_kernel()
def add_joint_foundation(joints: Joints | None, x: Floats, times: float, force: Floats) -> None:
    """Subtract `times` S x, with S the foundation."""
    if joints is None:
        return
    for r in range(joints.held.shape[0]):
        a, b, c = 0.0, 0.0, 0.0
        for p in range(joints.row[r], joints.row[r + 1]):
            j, k = joints.column[p], joints.value[p]
            a, b, c = a + k * x[0, j], b + k * x[1, j], c + k * x[2, j]
        i = joints.held[r]
        force[0, i] -= times * a
        force[1, i] -= times * b
        force[2, i] -= times * c
