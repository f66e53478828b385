"""Hanging nodes: nodes of small cells on edges and faces of larger ones, tied to their corners.

The displacement of a hanging node on an edge of the larger cell is the mean of that of the two
ends, on a face that of the four corners, so that displacement is continuous. The nodal forces are
distributed to these masters with the same weights, which conserves linear and angular momentum and
does no work. Where a master hangs itself, it is replaced by its own masters.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from msm.kernel import inner_kernel, kernel

if TYPE_CHECKING:
    from msm.network import Network

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


class Ties(NamedTuple):
    """Hanging nodes (h,), and the masters of each with their weights in compressed rows."""

    hanging: NDArray[np.uint32]
    first: NDArray[np.uint32]
    master: NDArray[np.uint32]
    part: Floats


def hanging_nodes(masters: csr_array) -> Bools:
    """Which nodes (n,) hang, from the interpolation (n, n) of all nodes by those that do not."""
    return np.asarray(masters.diagonal() == 0.0)


def tied(masters: csr_array | None) -> Ties:
    """Arrays of the hanging nodes for the kernels."""
    if masters is None:
        rows = csr_array((0, 0))
        nodes = np.zeros(0, dtype=np.int64)
    else:
        nodes = np.flatnonzero(hanging_nodes(masters))
        rows = csr_array(masters[nodes])
    return Ties(
        nodes.astype(np.uint32),
        rows.indptr.astype(np.uint32),
        rows.indices.astype(np.uint32),
        rows.data.astype(np.float64),
    )


@kernel()
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


@kernel()
def share_out(net: Network, force: Floats) -> None:
    """Move the forces (n, 3) on hanging nodes to their masters."""
    for k in range(net.hanging.shape[0]):
        i = net.hanging[k]
        for p in range(net.first_master[k], net.first_master[k + 1]):
            for d in range(3):
                force[net.master[p], d] += net.part[p] * force[i, d]
        for d in range(3):
            force[i, d] = 0.0


@kernel()
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
