"""The step of a lattice in C, see grid.c: compiles it and lays a network out for it."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from msm.lattice import CellLattice
from msm.laws import Hooke
from msm.network import Network

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SOURCE = Path(__file__).with_name("grid.c")
FLAGS = ("-O3", "-march=native", "-ffp-contract=fast", "-shared", "-fPIC")
ENDS = np.array(
    [[0, 1], [0, 2], [0, 4], [0, 3], [1, 2], [0, 5], [1, 4], [0, 6], [2, 4]], dtype=np.int64
)
"""Corners of a cell between which its springs run, in the order of grid.c."""
CORNER = np.array([[c & 1, c >> 1 & 1, c >> 2] for c in range(8)])
"""Where those corners lie, in cells along the first, second and third axis."""
ALIGNMENT = 64


class GridInC(ctypes.Structure):
    """`Grid` of grid.c."""

    _fields_ = (
        *((name, ctypes.c_int64) for name in ("places", "second", "third")),
        *((name, ctypes.c_int64) for name in ("rows", "held_blocks", "node_rows")),
        *((name, ctypes.c_void_p) for name in ("row", "weight")),
        *((name, ctypes.c_void_p) for name in ("held_start", "held_first", "held_offset", "held")),
        *((name, ctypes.c_void_p) for name in ("node_row", "kept", "share", "load")),
        *((name, ctypes.c_void_p) for name in ("u", "v", "force")),
        *((name, ctypes.c_double) for name in ("spacing", "dt")),
    )


class Stepper(NamedTuple):
    """A lattice laid out for C; `advance(count)` takes steps under the full load, on and on.

    `motion()`: displacement [m] and velocity [m/s], each (n, 3), of the network's nodes; `reset()`
    puts them at rest.
    """

    advance: Callable[[int], None]
    motion: Callable[[], tuple[Floats, Floats]]
    reset: Callable[[], None]


def compile_grid(folder: Path, lanes: int, *, with_volume: bool = True) -> ctypes.CDLL:
    """The library for 4 or 8 lanes, built in a folder.

    CalledProcessError if compiler or processor have no such vectors, FileNotFoundError without a
    compiler.
    """
    library = folder / f"grid-{lanes}-{with_volume:d}.so"
    flags = (*FLAGS, f"-DLANES={lanes}", f"-DVOLUME={with_volume:d}")
    command = ["cc", *flags, "-o", str(library), str(SOURCE), "-lm"]
    subprocess.run(command, check=True, capture_output=True)
    found = ctypes.CDLL(str(library))
    found.steps.argtypes = [ctypes.c_void_p, ctypes.c_int64, ctypes.c_double]
    return found


def stepper(
    library: ctypes.CDLL, lanes: int, lattice: CellLattice, net: Network, law: Hooke, dt: float
) -> Stepper:
    """A network of edges and face diagonals for steps of dt [s].

    ValueError for other springs, damping that grows with the displacement or along springs.
    """
    if net.gamma_1.any() or net.beta or net.linear:
        raise ValueError("grid.c knows constant damping to ground and nonlinear geometry alone")
    index = np.rint((lattice.nodes - lattice.origin) / lattice.spacing).astype(np.int64)
    axes = np.argsort(-np.ptp(index, axis=0), kind="stable")
    index = (index - index.min(axis=0))[:, axes]
    box = _box(index, lanes)
    place = box.place(index)
    row, weight = _cells(net, law.k, index, box, lanes)
    node_row, _ = _rows(place, box, lanes)
    inertia = net.mass + dt * net.gamma_0
    arrays = {
        "row": row,
        "weight": weight,
        "node_row": node_row,
        "kept": _spread(net.mass / inertia, place, box.places),
        "share": _spread(dt / inertia, place, box.places),
        "load": _spread(net.load[:, axes].T, place, box.places),
        **{name: _aligned((3, box.places)) for name in ("u", "v", "force")},
        **_foundation(net, place, lanes),
    }
    grid = GridInC(
        places=box.places,
        second=box.second,
        third=box.third,
        rows=len(row),
        held_blocks=len(arrays["held_start"]),
        node_rows=len(node_row),
        spacing=lattice.spacing,
        dt=dt,
        **{name: found.ctypes.data for name, found in arrays.items()},
    )
    back = np.argsort(axes)

    def reset() -> None:
        for name in ("u", "v", "force"):
            arrays[name][:] = 0.0

    return Stepper(
        lambda count: library.steps(ctypes.byref(grid), count, 1.0),
        lambda: tuple(arrays[name][back][:, place].T.copy() for name in ("u", "v")),
        reset,
    )


class _Box(NamedTuple):
    """The bounding box with rows padded to blocks, and a margin all around."""

    margin: int
    second: int
    third: int
    places: int

    def place(self, index: Ints) -> Ints:
        """Places of nodes by their index (..., 3)."""
        return np.asarray(self.margin + index @ np.array([1, self.second, self.third]))


def _box(index: Ints, lanes: int) -> _Box:
    counts = index.max(axis=0) + 1
    second = _whole(int(counts[0]) + 1, lanes)
    third = second * (int(counts[1]) + 1)
    if third % 512 == 0:
        third += second  # layers a page apart would share sets of the cache
    margin = _whole(2 * (third + second), lanes) + lanes
    return _Box(margin, second, third, third * int(counts[2] + 1) + 2 * margin)


def _whole(count: int, lanes: int) -> int:
    """The next multiple of the number of lanes."""
    return -(-count // lanes) * lanes


def _aligned(shape: tuple[int, ...]) -> Floats:
    """Zeros that begin at a line of the cache."""
    size = int(np.prod(shape))
    raw = np.zeros(size + ALIGNMENT // 8)
    first = -raw.ctypes.data % ALIGNMENT // 8
    return raw[first : first + size].reshape(shape)


def _spread(values: Floats, place: Ints, places: int) -> Floats:
    """Values at nodes (..., n) at their places, zeros elsewhere."""
    found = _aligned((*values.shape[:-1], places))
    found[..., place] = values
    return found


def _rows(place: Ints, box: _Box, lanes: int) -> tuple[Ints, Ints]:
    """First place and number of blocks of each row, trimmed to the places; block of each place."""
    row, block = (place - box.margin) // box.second, place // lanes
    known, which = np.unique(row, return_inverse=True)
    first, last = np.full(len(known), np.iinfo(np.int64).max), np.zeros(len(known), dtype=np.int64)
    np.minimum.at(first, which, block)
    np.maximum.at(last, which, block)
    counts = last - first + 1
    before = np.cumsum(counts) - counts
    rows = np.column_stack([first * lanes, counts]).astype(np.int64)
    return np.ascontiguousarray(rows), before[which] + block - first[which]


def _cells(net: Network, k: float, index: Ints, box: _Box, lanes: int) -> tuple[Ints, Floats]:
    """Rows of blocks, and the weights of their springs and cells."""
    ends = net.ends.astype(np.int64)
    lowest = np.minimum(index[ends[:, 0]], index[ends[:, 1]])
    corners = np.sort((index[ends] - lowest[:, None]) @ np.array([1, 2, 4]), axis=1)
    kind = (ENDS[None] == corners[:, None]).all(axis=2)
    apart = np.abs(index[ends[:, 1]] - index[ends[:, 0]])
    if apart.max() > 1 or not kind.any(axis=1).all():
        raise ValueError("grid.c knows springs along edges and face diagonals alone")
    cells = index[net.cells.astype(np.int64)].min(axis=1) if len(net.cells) else index[:0]
    place = np.concatenate([box.place(lowest), box.place(cells)])
    which = np.concatenate([kind.argmax(axis=1), np.full(len(cells), len(ENDS))])
    value = np.concatenate([k * net.scale / net.length, net.bulk])
    rows, block = _rows(place, box, lanes)
    weight = _aligned((int(rows[:, 1].sum()), len(ENDS) + 1, lanes))
    np.add.at(weight, (block, which, place % lanes), value)
    return rows, weight


def _foundation(net: Network, place: Ints, lanes: int) -> dict[str, Any]:
    """Blocks of supported nodes, each with the offsets at which it is coupled."""
    counts = np.diff(net.row.astype(np.int64))
    node = np.repeat(np.arange(len(counts)), counts)
    offset = place[net.column.astype(np.int64)] - place[node]
    block = place[node] // lanes
    keys, which = np.unique(np.column_stack([block, offset]), axis=0, return_inverse=True)
    held = _aligned((len(keys), lanes))
    np.add.at(held, (which.ravel(), place[node] % lanes), net.value)
    start, number = np.unique(keys[:, 0], return_counts=True)
    return {
        "held_start": start * lanes,
        "held_first": np.concatenate([[0], np.cumsum(number)]).astype(np.int64),
        "held_offset": np.ascontiguousarray(keys[:, 1]),
        "held": held,
    }
