"""Motion of every node of a model, recorded on disk during the run and written as one VTKHDF file.

The frames are kept in a raw file, in which a sample that is repeated is simply overwritten. The
file also holds the motion of an interrupted run, which continues in it.
"""

from __future__ import annotations

import errno
import os
import shutil
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
    """The mesh of a field: points [m] (n, 3), and tetrahedra (c, 4) or lattice cells (c, 8)."""

    points: Floats
    cells: Ints


class Frames:
    """Displacement [m] and velocity [m/s] of all nodes, (n, 3) each, at samples 0 to `count` - 1.

    Stored in a raw file of 64-bit numbers, unbuffered, so that written frames outlive the program.
    Each frame ends with a checksum. With `resume`, existing frames stay until they are overwritten,
    up to the first one that is truncated or altered.
    """

    def __init__(self, path: Path, nodes: int, *, resume: bool = False) -> None:
        self.path, self.shape = path, (2, nodes, 3)
        self.size = 8 * int(np.prod(self.shape))
        keep = resume and path.exists()
        self.file = path.open("r+b" if keep else "w+b", buffering=0)
        self.count = self._whole() if keep else 0

    def _whole(self) -> int:
        """Number of complete frames from the first on."""
        count = self.path.stat().st_size // (self.size + CHECKSUM)
        return next((k for k in range(count) if self._frame(k) is None), count)

    def _frame(self, sample: int) -> bytes | None:
        """The stored bytes of a sample, None if it is not complete."""
        with self.path.open("rb") as file:
            file.seek(sample * (self.size + CHECKSUM))
            data, checksum = file.read(self.size), file.read(CHECKSUM)
        return data if checksum == _checksum(data) else None

    def write(self, sample: int, u: Floats, v: Floats) -> None:
        """Record a sample as the last one. ValueError if earlier samples are missing."""
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
        """Displacement and velocity of a sample, by these names. OSError if it is not complete."""
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
    """Frames in the file `raw`, written to `path` when the block ends without an exception.

    Only samples up to the last one written are included, so a run that diverged ends there. `times`
    [s] (samples,). The raw file stays, for the caller to remove.
    """
    frames = Frames(raw, len(mesh.points), resume=resume)
    with frames.file:
        yield frames
        if frames.count:
            _give_out(path, mesh, times[: frames.count], frames)


def _give_out(path: Path, mesh: Mesh, times: Floats, frames: Frames) -> None:
    """Write under a temporary name, and move the complete file into place.

    OSError beforehand if the disk may be too full: HDF5 then prints pages of messages and may
    crash.
    """
    from study.results.vtkhdf import write

    if shutil.disk_usage(path.parent).free < frames.count * frames.size:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
    aside = path.with_name(f".{path.name}")
    try:
        write(aside, mesh.points, mesh.cells, times, frames.read)
        aside.replace(path)
    finally:
        aside.unlink(missing_ok=True)
