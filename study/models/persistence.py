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
class Persistence:
    """Folder of states, whether to go on from them, folder for fields or None to keep none."""

    state: Path
    resume: bool = False
    fields: Path | None = None


def checkpoint(persistence: Persistence | None, name: str) -> Checkpoint | None:
    """Where the run of that name keeps its state, if anything is kept."""
    if persistence is None:
        return None
    return Checkpoint(persistence.state / f"{name}.npz", resume=persistence.resume)


@contextmanager
def record_fields(
    persistence: Persistence | None, name: str, mesh: Mesh, times: Floats
) -> Iterator[OnSample]:
    """What a run tells its samples, so that its fields end up in NAME.vtkhdf if they are wanted."""
    if persistence is None or persistence.fields is None:
        yield lambda *_: None
        return
    raw = persistence.state / f"{name}.frames"
    path = persistence.fields / f"{name}.vtkhdf"
    with recording(path, mesh, times, raw, resume=persistence.resume) as frames:
        yield frames.write
