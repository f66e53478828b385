"""What is kept on disk of the runs while they run: states to go on from, fields."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from msm.checkpoint import Checkpoint
from study.results.fields import Mesh, recording

Floats = NDArray[np.float64]
OnSample = Callable[[int, Floats, Floats], None]


@dataclass(frozen=True)
class Keeping:
    """Folder of states, whether to go on from them, folder for fields or None to keep none."""

    state: Path
    resume: bool = False
    fields: Path | None = None


def checkpoint(keeping: Keeping | None, name: str) -> Checkpoint | None:
    """Where the run of that name keeps its state, if anything is kept."""
    if keeping is None:
        return None
    return Checkpoint(keeping.state / f"{name}.npz", resume=keeping.resume)


@contextmanager
def recorded(keeping: Keeping | None, name: str, mesh: Mesh, times: Floats) -> Iterator[OnSample]:
    """What a run tells its samples, so that its fields end up in NAME.vtkhdf if they are wanted."""
    if keeping is None or keeping.fields is None:
        yield lambda *_: None
        return
    raw = keeping.state / f"{name}.frames"
    path = keeping.fields / f"{name}.vtkhdf"
    with recording(path, mesh, times, raw, resume=keeping.resume) as frames:
        yield frames.write
