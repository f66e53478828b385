"""Motion of every node of a model, kept on disk as it runs, and given out as one VTKHDF file.

The frames wait in a raw file, where a sample that is undone is simply written over. It holds the
motion of a run that was interrupted, too, which goes on in it.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

CHECKSUM = 4
"""Bytes after each frame."""


class Mesh(NamedTuple):
    """Where fields live: points [m] (n, 3), and tetrahedra (c, 4) or lattice cells (c, 8)."""

    points: Floats
    cells: Ints


class Frames:
    """Displacement [m] and velocity [m/s] of all nodes, (n, 3) each, at samples 0 to `count` - 1.

    On a raw file of 64-bit numbers, unbuffered: what was written outlives the program. Each frame
    ends with a checksum. With `resume`, those that are in it stay until written over, up to the
    first one that is cut or altered.
    """

    def __init__(self, path: Path, nodes: int, *, resume: bool = False) -> None:
        self.path, self.shape = path, (2, nodes, 3)
        self.size = 8 * int(np.prod(self.shape))
        keep = resume and path.exists()
        self.file = path.open("r+b" if keep else "w+b", buffering=0)
        self.count = self._whole() if keep else 0

    def _whole(self) -> int:
        """How many frames are whole, from the first on."""
        count = self.path.stat().st_size // (self.size + CHECKSUM)
        return next((k for k in range(count) if self._frame(k) is None), count)

    def _frame(self, sample: int) -> bytes | None:
        """What is written of a sample, None if it is not whole."""
        with self.path.open("rb") as file:
            file.seek(sample * (self.size + CHECKSUM))
            data, checksum = file.read(self.size), file.read(CHECKSUM)
        return data if checksum == _checksum(data) else None

    def write(self, sample: int, u: Floats, v: Floats) -> None:
        """Keep a sample as the last one. ValueError if those before it are missing."""
        if sample > self.count:
            raise ValueError(
                f"{self.path}: holds the fields of {self.count} samples, and sample {sample} is to "
                "follow: they were not kept before the interruption, or are damaged; run without "
                "--resume"
            )
        self.file.seek(sample * (self.size + CHECKSUM))
        data = np.array([u, v], dtype=np.float64).tobytes()
        frame = memoryview(data + _checksum(data))
        while frame:  # an unbuffered file may take less than all
            frame = frame[self.file.write(frame) :]
        self.count = sample + 1

    def read(self, sample: int) -> dict[str, Floats]:
        """Displacement and velocity of a sample, by these names. OSError if it is not whole."""
        if not 0 <= sample < self.count:
            raise IndexError(f"{self.path}: no sample {sample} among {self.count}")
        data = self._frame(sample)
        if data is None:
            raise OSError(f"{self.path}: sample {sample} is not as it was written")
        u, v = np.frombuffer(data).reshape(self.shape)
        return {"displacement": u, "velocity": v}


def _checksum(data: bytes) -> bytes:
    return zlib.crc32(data).to_bytes(CHECKSUM, "little")


@contextmanager
def recording(
    path: Path, mesh: Mesh, times: Floats, raw: Path, *, resume: bool = False
) -> Iterator[Frames]:
    """Frames in the file `raw`, which become `path` when the block ends without an exception.

    Only samples up to the one written last are given out, so a run that was lost ends there.
    `times` [s] (samples,). The raw file stays, for the caller to remove.
    """
    frames = Frames(raw, len(mesh.points), resume=resume)
    with frames.file:
        yield frames
        if frames.count:
            _give_out(path, mesh, times[: frames.count], frames)


def _give_out(path: Path, mesh: Mesh, times: Floats, frames: Frames) -> None:
    """Write aside, and move into place what is complete."""
    from study.results.vtkhdf import write

    aside = path.with_name(f".{path.name}")
    try:
        write(aside, mesh.points, mesh.cells, times, frames.read)
        aside.replace(path)
    finally:
        aside.unlink(missing_ok=True)
