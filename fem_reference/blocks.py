"""Products with block-sparse matrices, compiled; they are limited by memory bandwidth.

Sums are not reassociated: a compiler that may reorder them gathers entries of many rows at once,
which takes several times as long. A product is divided into two parts for two threads where the
process has them (`study.stages.threads`); the result is that of one thread bit by bit.
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

# No kernel is passed as a value, and none allocates an array: without a C wrapper and reference
# counting they compile in less time.
kernel = numba.njit(
    cache=True,
    nogil=True,
    error_model="numpy",
    fastmath={"contract"},
    no_cfunc_wrapper=True,
    _nrt=False,
)

WORTHWHILE = 50_000
"""Number of blocks above which a second thread saves time."""


@dataclass(frozen=True)
class Blocks:
    """Block row i has entries `first[i]` to `last[i]` of `data`, in block columns `indices`.

    `data` (entries, r, c), with r and c multiples of 3, may be in single precision, which halves
    the memory traffic.
    """

    first: Ints
    last: Ints
    indices: Ints
    data: NDArray[Any]

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of rows and columns, assuming as many block rows as block columns."""
        rows, columns = self.data.shape[1:]
        return (rows * len(self.first), columns * len(self.first))

    @cached_property
    def _parts(self) -> tuple[tuple[int, int], ...]:
        """Ranges of rows of two parts with equal numbers of entries, or one part of few entries."""
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
        """Add `share` times the product to `total` in place."""
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
        """Product of the absolute values of the matrix and of a vector, without copies."""
        found = np.zeros(len(self.first) * self.data.shape[1])
        _add_magnitudes(self.first, self.last, self.indices, self.data, x, found)
        return found


@dataclass(frozen=True)
class SymmetricBlocks:
    """Upper triangle of a symmetric matrix in blocks of 3 x 3; each row starts at its diagonal.

    In single precision it takes a quarter of the memory of the full matrix.
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
        """Product of the absolute values of the matrix and of a vector."""
        return SymmetricBlocks(replace(self.upper, data=np.abs(self.upper.data))) @ np.abs(x)


@dataclass(frozen=True)
class Sweep:
    """Block Gauss-Seidel sweep through `rows` in a given order.

    The off-diagonal entries are stored in the order of the sweep: a backward sweep through entries
    stored forward takes many times as long. `inverses` (rows, r, r): inverses of the diagonal
    blocks, in the order of the matrix.
    """

    rows: Ints
    entries: Blocks
    inverses: Floats

    def __call__(self, right: Floats, x: Floats) -> None:
        """Update x in place for the right-hand side."""
        one, room = self.entries, np.empty(self.inverses.shape[1])
        _sweep(self.rows, one.first, one.last, one.indices, one.data, self.inverses, right, x, room)


def sweep(matrix: Blocks, inverses: Floats, *, backward: bool = False) -> Sweep:
    """Gauss-Seidel sweep of a square matrix, forward or backward."""
    rows = np.arange(len(matrix.first), dtype=np.int32)[:: -1 if backward else 1]
    kept = _entries(matrix, rows)
    owners = np.repeat(rows, (matrix.last - matrix.first)[rows])
    beside = matrix.indices[kept] != owners
    kept, owners = kept[beside], owners[beside]
    counts = np.bincount(owners, minlength=len(rows))[rows]
    return Sweep(np.ascontiguousarray(rows), _packed(matrix, kept, counts), inverses)


def _entries(matrix: Blocks, rows: Ints) -> NDArray[np.int64]:
    """Indices of the entries of the given rows, row by row."""
    first, counts = matrix.first[rows], (matrix.last - matrix.first)[rows]
    starts = np.cumsum(counts) - counts
    return np.asarray(np.repeat(first - starts, counts) + np.arange(counts.sum()))


def _packed(
    matrix: Blocks, kept: NDArray[np.int64], counts: NDArray[Any], dtype: Any = None
) -> Blocks:
    """Matrix of the chosen entries, with the given number in each row."""
    ends = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    data = matrix.data[kept].astype(dtype or matrix.data.dtype, copy=False)
    return Blocks(ends[:-1], ends[1:], matrix.indices[kept], data)


def blocks_of(matrix: Any, dtype: Any = np.float64) -> Blocks:
    """Blocks of a scipy BSR matrix, sorted by column.

    ValueError for blocks whose sides are not multiples of 3.
    """
    if any(side % 3 for side in matrix.blocksize):
        raise ValueError(f"blocks of {matrix.blocksize}: products go by blocks of 3 x 3")
    matrix.sort_indices()
    ends = matrix.indptr.astype(np.int32, copy=False)
    data = matrix.data.astype(dtype, copy=False)
    return Blocks(ends[:-1], ends[1:], matrix.indices.astype(np.int32, copy=False), data)


def symmetric(matrix: Blocks) -> SymmetricBlocks:
    """Upper triangle of a symmetric matrix of 3 x 3 blocks, in single precision."""
    upper = replace(matrix, first=diagonal_of(matrix))
    kept = _entries(upper, np.arange(len(upper.first), dtype=np.int32))
    return SymmetricBlocks(_packed(upper, kept, upper.last - upper.first, np.float32))


def diagonal_of(blocks: Blocks) -> Ints:
    """Index (rows,) of each diagonal block of a square matrix, which has all of them."""
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
    left: Floats,
) -> None:
    """Solve rows in their `order`, that of `first` and `last`, for their own unknowns.

    `left` (r,): space for the residual of a row.
    """
    size = inverses.shape[1]
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
