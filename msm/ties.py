"""Hanging nodes of a lattice as linear constraints: the masters of each, with their weights."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

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
