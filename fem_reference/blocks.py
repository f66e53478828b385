"""Products with sparse matrices of dense blocks, compiled: they are bound by what is read.

Nothing is reassociated: a compiler that may reorder sums gathers entries of many rows at once,
which takes several times as long. A product has two parts, which two threads compute where a
process has them, see `study.stages.threads`; the bits are those of one thread.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from study.stages.threads import side_by_side

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

kernel = numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})

WORTHWHILE = 50_000
"""Blocks of a matrix from which a second thread gains more than it costs to wake it."""


@dataclass(frozen=True)
class Blocks:
    """Row i of blocks has entries `first[i]` to `last[i]` of `data`, in columns `indices`.

    `data` (entries, r, c), r and c multiples of 3, may be in single precision, which halves what is
    read.
    """

    first: Ints
    last: Ints
    indices: Ints
    data: NDArray[Any]

    @property
    def shape(self) -> tuple[int, int]:
        """Rows, and columns of a square matrix."""
        rows, columns = self.data.shape[1:]
        return (rows * len(self.first), columns * len(self.first))

    @cached_property
    def _parts(self) -> tuple[tuple[int, int], ...]:
        """Rows from and to of parts with as many entries each: two, or one where they are few."""
        count = len(self.first)
        ends = np.cumsum(self.last - self.first, dtype=np.int64)
        if count == 0 or ends[-1] < WORTHWHILE:
            return ((0, count),)
        middle = int(np.searchsorted(ends, ends[-1] // 2))
        return (0, middle), (middle, count)

    def __matmul__(self, x: Floats) -> Floats:
        """The product with a vector."""
        found = np.zeros(len(self.first) * self.data.shape[1])
        self.add_product(x, found)
        return found

    def add_product(self, x: Floats, total: Floats, share: float = 1.0) -> None:
        """Add a share of the product to a total."""
        given = (
            self.first,
            self.last,
            self.indices,
            self.data,
            share,
            np.ascontiguousarray(x),
            total,
        )
        side_by_side(*(partial(_add_product, *rows, *given) for rows in self._parts))

    def magnitudes(self, x: Floats) -> Floats:
        """The product of the magnitudes of the matrix and of a vector, without a copy of either."""
        found = np.zeros(len(self.first) * self.data.shape[1])
        _add_magnitudes(self.first, self.last, self.indices, self.data, x, found)
        return found


@dataclass(frozen=True)
class SymmetricBlocks:
    """A symmetric matrix by blocks of 3 x 3: the first of each row on its diagonal, others above.

    There are none below. The data are in single precision, a quarter of a matrix in full.
    """

    upper: Blocks

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.upper.shape

    def __matmul__(self, x: Floats) -> Floats:
        """The product with a vector."""
        found, upper = np.zeros(len(x)), self.upper
        matrix = upper.first, upper.last, upper.indices, upper.data
        (_, middle), *later = upper._parts
        other = np.zeros(len(x) - 3 * middle)  # rows of the second part reach these alone
        parts = [(0, middle, 0, found), *((*rows, middle, other) for rows in later)]
        side_by_side(*(partial(_add_symmetric, *part[:3], *matrix, x, part[3]) for part in parts))
        found[3 * middle :] += other
        return found

    def magnitudes(self, x: Floats) -> Floats:
        """The product of the magnitudes of the matrix and of a vector."""
        return SymmetricBlocks(replace(self.upper, data=np.abs(self.upper.data))) @ np.abs(x)


@dataclass(frozen=True)
class Sweep:
    """Solves row after row of blocks for its own unknowns: a sweep of Gauss and Seidel.

    Entries lie in the order of the `rows` in which it goes, those on the diagonal left out: to go
    backward through what is stored forward takes many times as long. `inverses` (rows, r, r) are
    those of the diagonal blocks, in the order of the matrix.
    """

    rows: Ints
    entries: Blocks
    inverses: Floats

    def __call__(self, right: Floats, x: Floats) -> None:
        """Change x."""
        one = self.entries
        _sweep(self.rows, one.first, one.last, one.indices, one.data, self.inverses, right, x)


def sweep(matrix: Blocks, inverses: Floats, *, backward: bool = False) -> Sweep:
    """Through the entries of a square matrix, forward or backward."""
    rows = np.arange(len(matrix.first), dtype=np.int32)[:: -1 if backward else 1]
    kept = _entries(matrix, rows)
    owners = np.repeat(rows, (matrix.last - matrix.first)[rows])
    beside = matrix.indices[kept] != owners
    kept, owners = kept[beside], owners[beside]
    counts = np.bincount(owners, minlength=len(rows))[rows]
    return Sweep(np.ascontiguousarray(rows), _packed(matrix, kept, counts), inverses)


def _entries(matrix: Blocks, rows: Ints) -> NDArray[np.int64]:
    """Numbers of the entries of rows, one row after another."""
    first, counts = matrix.first[rows], (matrix.last - matrix.first)[rows]
    starts = np.cumsum(counts) - counts
    return np.asarray(np.repeat(first - starts, counts) + np.arange(counts.sum()))


def _packed(
    matrix: Blocks, kept: NDArray[np.int64], counts: NDArray[Any], dtype: Any = None
) -> Blocks:
    """Entries of a matrix by their numbers, so many in a row."""
    ends = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    data = matrix.data[kept].astype(dtype or matrix.data.dtype, copy=False)
    return Blocks(ends[:-1], ends[1:], matrix.indices[kept], data)


def blocks_of(matrix: Any, dtype: Any = np.float64) -> Blocks:
    """Those of a matrix of scipy's by blocks, in order of their columns.

    ValueError for blocks whose sides are no multiples of 3.
    """
    if any(side % 3 for side in matrix.blocksize):
        raise ValueError(f"blocks of {matrix.blocksize}: products go by blocks of 3 x 3")
    matrix.sort_indices()
    ends = matrix.indptr.astype(np.int32, copy=False)
    data = matrix.data.astype(dtype, copy=False)
    return Blocks(ends[:-1], ends[1:], matrix.indices.astype(np.int32, copy=False), data)


def symmetric(matrix: Blocks) -> SymmetricBlocks:
    """A symmetric matrix by blocks of 3 x 3, in half and in single precision."""
    upper = replace(matrix, first=diagonal_of(matrix))
    kept = _entries(upper, np.arange(len(upper.first), dtype=np.int32))
    return SymmetricBlocks(_packed(upper, kept, upper.last - upper.first, np.float32))


def diagonal_of(blocks: Blocks) -> Ints:
    """Entry of each diagonal block (rows,) of a square matrix that has all of them."""
    rows = np.repeat(np.arange(len(blocks.first)), blocks.last - blocks.first)
    return np.flatnonzero(rows == blocks.indices).astype(np.int32)


@kernel
def _add_product(
    start: int,
    stop: int,
    first: Ints,
    last: Ints,
    indices: Ints,
    data: Floats,
    share: float,
    x: Floats,
    y: Floats,
) -> None:
    """Y += share A x, in rows from `start` to `stop`, three by three of a block."""
    rows, columns = data.shape[1:]
    for i in range(start, stop):
        for n in range(0, rows, 3):
            p, q, r = 0.0, 0.0, 0.0
            for k in range(first[i], last[i]):
                block = data[k]
                for m in range(0, columns, 3):
                    at = columns * indices[k] + m
                    u, v, w = x[at], x[at + 1], x[at + 2]
                    p += block[n, m] * u + block[n, m + 1] * v + block[n, m + 2] * w
                    q += block[n + 1, m] * u + block[n + 1, m + 1] * v + block[n + 1, m + 2] * w
                    r += block[n + 2, m] * u + block[n + 2, m + 1] * v + block[n + 2, m + 2] * w
            y[rows * i + n] += share * p
            y[rows * i + n + 1] += share * q
            y[rows * i + n + 2] += share * r


@kernel
def _add_magnitudes(
    first: Ints, last: Ints, indices: Ints, data: Floats, x: Floats, y: Floats
) -> None:
    """Y += |A| |x|."""
    rows, columns = data.shape[1:]
    for i in range(len(first)):
        for k in range(first[i], last[i]):
            for r in range(rows):
                for c in range(columns):
                    y[rows * i + r] += abs(data[k, r, c] * x[columns * indices[k] + c])


@kernel
def _add_symmetric(
    start: int,
    stop: int,
    offset: int,
    first: Ints,
    last: Ints,
    indices: Ints,
    data: Floats,
    x: Floats,
    y: Floats,
) -> None:
    """Y += A x by the diagonal and what is above it, of some rows; y begins at row `offset`."""
    for i in range(start, stop):
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
            j -= 3 * offset
            y[j] += block[0, 0] * a + block[1, 0] * b + block[2, 0] * c
            y[j + 1] += block[0, 1] * a + block[1, 1] * b + block[2, 1] * c
            y[j + 2] += block[0, 2] * a + block[1, 2] * b + block[2, 2] * c
        at -= 3 * offset
        y[at] += p
        y[at + 1] += q
        y[at + 2] += r


@kernel
def _sweep(
    order: Ints,
    first: Ints,
    last: Ints,
    indices: Ints,
    data: Floats,
    inverses: Floats,
    right: Floats,
    x: Floats,
) -> None:
    """Solve rows in their `order`, that of `first` and `last`, for their own unknowns."""
    size = inverses.shape[1]
    left = np.empty(size)
    for number in range(len(order)):
        own = size * order[number]
        for n in range(0, size, 3):
            p, q, r = right[own + n], right[own + n + 1], right[own + n + 2]
            for k in range(first[number], last[number]):
                block = data[k]
                for m in range(0, size, 3):
                    at = size * indices[k] + m
                    u, v, w = x[at], x[at + 1], x[at + 2]
                    p -= block[n, m] * u + block[n, m + 1] * v + block[n, m + 2] * w
                    q -= block[n + 1, m] * u + block[n + 1, m + 1] * v + block[n + 1, m + 2] * w
                    r -= block[n + 2, m] * u + block[n + 2, m + 1] * v + block[n + 2, m + 2] * w
            left[n], left[n + 1], left[n + 2] = p, q, r
        inverse = inverses[order[number]]
        for n in range(size):
            total = 0.0
            for m in range(size):
                total += inverse[n, m] * left[m]
            x[own + n] = total
