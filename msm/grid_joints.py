"""What joins the grids of a lattice whose cells have several sizes, compiled.

A node stands in the grid of each size that it is a corner of. One of these places moves; the others
are copies, which move as it does and give it their forces. A copy of a node that hangs moves as the
nodes do that it hangs on (`msm.hanging`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msm.kernel import inner_kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Joints(NamedTuple):
    """Places of copies, what moves them, and the support, which knows no sizes.

    The place `copy[k]` moves as the places `master[p]` by the shares `part[p]`, p from `first[k]`
    to `first[k + 1]`. Foundation in compressed rows: of the place `held[r]` to the places
    `column[p]` by `value[p]` [N/m], p from `row[r]` to `row[r + 1]`.
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
    """Set what copies have of x (3, m) to that of what moves them."""
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
    """Give the forces (3, m) on copies to what moves them."""
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
    """Subtract S x, so many times."""
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
