"""Hanging nodes: nodes of small cells on edges and faces of larger ones, tied to their corners.

The displacement of a hanging node on an edge of the larger cell is the mean of that of the two
ends, on a face that of the four corners, so that displacement is continuous. The nodal forces are
distributed to these masters with the same weights, which conserves linear and angular momentum and
does no work. Where a master hangs itself, it is replaced by its own masters.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from msm.kernel import inner_kernel, kernel

if TYPE_CHECKING:
    from msm.network import Network

Floats = NDArray[np.float64]


@kernel(makes_arrays=False)
def interpolate(net: Network, x: Floats) -> None:
    """Interpolate x (n, 3) at the hanging nodes from their masters."""
    for k in range(net.hanging.shape[0]):
        i = net.hanging[k]
        for d in range(3):
            x[i, d] = 0.0
        for p in range(net.first_master[k], net.first_master[k + 1]):
            for d in range(3):
                x[i, d] += net.part[p] * x[net.master[p], d]


@inner_kernel()
def interpolate_both(net: Network, u: Floats, v: Floats) -> None:
    """Interpolate displacement and velocity (n, 3) at the hanging nodes."""
    interpolate(net, u)
    interpolate(net, v)


@inner_kernel()
def share_out(net: Network, force: Floats) -> None:
    """Move the forces (n, 3) on hanging nodes to their masters."""
    for k in range(net.hanging.shape[0]):
        i = net.hanging[k]
        for p in range(net.first_master[k], net.first_master[k + 1]):
            for d in range(3):
                force[net.master[p], d] += net.part[p] * force[i, d]
        for d in range(3):
            force[i, d] = 0.0


@inner_kernel()
def share_out_values(net: Network, values: Floats) -> None:
    """Add values (n,) of hanging nodes to their masters, and set them to a mean of the masters'."""
    for k in range(net.hanging.shape[0]):
        for p in range(net.first_master[k], net.first_master[k + 1]):
            values[net.master[p]] += net.part[p] * values[net.hanging[k]]
    for k in range(net.hanging.shape[0]):
        mean = 0.0
        for p in range(net.first_master[k], net.first_master[k + 1]):
            mean += net.part[p] * values[net.master[p]]
        values[net.hanging[k]] = mean
