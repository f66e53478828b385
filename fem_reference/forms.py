"""Integrals over cells of products of shape functions and of their gradients, node by node.

scikit-fem evaluates the shape functions at the quadrature points. The cell matrices are batched
products of small matrices, and all global matrices share one sparsity pattern. As forms of
scikit-fem, which are called for every pair of shape functions, this took eight times as long.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from fem_reference.blocks import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

CELLS = 2048
"""Cells per batch: all cell matrices together are several times as large as the global one."""


class Pattern(NamedTuple):
    """Sparsity pattern, `indptr` and `indices`, of a matrix that couples the nodes of each cell.

    `place` (cells, a, a): number of the entry of each pair of nodes of a cell.
    """

    indptr: NDArray[np.int32]
    indices: NDArray[np.int32]
    place: Ints

    def summed(self, parts: Floats) -> Floats:
        """Entries of the global matrix from cell matrices (cells, a, a)."""
        found = np.bincount(self.place.ravel(), parts.ravel(), minlength=len(self.indices))
        return np.asarray(found, dtype=np.float64)


@dataclass(frozen=True)
class Gradients:
    """Integrals [m] of d_i v d_j u over a body, v of the row's node and u of the column's.

    `values` (entries, 3, 3) in the pattern of rows `indptr` and columns `indices`.
    """

    indptr: NDArray[np.int32]
    indices: NDArray[np.int32]
    values: Floats


def pattern(basis: Any) -> Pattern:
    """Sparsity pattern of a scikit-fem basis of one component."""
    nodes = np.asarray(basis.element_dofs.T)
    each = nodes.shape[1]
    pairs = np.repeat(nodes, each, axis=1).ravel(), np.tile(nodes, each).ravel()
    shape = (basis.N, basis.N)
    found = csr_array((np.ones(len(pairs[0]), np.int8), pairs), shape=shape)
    entries = csr_array((np.arange(found.nnz), found.indices, found.indptr), shape=shape)
    return Pattern(found.indptr, found.indices, entries[pairs].reshape(-1, each, each))


def products(basis: Any, where: Pattern, density: Floats | None = None) -> csr_array:
    """Integrals [m^3] of products u v of shape functions, times a density (cells,) if given."""
    values = np.stack([np.asarray(one[0])[0] for one in basis.basis], axis=-1)
    pairs = (values[:, :, None] * values[:, None, :]).reshape(len(values), -1)
    entries = where.summed(_weighed(basis, density) @ pairs)
    return csr_array((entries, where.indices, where.indptr), shape=(basis.N, basis.N))


def gradients(basis: Any, where: Pattern, density: Floats | None = None) -> Gradients:
    """Integrals of products of shape function derivatives, times a density (cells,) if given."""
    weights = _weighed(basis, density)[..., None]
    found = np.zeros((len(where.indices), 3, 3))
    for start in range(0, len(weights), CELLS):
        cells = slice(start, start + CELLS)
        slopes = [np.stack([one[0].grad[i][cells] for one in basis.basis], -1) for i in range(3)]
        tested = [(one * weights[cells]).mT for one in slopes]
        parts = np.array([[own @ tried for tried in slopes] for own in tested])
        _add_parts(where.place[cells], parts, found)
    return Gradients(where.indptr, where.indices, found)


@kernel  # type: ignore[untyped-decorator] # numba has no types
def _add_parts(place: Ints, parts: Floats, total: Floats) -> None:
    """Add parts (3, 3, cells, a, a) to the entries (entries, 3, 3) of their pairs of nodes."""
    for cell in range(place.shape[0]):
        for a in range(place.shape[1]):
            for b in range(place.shape[2]):
                for i in range(3):
                    for j in range(3):
                        total[place[cell, a, b], i, j] += parts[i, j, cell, a, b]


def _weighed(basis: Any, density: Floats | None) -> Any:
    return basis.dx if density is None else basis.dx * density[:, None]
