"""Products with sparse matrices of dense blocks, compiled: they are bound by what is read."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

kernel = numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc"})


@dataclass(frozen=True)
class Blocks:
    """Row i of blocks has entries `first[i]` to `last[i]` of `data`, in columns `indices`.

    `data` (entries, r, c) may be in single precision, which halves what is read.
    """

    first: Ints
    last: Ints
    indices: Ints
    data: NDArray[Any]

    def __matmul__(self, x: Floats) -> Floats:
        """The product with a vector."""
        found = np.zeros(len(self.first) * self.data.shape[1])
        self.add_product(x, found)
        return found

    def add_product(self, x: Floats, total: Floats, share: float = 1.0) -> None:
        """Add a share of the product to a total."""
        _add_product(self.first, self.last, self.indices, self.data, share, x, total)


@dataclass(frozen=True)
class SymmetricBlocks:
    """A symmetric matrix by blocks of 3 x 3: the first of each row on its diagonal, others above.

    What is below is not read.
    """

    upper: Blocks

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return (3 * len(self.upper.first), 3 * len(self.upper.first))

    def __matmul__(self, x: Floats) -> Floats:
        """The product with a vector."""
        found, upper = np.zeros(len(x)), self.upper
        _add_symmetric(upper.first, upper.last, upper.indices, upper.data, x, found)
        return found

    def __abs__(self) -> SymmetricBlocks:
        return SymmetricBlocks(replace(self.upper, data=np.abs(self.upper.data)))

    @property
    def single(self) -> SymmetricBlocks:
        """A copy in single precision, a quarter of the memory."""
        upper = self.upper
        count = upper.last - upper.first
        ends = np.concatenate([[0], np.cumsum(count)]).astype(np.int32)
        kept = np.repeat(upper.first - ends[:-1], count) + np.arange(ends[-1])
        data = upper.data[kept].astype(np.float32)
        return SymmetricBlocks(Blocks(ends[:-1], ends[1:], upper.indices[kept], data))


def blocks_of(matrix: Any, dtype: Any = np.float64) -> Blocks:
    """Those of a matrix of scipy's by blocks, in order of their columns."""
    matrix.sort_indices()
    ends = matrix.indptr.astype(np.int32, copy=False)
    data = matrix.data.astype(dtype, copy=False)
    return Blocks(ends[:-1], ends[1:], matrix.indices.astype(np.int32, copy=False), data)


def symmetric(matrix: Any) -> SymmetricBlocks:
    """A symmetric matrix of scipy's by blocks of 3 x 3."""
    blocks = blocks_of(matrix)
    return SymmetricBlocks(replace(blocks, first=diagonal_of(blocks)))


def diagonal_of(blocks: Blocks) -> Ints:
    """Entry of each diagonal block (rows,) of a square matrix that has all of them."""
    rows = np.repeat(np.arange(len(blocks.first)), blocks.last - blocks.first)
    return np.flatnonzero(rows == blocks.indices).astype(np.int32)


@kernel
def _add_product(
    first: Ints, last: Ints, indices: Ints, data: Floats, share: float, x: Floats, y: Floats
) -> None:
    """Y += share A x."""
    rows, columns = data.shape[1:]
    for i in range(len(first)):
        for r in range(rows):
            total = 0.0
            for k in range(first[i], last[i]):
                at = columns * indices[k]
                for c in range(columns):
                    total += data[k, r, c] * x[at + c]
            y[rows * i + r] += share * total


@kernel
def _add_symmetric(
    first: Ints, last: Ints, indices: Ints, data: Floats, x: Floats, y: Floats
) -> None:
    """Y += A x by the diagonal and what is above it."""
    for i in range(len(first)):
        at = 3 * i
        a, b, c = x[at], x[at + 1], x[at + 2]
        own = data[first[i]]
        p = own[0, 0] * a + own[0, 1] * b + own[0, 2] * c
        q = own[1, 0] * a + own[1, 1] * b + own[1, 2] * c
        r = own[2, 0] * a + own[2, 1] * b + own[2, 2] * c
        for k in range(first[i] + 1, last[i]):
            j, block = 3 * indices[k], data[k]
            u, v, w = x[j], x[j + 1], x[j + 2]
            p += block[0, 0] * u + block[0, 1] * v + block[0, 2] * w
            q += block[1, 0] * u + block[1, 1] * v + block[1, 2] * w
            r += block[2, 0] * u + block[2, 1] * v + block[2, 2] * w
            y[j] += block[0, 0] * a + block[1, 0] * b + block[2, 0] * c
            y[j + 1] += block[0, 1] * a + block[1, 1] * b + block[2, 1] * c
            y[j + 2] += block[0, 2] * a + block[1, 2] * b + block[2, 2] * c
        y[at] += p
        y[at + 1] += q
        y[at + 2] += r


@kernel
def sweep(
    first: Ints,
    last: Ints,
    indices: Ints,
    data: Floats,
    inverses: Floats,
    right: Floats,
    x: Floats,
    backward: bool,
) -> None:
    """Solve row after row of blocks for its own unknowns, the entries being those that count.

    `inverses` (rows, r, r): of the diagonal blocks.
    """
    count, size = inverses.shape[:2]
    left = np.empty(size)
    for n in range(count):
        i = count - 1 - n if backward else n
        for r in range(size):
            total = 0.0
            for k in range(first[i], last[i]):
                if indices[k] != i:
                    at = size * indices[k]
                    for c in range(size):
                        total += data[k, r, c] * x[at + c]
            left[r] = right[size * i + r] - total
        for r in range(size):
            total = 0.0
            for c in range(size):
                total += inverses[i, r, c] * left[c]
            x[size * i + r] = total
